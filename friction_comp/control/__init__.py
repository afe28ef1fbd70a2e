# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""From one joint state to one current, or to zero in case of doubt; knows no ROS 2."""
