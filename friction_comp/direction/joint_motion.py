# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a source announces for a joint, and whether the joint rests, from its position."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
import math

# Window of the speed, s, and the least time between the positions that it keeps.
_WINDOW, _STEP = 0.1, 0.008
STILL = 0.02
"""rad/s. Below, a joint rests: presliding and the flex of a gear, 2 mrad at most, stay below it."""
# s without a position after which nothing is known of the joint.
_SILENCE = 0.2


@dataclass(frozen=True)
class Announcement:
    """The direction of a joint's coming movement."""

    direction: int  # -1, 0 or +1
    reason: str  # why, in words for diagnostics
    end: float = math.nan  # position at which the announced movement ends, rad; NaN if not known
    fault: bool = False  # whether the source cannot be used; the direction is then 0
    is_pushed: bool = False  # whether a sensor feels beyond doubt that the person pushes this way


class JointMotion:
    """Rest of one joint, and its `speed`: the mean of the last 0.1 s, rad/s; NaN if not known."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, float]] = deque()
        self._still_since = math.inf
        self.speed = math.nan

    def add(self, time: float, position: float) -> None:
        """Add a position in rad at a time in s."""
        past = self._past
        if not math.isfinite(position) or (past and 0.0 <= time - past[-1][0] < _STEP):
            return
        if past and not 0.0 <= time - past[-1][0] <= _SILENCE:
            past.clear()
        past.append((time, position))
        while time - past[0][0] > _WINDOW + 0.5 * _STEP:
            past.popleft()
        begin, first = past[0]
        known = time - begin >= 0.5 * _WINDOW
        self.speed = (position - first) / (time - begin) if known else math.nan
        still = abs(self.speed) <= STILL
        self._still_since = min(self._still_since, time) if still else math.inf

    def known(self, time: float) -> bool:
        """Return whether the joint's motion is known at a time in s."""
        return bool(self._past) and math.isfinite(self.speed) and (
            time - self._past[-1][0] <= _SILENCE)

    def rest(self, time: float) -> float:
        """Return for how long the joint has rested, s; 0 if it moves or nothing is known."""
        return max(0.0, time - self._still_since) if self.known(time) else 0.0
