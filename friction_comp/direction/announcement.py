# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a source announces for a joint."""

from __future__ import annotations

from dataclasses import dataclass
import math


@dataclass(frozen=True)
class Announcement:
    """The direction of a joint's coming movement.

    Attributes
    ----------
    direction : int
        -1, 0 or +1.
    reason : str
        Why, in words for diagnostics.
    end : float
        Position at which the announced movement ends, rad; NaN if that is not known.
    fault : bool
        Whether the source cannot be used; the direction is then 0.
    is_pushed : bool
        Whether a sensor feels beyond doubt that the person pushes in this direction.
    """

    direction: int
    reason: str
    end: float = math.nan
    fault: bool = False
    is_pushed: bool = False
