# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Initialises ROS 2 for nodes and tools, with a one-line error where that fails; timers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import os
import re
from typing import Any

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from friction_comp.errors import InputError
from friction_comp.package_files import package_file


def start_ros(name: str, arguments: Sequence[str], context: Context | None = None) -> None:
    """Initialise ROS 2, by default its global context, without its signal handlers."""
    # With Fast DDS, what was lost is repeated within a tenth of a second instead of three.
    os.environ.setdefault(
        'FASTRTPS_DEFAULT_PROFILES_FILE', str(package_file('config', 'quick_repeats.xml')))
    try:
        rclpy.init(args=[name, *arguments], context=context,
                   signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:
        # The errors have no common base class.
        text = without_source_locations(error)
        if 'log' in text and 'directory' in text:
            raise InputError(f'ROS 2 cannot write its log: {text}. Set the environment variable '
                             'ROS_LOG_DIR to a folder that can be written') from None
        raise InputError(f'ROS arguments: {text}') from None


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
