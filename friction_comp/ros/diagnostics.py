# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes each node's state on /diagnostics."""

from collections.abc import Callable, Iterable, Sequence
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from friction_comp.ros.ros_start import steady_timer

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Diagnostics:
    """Publishes a node's state once per second of real time, and at once when it changes.

    The name is ``node: task``, as in diagnostic_updater, so that aggregators and plotting tools
    find it. `report` returns level, message and values by name. `hardware` is that of the node, for
    instance its joints.
    """

    def __init__(self, node: Any, report: Callable[[], tuple[Any, ...]], hardware: str,
                 task: str) -> None:
        self._node = node
        self._report = report
        self._status = DiagnosticStatus(
            name=f'{node.get_fully_qualified_name().lstrip("/")}: {task}', hardware_id=hardware)
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        steady_timer(node, 1.0, self.publish)

    def publish(self) -> None:
        """Publish the state now."""
        self._status.level, self._status.message, values = self._report()
        self._status.values = [
            KeyValue(key=key, value=f'{value:.6g}' if isinstance(value, float) else str(value))
            for key, value in values.items()]
        message = DiagnosticArray(status=[self._status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)


def per_joint(joints: Sequence[str], key: str, values: Iterable[float]) -> dict[str, float]:
    """Return a diagnostic value for each joint, ``joint: key``."""
    return {f'{joint}: {key}': float(value) for joint, value in zip(joints, values)}


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
