# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The direction in which a stream of desired positions moves: a leader, or a reference.

Positions are used, not speeds: those of a leader are differences of encoder counts. A reference
moves if it has covered a distance of more than an encoder count; this distance is the hysteresis at
a turn, too.
"""

from __future__ import annotations

from collections import deque
import math

from friction_comp.direction.joint_motion import Announcement, JointMotion

# Time over which the distance is covered, s; and without a reference after which nothing is known.
_WINDOW, _SILENCE = 0.2, 0.25


class DesiredMotion:
    """Announces the direction of one joint's reference, which moves from `least_speed` on, rad/s.

    Positions of the joint go to its `motion`.
    """

    def __init__(self, least_speed: float = 0.005) -> None:
        self.motion = JointMotion()
        self._least = least_speed * _WINDOW
        self._past: deque[tuple[float, float]] = deque()
        self._step = math.inf
        self._direction, self._extreme = 0, math.nan

    def take(self, time: float, desired: float) -> None:
        """Take a desired position in rad at a time in s."""
        past = self._past
        if not math.isfinite(desired) or (past and time <= past[-1][0]):
            return
        if past and time - past[-1][0] > _SILENCE:
            past.clear()
            self._direction = 0
        if past and desired != past[-1][1]:
            # Numerical noise is no step.
            self._step = min(self._step, max(1e-4, abs(desired - past[-1][1])))
        past.append((time, desired))
        while len(past) > 2 and time - past[1][0] >= _WINDOW:
            past.popleft()
        # An encoder that flickers between two counts does not move.
        least = max(self._least, 1.5 * self._step if self._step < math.inf else 0.0)
        begin, position = past[0]
        covered = desired - position
        if self._direction == 0:
            if abs(covered) >= least:
                self._direction, self._extreme = 1 if covered > 0.0 else -1, desired
            return
        self._extreme = (max if self._direction > 0 else min)(self._extreme, desired)
        if (self._extreme - desired) * self._direction >= least:
            self._direction, self._extreme = -self._direction, desired
        # Half of what begins a movement, so that a slow one does not end and begin again.
        elif abs(covered) < 0.5 * least and time - begin >= 0.9 * _WINDOW:
            self._direction = 0

    def at(self, time: float, position: float) -> Announcement:
        """Return what is announced at a time in s; `position` is the joint's, rad."""
        if not self._past or not 0.0 <= time - self._past[-1][0] <= _SILENCE:
            return Announcement(0, 'no reference', fault=True)
        if not self.motion.known(time) or not math.isfinite(position):
            return Announcement(0, 'joint_states are missing', fault=True)
        if not self._direction:
            return Announcement(0, 'the reference rests')
        # By more than 0.01 rad: help would drive it farther.
        if (position - self._past[-1][1]) * self._direction > 0.01:
            return Announcement(0, 'the joint is ahead of the reference')
        return Announcement(self._direction, 'the reference moves')
