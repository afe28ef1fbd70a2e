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


def look_for_peers(node: Any) -> None:
    """Warn once if no other node is found in time: nobody would receive diagnostics."""
    begin, warned = time.monotonic(), False

    def check() -> None:
        nonlocal warned
        passed = time.monotonic() - begin
        # Hidden nodes of tools, such as the daemon of `ros2`, are not counted.
        others = [name for name in node.get_node_names() if not name.startswith('_')]
        if node.get_name() in others:
            others.remove(node.get_name())
        if others:
            timer.cancel()
            if warned:
                node.get_logger().info(f'found {", ".join(others)} after {passed:.3g} s')
        elif passed >= PATIENCE and not warned:
            warned = True
            node.get_logger().warning(alone(PATIENCE))

    timer = node.create_timer(
        min(1.0, PATIENCE), check, clock=Clock(clock_type=ClockType.STEADY_TIME))
