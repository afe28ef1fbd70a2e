# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What `direction_table` measures of directions from cheap sensors, a leader and a plan."""
