# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How every node starts, runs and ends."""

from __future__ import annotations

import argparse
import gc
import signal
import sys
import traceback

import rclpy
from rclpy.exceptions import ROSInterruptException
from rclpy.executors import ExternalShutdownException
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from friction_comp.errors import InputError
from friction_comp.nodes.executor import StreamExecutor

_LAST_ROUNDS = 10


class _Parser(argparse.ArgumentParser):
    def error(self, message):
        raise InputError(message)


def run(name, description, make_node, argv=None):
    """Start a node, spin it until it is done or told to stop, and let it leave in order.

    Signals are not left to rclpy: it would tear the context down at once, and then no zero
    current could be sent any more.

    Parameters
    ----------
    name : str
        Name of the executable.
    description : str
        One sentence for ``--help``.
    make_node : callable
        Returns the node. Its method `leave()` is called however the node ends; its attribute
        `finished` (False) ends it from within, `fast_timers` is the executor's.
    argv : list of str, optional
        Arguments, ROS arguments included; those of the process when omitted.

    Returns
    -------
    int
        0 when it ended on its own or by SIGINT or SIGTERM, 1 after an exception.

    Raises
    ------
    InputError
        If an argument, parameter or file cannot be used.
    """
    argv = sys.argv[1:] if argv is None else list(argv)
    parser = _Parser(prog=name, description=description, epilog=(
        'Parameters, remappings and names are given after --ros-args, for instance '
        '--ros-args -p NAME:=VALUE -r FROM:=TO.'))
    parser.parse_args(remove_ros_args([name, *argv])[1:])
    caught = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: caught.append(number))
    try:
        rclpy.init(args=[name, *argv], signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:
        # Bad ROS arguments and parameter files come as different errors without a common base.
        raise InputError(f'ROS arguments: {error}') from None
    try:
        node = make_node()
        executor = StreamExecutor(node)
        # What lives until the end is not to be searched for garbage between two samples.
        gc.collect()
        gc.freeze()
        try:
            return _spin(executor, node, caught)
        finally:
            node.leave()
            # What leaving has set off, such as an action's result, is to go out.
            for _ in range(_LAST_ROUNDS):
                executor.spin_once(0.0)
            node.destroy_node()
    finally:
        rclpy.try_shutdown()


def _spin(executor, node, caught):
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
