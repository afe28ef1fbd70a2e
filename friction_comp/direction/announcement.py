# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a source announces for a joint, and how far the announcement reaches."""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np

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


class MovementEnds:
    """Takes directions back beyond the ends of the movements that they were announced for.

    A joint that has been beyond the end of its movement has no direction until another movement is
    announced: so a drive that lost friction, or a joint that a hand let go, does not go on.
    """

    def __init__(self, joints: int) -> None:
        self._joints = joints
        self.forget()

    def forget(self) -> None:
        """Remove all ends."""
        self._announced = [(0.0, math.nan)] * self._joints
        self._over: set[int] = set()
        self._bounded: set[int] = set()

    def announce(self, joint: int, direction: float, end: float = math.nan) -> None:
        """Set a joint's direction and the position in rad at which its movement ends.

        NaN: it is not said; what was said with the same direction remains.
        """
        before, end_before = self._announced[joint]
        if direction == before and (math.isnan(end) or end == end_before):
            return
        self._announced[joint] = direction, end
        self._over.discard(joint)
        (self._bounded.add if direction and math.isfinite(end) else self._bounded.discard)(joint)

    def within(self, directions: np.ndarray, position: np.ndarray | None = None) -> np.ndarray:
        """Return the directions, shape (J,), with 0 for joints beyond their ends.

        `position` in rad, shape (J,), is the present one; without it, joints that have been beyond
        their ends have 0.
        """
        if position is not None:
            for joint in self._bounded:
                direction, end = self._announced[joint]
                if direction * (position[joint] - end) > END_MARGIN:
                    self._over.add(joint)
        if self._over:
            directions = directions.copy()
            directions[list(self._over)] = 0.0
        return directions
