# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The programs of a ROS 2 graph: a node turns messages into calls of other rooms, and back."""
