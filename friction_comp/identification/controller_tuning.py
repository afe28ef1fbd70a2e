# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tunes the velocity controller of a run to its joint, from what has been measured so far."""

from __future__ import annotations

import math

from friction_comp.drive import Drive
from friction_comp.identification import velocity_control as control
from friction_comp.identification.goal import MotionGoal
from friction_comp.identification.kinetic import KineticPoint
from friction_comp.identification.supervision import Supervision


class ControllerTuning:
    """What a run knows of its joint, and the controller that follows from it."""

    goal: MotionGoal
    drive: Drive
    supervision: Supervision
    acceleration: float                     # k_t·n/J, rad/s² per A; NaN before it is known
    # Look-up table of commanded currents so far, for the controller's feedforward and limit:
    # measurements in a wrong unit must not drive the joint.
    commanded_points: list[KineticPoint]
    _push: dict[int, float]                 # current that broke the joint free, magnitude in A
    _resolution: float                      # rad per encoder count
    _calmness: float                        # factor of the bandwidth, after oscillation

    def _controller(self, factor: float, speed: float) -> control.Controller:
        return control.Controller(
            self.acceleration, float(self._plausible_current(speed)),
            self._expected_current(1, speed), self._expected_current(-1, speed),
            self._bandwidth(factor))

    def _quiet(self) -> float:
        """Return the bandwidth, rad/s, at which an encoder count hardly changes the current."""
        return math.sqrt(
            0.06 * min(self._push.values()) * self.acceleration / self._resolution)

    def _bandwidth(self, factor: float = 1.0) -> float:
        """Return the controller's bandwidth in rad/s that delay, encoder and joint allow."""
        # Holding a current and computing the velocity from two positions delay by half a sample
        # each.
        late = max(self.supervision.step + self.supervision.delay, 1e-6)
        stable = min(control.BANDWIDTH, control.DELAY_SHARE * control.PHASE / late)
        return max(min(factor * self._calmness * stable, self._quiet()),
                   0.5 * control.LEAST_BANDWIDTH)

    def _why_slow(self) -> str:
        """Return what keeps the controller slow; '' if it is not slow, or not known yet."""
        if not math.isfinite(self.acceleration) or self._bandwidth() > 0.4 * control.BANDWIDTH:
            return ''
        delay = self.supervision.delay
        cause = ('encoder counts are coarse' if self._bandwidth() >= self._quiet() else
                 'the joint oscillated at higher gains' if self._calmness < 1.0 else
                 f'the measured current is {delay:.2g} s late' if delay > 0.0 else
                 'joint states come seldom')
        return f': the velocity controller is slow ({self._bandwidth():.0f} rad/s), since {cause}'

    def _plausible_current(self, speed: float) -> float:
        """Return the largest plausible current in A at a speed.

        Beyond measured speeds, friction grows at most in proportion to speed. Twice that, plus
        twice the profile's acceleration, leaves room for gravity and control; a blocked joint or a
        stuck encoder exceeds it.
        """
        push = max(self._push.values())
        known = max([push] + [
            abs(point.current) * max(1.0, speed / abs(point.speed))
            for point in self.commanded_points[-2:]])
        return min(self.drive.current_limit,
                   max(3.0 * push, 2.0 * known) + 2.0 * self._accelerating_current(speed))

    def _accelerating_current(self, speed: float) -> float:
        return 10.0 * speed / self.goal.cycle(speed)[0] / self.acceleration

    def _expected_current(self, sign: int, speed: float) -> float:
        """Return the current expected at a speed, from the look-up table so far."""
        known = [point for point in self.commanded_points if point.speed * sign > 0.0][-2:]
        if not known:
            return sign * self._push[sign]
        current, last = known[-1].current, known[-1]
        if last.speed != known[0].speed:
            rise = (last.current - known[0].current) / (last.speed - known[0].speed)
            current += max(rise, 0.0) * (sign * speed - last.speed)
        return current if current * sign > 0.0 else sign * self._push[sign]
