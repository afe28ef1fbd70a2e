# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The direction in which a stream of desired positions moves: a leader, or a reference.

Positions are used, not speeds: those of a leader are differences of encoder counts. A reference
moves if it has covered a distance of more than an encoder count; this distance is the hysteresis at
a turn, too. Where the reference rests but the joint is stuck away from it, the direction is that of
the error, once.
"""

from __future__ import annotations

from collections import deque
import math

from friction_comp.direction.joint_motion import Announcement, JointMotion

# Time over which the distance is covered, s.
_WINDOW = 0.2
# Steps of the reference, as a multiple, that are no motion: an encoder that flickers between two
# counts.
_STEPS = 1.5
# s without a reference after which nothing is known of it.
_SILENCE = 0.25
# s for which reference and joint must rest before the joint is stuck.
_STUCK_TIME = 0.2


class DesiredMotion:
    """Announces the direction of one joint's reference.

    A reference moves from `least_speed` on, rad/s; a joint at rest with a larger error than
    `stuck_error`, rad, is stuck.
    """

    def __init__(self, least_speed: float = 0.005, stuck_error: float = 0.01) -> None:
        self.motion = JointMotion()
        self._least, self._stuck = least_speed * _WINDOW, stuck_error
        self._past: deque[tuple[float, float]] = deque()
        self._step = math.inf
        self._direction, self._extreme = 0, math.nan
        self._rests_since = math.inf
        self._pushed, self._tried = 0, 0

    def take(self, time: float, desired: float) -> None:
        """Take a desired position in rad at a time in s."""
        if math.isfinite(desired) and not (self._past and time <= self._past[-1][0]):
            self._remember(time, desired)
            self._judge(time, desired)

    def _remember(self, time: float, desired: float) -> None:
        """Keep the positions over `_WINDOW`, and the smallest step between two."""
        past = self._past
        if past and time - past[-1][0] > _SILENCE:
            past.clear()
            self._direction = 0
        if past and desired != past[-1][1]:
            # Numerical noise is no step.
            self._step = min(self._step, max(1e-4, abs(desired - past[-1][1])))
        past.append((time, desired))
        while len(past) > 2 and time - past[1][0] >= _WINDOW:
            past.popleft()

    def _judge(self, time: float, desired: float) -> None:
        """Begin, turn or end the movement by the distance covered within `_WINDOW`."""
        least = max(self._least, _STEPS * self._step if self._step < math.inf else 0.0)
        begin, position = self._past[0]
        covered = desired - position
        if self._direction == 0:
            if abs(covered) >= least:
                self._move(1 if covered > 0.0 else -1, desired)
            return
        self._extreme = (max if self._direction > 0 else min)(self._extreme, desired)
        if (self._extreme - desired) * self._direction >= least:
            self._move(-self._direction, desired)
        # Half of what begins a movement, so that a slow one does not end and begin again.
        elif abs(covered) < 0.5 * least and time - begin >= 0.9 * _WINDOW:
            self._direction, self._rests_since = 0, time

    def _move(self, direction: int, desired: float) -> None:
        self._direction, self._extreme = direction, desired
        self._rests_since, self._pushed, self._tried = math.inf, 0, 0

    def at(self, time: float, position: float) -> Announcement:
        """Return what is announced at a time in s; `position` is the joint's, rad."""
        if not self._past or not 0.0 <= time - self._past[-1][0] <= _SILENCE:
            return Announcement(0, 'no reference', fault=True)
        if not self.motion.known(time) or not math.isfinite(position):
            return Announcement(0, 'joint_states are missing', fault=True)
        desired = self._past[-1][1]
        error = desired - position
        if self._direction:
            if error * self._direction < -self._stuck:
                return Announcement(0, 'the joint is ahead of the reference')
            return Announcement(self._direction, 'the reference moves')
        return self._at_rest(time, error, desired)

    def _at_rest(self, time: float, error: float, desired: float) -> Announcement:
        """Announce the direction of a lasting error, once in each rest."""
        side = 1 if error > 0.0 else -1
        if self._pushed:
            if side != self._pushed or abs(error) < 0.5 * self._stuck:
                self._pushed = 0
        elif (abs(error) > self._stuck and not self._tried
              and min(time - self._rests_since, self.motion.rest(time)) > _STUCK_TIME):
            self._pushed = self._tried = side
        if self._pushed:
            return Announcement(self._pushed, 'stuck away from the reference', desired)
        return Announcement(0, 'the reference rests')
