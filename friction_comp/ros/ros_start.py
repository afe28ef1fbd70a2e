# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Initialises ROS 2 for nodes and tools; nothing that is logged waits for a reader or a disk."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
import os
import re
import stat
import sys
from typing import Any

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from friction_comp.errors import InputError
from friction_comp.files import package_file

_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'


def start_ros(name: str, arguments: Sequence[str], context: Context | None = None) -> None:
    """Initialise ROS 2, by default its global context, without its signal handlers."""
    with _quick_middleware():
        try:
            # A log file could wait for its disk: see `dropping_log`.
            rclpy.init(args=[name, *arguments, '--ros-args', '--disable-external-lib-logs'],
                       context=context, signal_handler_options=SignalHandlerOptions.NO)
        except Exception as error:
            # The errors have no common base class.
            raise InputError(f'ROS arguments: {without_source_locations(error)}') from None


@contextmanager
def _quick_middleware() -> Iterator[None]:
    """Start Fast DDS with the settings of this package, unless there are others."""
    local = os.environ.get(_RANGE) == 'LOCALHOST' and not os.environ.get('ROS_STATIC_PEERS')
    own = str(package_file('config', 'fast_dds_localhost.xml' if local else 'fast_dds.xml'))
    if os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', own) != own or not local:
        yield
        return
    # Otherwise ROS 2 would add shared memory.
    os.environ[_RANGE] = 'SYSTEM_DEFAULT'
    try:
        yield
    finally:
        os.environ[_RANGE] = 'LOCALHOST'


@contextmanager
def own_node(name: str, arguments: Sequence[str] = ()) -> Iterator[Node]:
    """Yield a node of a tool, in a separate context."""
    context = Context()
    start_ros(name, arguments, context)
    node = Node(name, context=context)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)


def steady_timer(node: Any, seconds: float, callback: Callable[[], Any], **options: Any) -> Any:
    """Create a timer in real time, which also runs while simulated time stops."""
    return node.create_timer(
        seconds, callback, clock=Clock(clock_type=ClockType.STEADY_TIME), **options)


def without_source_locations(error: Exception) -> str:
    """Return an error of rcl without its source locations."""
    return re.sub(r',? at \S+:\d+', '', str(error))


@contextmanager
def dropping_log() -> Iterator[None]:
    """Drop what standard error does not take at once, whoever writes it, in the block.

    A log line of ROS 2 is written by compiled code that holds Python's interpreter lock: where
    standard error is a pipe that nobody reads, such as that of a ``| less`` at its first page, one
    line would stop every thread of a node, its watchdog included.
    """
    os.environ['RCUTILS_LOGGING_USE_STDOUT'] = '0'
    before = os.dup(2)
    with suppress(OSError):
        if not stat.S_ISREG(os.fstat(2).st_mode):
            # Opened anew, since whoever started this program writes there, too.
            own = os.open('/proc/self/fd/2', os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
            os.dup2(own, 2)
            os.close(own)
    try:
        yield
    finally:
        with suppress(OSError):
            sys.stderr.flush()
        os.dup2(before, 2)
        os.close(before)
