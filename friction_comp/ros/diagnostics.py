# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes each node's state on /diagnostics."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np

from friction_comp.ros.ros_start import steady_timer

# Real s between reports.
PERIOD = 1.0
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Diagnostics:
    """Publishes a node's state once per second of real time, and at once when it changes.

    The name is ``node: task``, as in diagnostic_updater, so that aggregators and plotting tools
    find it. `report` returns level, message and values by name; an array has a number for each of
    `hardware`, the joints of the node, and becomes a value ``joint: name`` for each.
    """

    def __init__(self, node: Any, report: Callable[[], tuple[Any, ...]], hardware: Sequence[str],
                 task: str) -> None:
        self._node, self._report, self._hardware = node, report, hardware
        self._status = DiagnosticStatus(
            name=f'{node.get_fully_qualified_name().lstrip("/")}: {task}',
            hardware_id=', '.join(hardware))
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        steady_timer(node, PERIOD, self.publish)

    def publish(self) -> None:
        """Publish the state now."""
        self._status.level, self._status.message, values = self._report()
        self._status.values = [
            KeyValue(key=key, value=f'{value:.6g}' if isinstance(value, float) else str(value))
            for key, value in self._singly(values)]
        message = DiagnosticArray(status=[self._status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _singly(self, values: dict[str, Any]) -> Iterator[tuple[str, Any]]:
        for name, value in values.items():
            if isinstance(value, (list, array, np.ndarray)):
                yield from ((f'{joint}: {name}', float(one))
                            for joint, one in zip(self._hardware, value))
            else:
                yield name, value


class Rate:
    """The rate of events, of which `count` is the number so far."""

    def __init__(self) -> None:
        self.count = 0
        self._last_call = (time.monotonic(), 0)

    def per_second(self) -> float:
        """Return the rate in Hz since the last call."""
        now = time.monotonic()
        before, count = self._last_call
        self._last_call = (now, self.count)
        return (self.count - count) / max(now - before, 1e-3)
