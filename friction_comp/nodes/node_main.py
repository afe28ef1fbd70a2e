# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Starts, runs and ends every node."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
import gc
import os
import signal
import sys
import threading
import time
import traceback
from typing import Any, NoReturn

import rclpy
from rclpy.exceptions import ROSInterruptException
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.utilities import remove_ros_args

from friction_comp.compiling import compile_rest, import_numba
from friction_comp.errors import InputError
from friction_comp.nodes.executor import StreamExecutor
from friction_comp.nodes.peers import Peers
from friction_comp.nodes.ros_start import start_ros, without_places

_LAST_ROUNDS = 10
# All that would end the process without a word, as far as a process may prevent it.
SIGNALS = [getattr(signal, name) for name in (
    'SIGINT', 'SIGTERM', 'SIGHUP', 'SIGQUIT', 'SIGABRT', 'SIGUSR1', 'SIGUSR2', 'SIGALRM',
    'SIGVTALRM', 'SIGPROF', 'SIGXCPU', 'SIGIO', 'SIGPWR', 'SIGSTKFLT') if hasattr(signal, name)]
# s after which one thread lets another run: a model that is loaded must not hold up the loop.
_SWITCH_INTERVAL = 5e-4


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(message)


def run(name: str, description: str, make_node: Callable[[], Any],
        argv: Sequence[str] | None = None) -> int:
    """Start a node, spin it until it is done or stopped, and shut it down in order.

    Signals are not left to rclpy: it would tear the context down at once, and then no zero
    current could be sent any more.

    Parameters
    ----------
    name : str
        Name of the executable.
    description : str
        One sentence for ``--help``.
    make_node : callable
        Returns the node. Its method `leave()` is called however the node ends; `let_go()`, where
        it has one, as soon as a signal comes, and in another thread; its attribute `finished`
        (False) ends it from within, `fast_timers` is the executor's.
    argv : list of str, optional
        Arguments, ROS arguments included; those of the process when omitted.

    Returns
    -------
    int
        0 when it ended on its own or by one of SIGNALS, 1 after an exception.

    Raises
    ------
    InputError
        If an argument, parameter or file cannot be used.
    """
    argv = sys.argv[1:] if argv is None else list(argv)
    parser = _Parser(prog=name, description=description, epilog=(
        'Parameters, remappings and names are given after --ros-args, for instance '
        '--ros-args -p NAME:=VALUE -r FROM:=TO.'))
    signals = _Signals()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    try:
        own = remove_ros_args([name, *argv])[1:]
    except Exception as error:
        raise InputError(f'ROS arguments: {without_places(error)}') from None
    start_ros(name, argv)
    try:
        parser.parse_args(own)
        # Where kernels are compiled at once: numba would import the rest of itself, and more, at
        # the first call.
        if 'numba' in sys.modules:
            import_numba()
        try:
            node = make_node()
        except _rclpy.RCLError as error:
            # Keys that are missing, a middleware without security.
            raise InputError(without_places(error)) from None
        signals.tell(getattr(node, 'let_go', None))
        Peers(node)
        executor = StreamExecutor(node)
        # What lives until the end is not to be searched for garbage between two samples.
        gc.collect()
        gc.freeze()
        threading.Thread(
            target=_compile, args=(node.get_logger(),), name='compiling', daemon=True).start()
        try:
            return _spin(executor, node, signals.caught)
        finally:
            node.leave()
            # What leaving has set off, such as an action's result, is to go out.
            for _ in range(_LAST_ROUNDS):
                executor.spin_once(0.0)
            node.destroy_node()
    finally:
        rclpy.try_shutdown()


def _compile(logger: Any) -> None:
    """Exchange kernels that began as plain Python for compiled ones, while the node spins."""
    begin = time.monotonic()
    try:
        if compile_rest():
            logger.info(f'compiled code is in place after {time.monotonic() - begin:.2g} s')
    except Exception as error:
        logger.warning(f'goes on in plain Python, since compiled code cannot be had: {error!r}')


class _Signals:
    """Catches signals.

    Python's own handlers wait until the main thread comes back from what it does. A thread hears
    of the signal through a pipe that the interpreter writes to without waiting for anything.
    """

    def __init__(self) -> None:
        self.caught: list[int] = []
        self._tell: Callable[[], None] | None = None
        self._came = False
        for signum in SIGNALS:
            signal.signal(signum, lambda signum, _: self.caught.append(signum))
        end, begin = os.pipe()
        os.set_blocking(begin, False)
        signal.set_wakeup_fd(begin, warn_on_full_buffer=False)
        threading.Thread(
            target=self._listen, args=(end,), name='signals', daemon=True).start()

    def tell(self, whom: Any) -> None:
        """Call a function, from another thread, when a signal comes, or now if one came."""
        self._tell = whom
        if self._came and whom is not None:
            whom()

    def _listen(self, end: Any) -> None:
        while True:
            if set(os.read(end, 16)) & set(SIGNALS):
                self._came = True
                if self._tell is not None:
                    self._tell()


def _spin(executor: Any, node: Any, caught: Any) -> Any:
    try:
        while not caught and not node.finished:
            executor.spin_once()
    except (ExternalShutdownException, ROSInterruptException):
        pass
    except InputError:
        raise
    except Exception:
        node.get_logger().fatal(f'stopped by an error:\n{traceback.format_exc()}')
        return 1
    return 0
