# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""One attempt to move after the other: when a sensed direction begins, and when it ends.

A direction begins only at rest, since only there is a push an attempt, and stands while the push
does, unless no motion follows. What a force sensor shows at rest depends on the pose: an attempt
ends with the motion, and the next needs a sensor that is quiet.
"""

from __future__ import annotations

import math

from friction_comp.direction.joint_motion import JointMotion, STILL

# Rest after which the next attempt may begin, and after which a movement is over, s.
REARM, OVER = 0.3, 0.15
# Share of the largest signal of the attempt below which it is over, and for how long, s. While the
# joint runs it takes little to keep it going.
_RELEASE, _RELEASED = 0.2, 0.15
# s without motion after which an announcement is taken back: an offset is no attempt.
_PATIENCE = 3.0
# Attempts in a row in which the joint moved the other way.
_CONTRADICTIONS = 3


class Attempt:
    """Follows the attempts to move one joint.

    What is announced now is `direction`, with its `reason`. The level of a sensor that is `resting`
    may follow, and it is `contradicted` when the joint has moved against it several times in a row.
    """

    def __init__(self) -> None:
        self.direction, self.reason = 0, 'at rest'
        self.resting = self.contradicted = False
        self._against = 0
        self._stopped = -math.inf

    def stop(self, time: float, reason: str) -> None:
        """Take back what is announced at a time in s; the next attempt begins from rest."""
        self.direction, self.reason, self.resting = 0, reason, False
        self._stopped = time

    def add(self, time: float, motion: JointMotion, side: int, strength: float,
            quiet: bool) -> bool:
        """Take what the sensor says; return whether its level at rest has to be found anew.

        `side` is the direction in which the person pushes at a time in s, if that is certain, else
        0, and `strength` how much, positive in the direction +1, in any unit. The sensor is `quiet`
        if it has not changed for `REARM`.
        """
        if self.direction:
            self._continue(time, motion, side, strength)
            return False
        if not self.resting:
            self.resting = min(motion.rest(time), time - self._stopped) >= REARM and quiet
            if self.resting:
                self.reason = 'at rest'
            return self.resting
        if motion.rest(time) == 0.0:
            self.stop(time, 'moves')
        elif side:
            self._start(time, side, strength)
        return False

    def _start(self, time: float, side: int, strength: float) -> None:
        self.direction, self.reason, self.resting = side, 'onset of a push', False
        self._begin = self._strong = time
        self._largest, self._moved = abs(strength), False

    def _continue(self, time: float, motion: JointMotion, side: int, strength: float) -> None:
        """End the attempt that is announced if the sensor or the motion says that it is over."""
        own = strength * self.direction
        self._largest = max(self._largest, own)
        if own > _RELEASE * self._largest:
            self._strong = time
        speed = motion.speed * self.direction
        if speed > STILL:
            self._moved, self._against = True, 0
            self._begin = time
        if side == -self.direction:
            self.stop(time, 'pushed the other way')
        elif speed < -STILL and not self._moved:
            self._against += 1
            self.contradicted = self._against >= _CONTRADICTIONS
            self.stop(time, 'moved against the push')
        elif speed < -STILL or (self._moved and motion.rest(time) > OVER):
            self.stop(time, 'the movement is over')
        elif time - self._strong > _RELEASED:
            self.stop(time, 'the push is over')
        elif time - self._begin > _PATIENCE:
            self.stop(time, 'no movement followed')
        elif not motion.known(time) or not math.isfinite(strength):
            self.stop(time, 'joint_states are missing')
