# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The first motion of an unknown joint: breakaway, then a short push.

It measures the current that overcomes friction and the acceleration per current, which the motion
controller needs, and shows whether the measured current is the commanded one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator
import math
from typing import NoReturn, TYPE_CHECKING

from friction_comp.identification.goal import IdentificationError
from friction_comp.identification.motion import Motion, MotionGoal, STILL_TIME
from friction_comp.identification.push import acceleration_of_push
from friction_comp.identification.ramp import Sample, speed_over
from friction_comp.signal_checks import LATEST

if TYPE_CHECKING:
    from friction_comp.drive import Drive
    from friction_comp.identification.supervision import Supervision

PUSH_SPEED = 0.3        # rad/s that the short push aims at


class FirstMotion(Motion):
    """A joint that is broken free before it is moved.

    Parameters
    ----------
    goal : MotionGoal
    drive : Drive
    supervision : Supervision
        Which must know the measured current to be the commanded one before the first push.

    Attributes
    ----------
    friction : pair of float, or None
        Largest current in A known to be taken by friction, a direction each; None before.
    warnings : list of str
    ...
        And those of `Motion`.
    """

    def __init__(self, goal: MotionGoal, drive: Drive, supervision: Supervision) -> None:
        super().__init__(goal, drive)
        self._supervision = supervision
        self.friction: tuple[float, float] | None = None
        self.warnings: list[str] = []

    def _first_motion(self) -> Generator[float, Sample, None]:
        """Push in either direction; `friction` and `acceleration` are known then."""
        self.phase = 'push'
        rates = []
        for sign in (1, -1):
            rates.append((yield from self._short_push(sign)))
        self.acceleration = self._combine(rates)

    def _short_push(self, sign: int) -> Generator[float, Sample, float]:
        """Break the joint free, push it a little, let it coast; return k_t·n/J or NaN."""
        peak = self.goal.ramp_peak
        slope = peak / 3.0
        yield from self._standstill(STILL_TIME)
        sample = self.sample
        begin, home = sample.time, sample.position
        window = deque([sample], maxlen=200)
        while True:
            current = slope * (sample.time - begin)
            if current > peak:
                self._never_free(sign, peak)
            sample = yield from self._step(sign * current)
            window.append(sample)
            if speed_over(window, sign, 0.01) > PUSH_SPEED / 10.0 and (
                    sign * (sample.position - home) > 8.0 * self._resolution):
                break
        if not self._supervision.known():
            # The response may still be on its way.
            yield from self._standstill(STILL_TIME + LATEST)
            self._supervision.require_known()
            sample = self.sample
        self._push[sign] = sign * current
        self._note_friction()
        strong = min(1.3 * current, self.drive.current_limit)
        room = sample.position + sign * 0.04 * self.goal.motion_range
        pushed, begin = [sample], sample.time
        while (sign * (sample.position - room) < 0.0 and sample.time - begin < 1.0
               and speed_over(pushed, sign, 0.004) < PUSH_SPEED):
            sample = yield from self._step(sign * strong)
            pushed.append(sample)
        coasted = [sample]
        while speed_over(coasted, sign, 0.02) > 0.0 or len(coasted) < 25:
            sample = yield from self._step(0.0)
            coasted.append(sample)
            if sample.time - coasted[0].time > 2.0:
                break
        yield from self._standstill(STILL_TIME)
        return acceleration_of_push(pushed, coasted, strong, sign)

    def _combine(self, rates: list[float]) -> float:
        """The larger of the two estimates; from the breakaway current alone where both failed."""
        # Typically, a joint's own breakaway torque accelerates it at 10 rad/s².
        typical = 10.0 / max(self._push[1], -self._push[-1])
        rates = [rate for rate in rates if math.isfinite(rate) and rate > typical / 100.0]
        if not rates:
            self.warnings.append('the inertia could not be estimated; a typical one was assumed')
            return typical
        return max(rates)

    def _note_friction(self) -> None:
        """Renew `friction`, after a push or a cycle: it is looked at with every sample."""
        if 0.0 in self._push.values():
            return
        positive, negative = (
            sign * max([abs(self._push[sign])] + [
                abs(point.current) for point in self.held if point.speed * sign > 0.0])
            for sign in (1, -1))
        self.friction = positive, negative

    def _never_free(self, sign: int, reached: float) -> NoReturn:
        side = 'positive' if sign > 0 else 'negative'
        raise IdentificationError(
            f'the joint did not break free in the {side} direction up to {reached:.3g} A. '
            'Did it move all the same? Then its encoder is stuck. Is it blocked? If neither, ask '
            'for a steeper ramp_slope or a longer ramp_period')
