# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Which effects are tried, and which one is taken."""
