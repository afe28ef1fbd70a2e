# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a joint rests or moves, from its position."""

from __future__ import annotations

from collections import deque
import math

# Window of the speed, s, and the least time between the positions that it keeps.
_WINDOW, _STEP = 0.1, 0.008
# rad/s. Below, a joint rests: presliding and the flex of a gear, 2 mrad at most, stay below it.
STILL = 0.02
# s without a position after which nothing is known of the joint.
_SILENCE = 0.2


class JointMotion:
    """Rest of one joint, and its `speed`: the mean of the last 0.1 s, rad/s; NaN if not known."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, float]] = deque()
        self._still_since = math.inf
        self.speed = math.nan

    def add(self, time: float, position: float) -> None:
        """Add a position in rad at a time in s."""
        past = self._past
        if not math.isfinite(position) or (past and time - past[-1][0] < _STEP and (
                time >= past[-1][0])):
            return
        if past and not 0.0 <= time - past[-1][0] <= _SILENCE:
            past.clear()
        past.append((time, position))
        while time - past[0][0] > _WINDOW + 0.5 * _STEP:
            past.popleft()
        begin, first = past[0]
        if time - begin < 0.5 * _WINDOW:
            self.speed, self._still_since = math.nan, math.inf
            return
        self.speed = (position - first) / (time - begin)
        if abs(self.speed) > STILL:
            self._still_since = math.inf
        else:
            self._still_since = min(self._still_since, time)

    def known(self, time: float) -> bool:
        """Return whether the joint's motion is known at a time in s."""
        return bool(self._past) and math.isfinite(self.speed) and (
            time - self._past[-1][0] <= _SILENCE)

    def rest(self, time: float) -> float:
        """Return for how long the joint has rested, s; 0 if it moves or nothing is known."""
        return max(0.0, time - self._still_since) if self.known(time) else 0.0
