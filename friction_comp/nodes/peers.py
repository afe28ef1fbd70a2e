# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Warns in the log when a node has found no other node."""

from __future__ import annotations

import time
from typing import Any

from rclpy.clock import Clock, ClockType

from friction_comp.monitoring.network import alone

PATIENCE = 10.0
"""Real s without another node after which the log says so: discovery takes seconds at most."""

_LOOK = 1.0   # s


class Peers:
    """Looks for other nodes until one is found, and says once that none is.

    What a node says on topics nobody hears then, so the log is all there is.

    Parameters
    ----------
    node : rclpy.node.Node
    patience : float, optional
        s; `PATIENCE` by default.
    """

    def __init__(self, node: Any, patience: float | None = None) -> None:
        self._node = node
        self._patience = PATIENCE if patience is None else patience
        self._begin, self._told = time.monotonic(), False
        self._timer = node.create_timer(
            min(_LOOK, self._patience), self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _look(self) -> None:
        passed = time.monotonic() - self._begin
        # Tools' own helpers, such as the daemon of `ros2`, are no peers.
        others = [name for name in self._node.get_node_names() if not name.startswith('_')]
        if self._node.get_name() in others:
            others.remove(self._node.get_name())
        if others:
            self._timer.cancel()
            if self._told:
                self._node.get_logger().info(f'found {", ".join(others)} after {passed:.3g} s')
        elif passed >= self._patience and not self._told:
            self._told = True
            self._node.get_logger().warning(alone(self._patience))
