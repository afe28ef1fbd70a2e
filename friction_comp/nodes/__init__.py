# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The programs of a robot's ROS 2 graph, each in a module of its name; rooms without ROS work."""
