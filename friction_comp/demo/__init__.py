# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The scenes of the demo, which run the whole loop over ROS 2 on one machine."""
