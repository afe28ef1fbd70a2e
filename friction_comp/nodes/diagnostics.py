# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What every node says of itself on /diagnostics."""

from __future__ import annotations

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Diagnostics:
    """Publishes a node's state once a second of real time, also while simulated time rests.

    Parameters
    ----------
    node : rclpy.node.Node
    report : callable
        Returns (level, message, values) with values a dict of what str() can show.
    hardware : str
        What the node works on, for instance its joints.
    """

    def __init__(self, node, report, hardware=''):
        self._node = node
        self._report = report
        self._status = DiagnosticStatus(
            name=node.get_fully_qualified_name().lstrip('/'), hardware_id=hardware)
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        node.create_timer(1.0, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publish(self):
        """Publish the state now."""
        self._status.level, self._status.message, values = self._report()
        self._status.values = [
            KeyValue(key=key, value=f'{value:.6g}' if isinstance(value, float) else str(value))
            for key, value in values.items()]
        message = DiagnosticArray(status=[self._status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)


class Rate:
    """Counts events and says how many a second there were since it was last asked."""

    def __init__(self):
        self.count = 0
        self._asked = (time.monotonic(), 0)

    def tick(self):
        """Count one."""
        self.count += 1

    def per_second(self):
        """Return the rate in Hz since the last call."""
        now = time.monotonic()
        before, count = self._asked
        self._asked = (now, self.count)
        return (self.count - count) / max(now - before, 1e-3)
