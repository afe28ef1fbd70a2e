# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identifies a drive: look-up table, sigmoid of Eq. 6, and breakaway currents."""
