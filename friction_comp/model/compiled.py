# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Eq. 6 for compiled code."""

from __future__ import annotations

from friction_comp.compiling import njit
from friction_comp.model.sigmoid import kinetic_current

compiled_kinetic_current = njit(cache=True)(kinetic_current)
