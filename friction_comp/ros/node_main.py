# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Starts, runs and ends every node."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import gc
import inspect
import os
import signal
import sys
import threading
import time
import traceback
from typing import Any

import rclpy
from rclpy.action import ActionServer
from rclpy.exceptions import ROSInterruptException
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.utilities import remove_ros_args

from friction_comp.errors import InputError
from friction_comp.interrupts import ENDING, STOPPING
from friction_comp.ros.executor import StreamExecutor
from friction_comp.ros.ros_start import dropping_log, start_ros, without_source_locations

# Spins after leaving, and real s of them if a goal ended by it: its client may ask only now.
_FINAL_SPINS, _FAREWELL = 10, 0.3
# Switch interval of threads, s: loading a model must not delay the control loop.
_SWITCH_INTERVAL = 5e-4


def run(name: str, make_node: Callable[[], Any], argv: Sequence[str]) -> int:
    """Start a node, spin it until it is done or a signal ends it, and shut it down in order.

    Return 0 if it ended by itself or by a signal, 1 after an exception; raise InputError if
    an argument, parameter or file cannot be used.

    Signals are not handled by rclpy, which would shut the context down at once, so that zero
    current could no longer be published. Those that would stop the process (Ctrl-Z) end it, too.

    A node may have a method `leave()`, which is always called at the end, and an attribute
    `finished`, with which it ends by itself. One that drives a motor has `stop_motor()`, which
    commands zero current and blocks all later commands; it is called in another thread as soon as a
    signal arrives, and at the end whatever happened.
    """
    signals = _Signals()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    try:
        unknown = remove_ros_args([name, *argv])[1:]
    except Exception as error:
        raise InputError(f'ROS arguments: {without_source_locations(error)}') from None
    if unknown:
        raise InputError(f'unrecognized arguments: {" ".join(unknown)} (parameters and remappings '
                         'come after --ros-args)')
    with dropping_log(name):
        start_ros(name, argv)
        try:
            return _run(make_node, signals)
        finally:
            rclpy.try_shutdown()


def _run(make_node: Callable[[], Any], signals: _Signals) -> int:
    node, why = None, ''
    try:
        node = make_node()
    except (InputError, _rclpy.RCLError) as error:
        # For instance missing keys, or a middleware without security.
        why = without_source_locations(error)
    if node is None:
        # What there is of it must be gone before the middleware.
        gc.collect()
        raise InputError(why)
    stop_motor = getattr(node, 'stop_motor', _do_nothing)
    signals.set_callback(stop_motor)
    executor = StreamExecutor(node)
    # The first line that rclpy logs looks for its caller through all modules, for 50 ms.
    inspect.getframeinfo(inspect.currentframe())    # type: ignore[arg-type]
    # Exclude long-lived objects from garbage collection between samples.
    gc.collect()
    gc.freeze()
    try:
        while not signals.caught and not getattr(node, 'finished', False):
            executor.spin_once()
    except (ExternalShutdownException, ROSInterruptException):
        pass
    except InputError:
        raise
    except Exception:
        node.get_logger().fatal(f'stopped by an error:\n{traceback.format_exc()}')
        return 1
    finally:
        # First, so that zero is the last command also if leaving fails.
        stop_motor()
        getattr(node, 'leave', _do_nothing)()
        _say_farewell(executor)
        # Its wait set holds the node's entities, and must not outlive the context.
        executor.shutdown(0.0)
        _destroy(node)
    return 0


def _say_farewell(executor: StreamExecutor) -> None:
    """Publish what leaving has caused, such as the result of an action."""
    end = time.monotonic() + _FAREWELL * executor.has_coroutines
    for _ in range(_FINAL_SPINS):
        executor.spin_once(0.0)
    while time.monotonic() < end:
        executor.spin_once()


def _destroy(node: Any) -> None:
    """Destroy a node, and what `destroy_node` forgets.

    That would keep the node in the middleware until the process is over.
    """
    for waitable in list(node.waitables):
        if isinstance(waitable, ActionServer):
            waitable.destroy()
    node.destroy_node()
    state_machine = getattr(node, '_state_machine', None)
    if state_machine is not None:
        state_machine.destroy_when_not_in_use()


class _Signals:
    """Catches signals.

    Python runs signal handlers only in the main thread, when it returns to the interpreter. A
    separate thread is notified at once through the interpreter's wakeup pipe.
    """

    def __init__(self) -> None:
        self.caught: list[int] = []
        self._callback: Callable[[], None] = _do_nothing
        for signum in (*ENDING, *STOPPING):
            signal.signal(signum, lambda signum, _: self.caught.append(signum))
        end, begin = os.pipe()
        os.set_blocking(begin, False)
        signal.set_wakeup_fd(begin, warn_on_full_buffer=False)
        self._arrived = False
        threading.Thread(
            target=self._listen, args=(end,), name='signals', daemon=True).start()

    def set_callback(self, callback: Callable[[], None]) -> None:
        """Set the function to call, in another thread, at a signal; call it now if one arrived."""
        self._callback = callback
        if self._arrived:
            callback()

    def _listen(self, end: int) -> None:
        while os.read(end, 16):
            self._arrived = True
            self._callback()


def _do_nothing() -> None:
    """Do nothing."""
