# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Measures a drive: look-up table, sigmoid of Eq. 6, breakaway currents of Eq. 9 and 10."""
