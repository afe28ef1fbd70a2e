# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What nodes and tools need of ROS 2 beyond rclpy; nobody else touches rclpy's private parts."""
