# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a source announces for a joint, and how far the announcement reaches."""

from __future__ import annotations

from dataclasses import dataclass
import math

END_MARGIN = 0.03
"""rad, 1.7 deg, beyond the announced end of a movement within which its direction still holds. A
person's arm and a trajectory controller come to rest within a degree or two of the goal; a smaller
margin would take the direction back just before, a larger one lets a joint that runs by itself go
further."""


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
    """

    direction: int
    reason: str
    end: float = math.nan
    fault: bool = False


def beyond_end(direction: float, end: float, position: float, margin: float = END_MARGIN) -> bool:
    """Return whether a joint is beyond the end of the movement that was announced for it.

    Parameters
    ----------
    direction : float
        -1, 0 or +1.
    end, position : float
        rad; an end that is not finite is not known, and nothing is beyond it.
    margin : float
        rad.
    """
    return direction * (position - end) > margin
