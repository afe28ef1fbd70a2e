# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Warns in the log when a node has found no other node."""

from __future__ import annotations

import time
from typing import Any

from rclpy.clock import Clock, ClockType

from friction_comp.monitoring.network import alone

PATIENCE = 10.0
"""Real s without another node after which a warning is logged; discovery takes seconds at most."""

_CHECK_PERIOD = 1.0   # s


class Peers:
    """Waits for other nodes, and warns once if none is found.

    Diagnostics would not be received then, so the warning is logged.

    Parameters
    ----------
    node : rclpy.node.Node
    patience : float, optional
        s; `PATIENCE` by default.
    """

    def __init__(self, node: Any, patience: float | None = None) -> None:
        self._node = node
        self._patience = PATIENCE if patience is None else patience
        self._begin, self._warned = time.monotonic(), False
        self._timer = node.create_timer(
            min(_CHECK_PERIOD, self._patience), self._check,
            clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _check(self) -> None:
        passed = time.monotonic() - self._begin
        # Hidden nodes of tools, such as the daemon of `ros2`, are not counted.
        others = [name for name in self._node.get_node_names() if not name.startswith('_')]
        if self._node.get_name() in others:
            others.remove(self._node.get_name())
        if others:
            self._timer.cancel()
            if self._warned:
                self._node.get_logger().info(f'found {", ".join(others)} after {passed:.3g} s')
        elif passed >= self._patience and not self._warned:
            self._warned = True
            self._node.get_logger().warning(alone(self._patience))
