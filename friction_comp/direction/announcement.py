# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a source announces for a joint."""

from __future__ import annotations

from dataclasses import dataclass
import math


@dataclass(frozen=True)
class Announcement:
    """The direction of a joint's coming movement."""

    direction: int  # -1, 0 or +1
    reason: str  # why, in words for diagnostics
    end: float = math.nan  # position at which the announced movement ends, rad; NaN if not known
    fault: bool = False  # whether the source cannot be used; the direction is then 0
    is_pushed: bool = False  # whether a sensor feels beyond doubt that the person pushes this way
