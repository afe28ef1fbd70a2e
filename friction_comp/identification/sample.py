# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a motion is told of its joint at a time."""

from __future__ import annotations

from typing import NamedTuple


class Sample(NamedTuple):
    """A sample for a motion: s, rad and A; current is NaN if unknown."""

    time: float
    position: float
    current: float
