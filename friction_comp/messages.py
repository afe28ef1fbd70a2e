# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The package's topics, and stamps of messages as whole nanoseconds, which add without rounding."""

from __future__ import annotations

from typing import Any

TOPICS = {
    'joint_states': 'sensor_msgs/msg/JointState',
    'current_command': 'std_msgs/msg/Float64MultiArray',
    'direction': 'std_msgs/msg/Int8MultiArray',
    'direction_stamped': 'sensor_msgs/msg/JointState',
    'reference': 'sensor_msgs/msg/JointState',
    'interaction_wrench': 'geometry_msgs/msg/WrenchStamped',
    'motor_temperature': 'sensor_msgs/msg/Temperature',
}
"""Relative name to message type. In recordings, topics are found by the ending of their name."""

TORQUE_UNIT = 'N.m'
"""Label of a command's second dimension if its values are in N·m at the joint. It is ASCII, since
not every reader of ROS messages accepts other characters. Any other label, or none, means A."""
NANO = 1_000_000_000
"""Nanoseconds in a second."""


def nanoseconds(stamp: Any) -> int:
    """Return a builtin_interfaces/Time in ns."""
    return stamp.sec * NANO + stamp.nanosec


def set_stamp(stamp: Any, value: int) -> None:
    """Set a builtin_interfaces/Time to a time in ns."""
    stamp.sec, stamp.nanosec = divmod(value, NANO)
