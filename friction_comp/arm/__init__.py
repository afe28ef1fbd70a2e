# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The whole arm: what links and loads ask of each joint's motor, beside the joint's friction."""
