# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Moves a joint for identification: standstill, following a reference, travel to a position."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
import math
from typing import Protocol, TYPE_CHECKING

import numpy as np

from friction_comp.identification.excitation import at_travel
from friction_comp.identification.goal import IdentificationError
from friction_comp.identification.ramp import Sample
from friction_comp.identification.velocity_control import (
    BANDWIDTH,
    LIMIT,
    velocity_controller_parameters,
    velocity_controller_state,
    velocity_controller_step,
)

if TYPE_CHECKING:
    from friction_comp.drive import Drive
    from friction_comp.identification.kinetic import KineticPoint

STILL_TIME = 0.2        # s of standstill asked for before each ramp
STILL_PATIENCE = 10.0   # s to come to rest
# A joint that stays within this many counts, and this distance in rad, is at rest: current noise
# moves it within its presliding, and very fine encoders show that as many counts.
STILL_COUNTS, STILL_WAY = 2.5, 1e-5


class MotionGoal(Protocol):
    """What of a goal says how a joint may be moved; see `IdentificationGoal`."""

    @property
    def motion_range(self) -> float:
        """Width in rad of the range that the joint may use."""

    @property
    def ramp_peak(self) -> float:
        """Largest current in A with which the joint is broken free."""

    @property
    def speeds(self) -> Sequence[float]:
        """Speeds in rad/s that it is to have, the least first."""

    def cycle(self, speed: float) -> tuple[float, float]:
        """Return the time in s and the distance in rad of one cycle."""


class Motion:
    """A joint's movements as generators that yield currents and are handed samples.

    Parameters
    ----------
    goal : MotionGoal
    drive : Drive

    Attributes
    ----------
    phase : str
        What is being done.
    sample : Sample
        The latest sample handed over; NaN before the first.
    acceleration : float
        k_t·n/J in rad/s² per A; NaN before it is known.
    held : list of KineticPoint
        The currents that were commanded at the speeds held so far. What is fed forward, and how
        much may be commanded, follows from them and never from measured currents: a wrong unit
        of the measurement must not drive the joint.
    """

    def __init__(self, goal: MotionGoal, drive: Drive) -> None:
        self.goal, self.drive = goal, drive
        self.phase = 'standstill'
        self.sample = Sample(math.nan, math.nan, math.nan, math.nan)
        self.acceleration = math.nan
        self.held: list[KineticPoint] = []
        self._resolution = drive.position_resolution or 1e-6
        self._push = {1: 0.0, -1: 0.0}     # current that overcomes friction, per direction
        self._slid = 0                     # direction of the latest slide

    def _step(self, command: float) -> Generator[float, Sample, Sample]:
        """Apply a current and return the next sample."""
        sample = yield command
        self.sample = sample
        return sample

    def _standstill(self, duration: float) -> Generator[float, Sample, float]:
        """Wait at zero current until the joint has stood for `duration`; return for how long."""
        sample = self.sample
        begin, still_since, stood_at = sample.time, sample.time, sample.position
        while sample.time - still_since < duration:
            if sample.time - begin > STILL_PATIENCE + duration:
                raise IdentificationError(
                    'the joint does not come to rest at zero current: it is driven by gravity, '
                    'pushed, or rings')
            sample = yield from self._step(0.0)
            if abs(sample.position - stood_at) > max(STILL_COUNTS * self._resolution, STILL_WAY):
                still_since, stood_at = sample.time, sample.position
        return sample.time - still_since

    def _controller(self, bandwidth: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
        # Single encoder counts must not change the current by more than friction.
        push = min(self._push[1], -self._push[-1])
        quiet = math.sqrt(0.06 * push * self.acceleration / self._resolution)
        return velocity_controller_parameters(
            self.acceleration, self._plausible(speed),
            self._expected(1, speed), self._expected(-1, speed),
            bandwidth=max(min(bandwidth, quiet), 5.0)), velocity_controller_state()

    def _plausible(self, speed: float) -> float:
        """Return the largest current in A that a speed may take, by what is known so far.

        Friction grows at most in proportion to speed beyond what was measured; twice that, and
        twice what the profile's acceleration takes, is left for gravity and control. Where the
        joint is blocked or the encoder stuck, the controller asks for more.
        """
        push = max(self._push[1], -self._push[-1])
        known = max([push] + [
            abs(point.current) * max(1.0, speed / abs(point.speed))
            for point in self.held[-2:]])
        accelerating = 10.0 * speed / self.goal.cycle(max(speed, 1e-3))[0] / self.acceleration
        return min(self.drive.current_limit, max(3.0 * push, 2.0 * known) + 2.0 * accelerating)

    def _expected(self, sign: int, speed: float) -> float:
        """Return the current expected at a speed, from the speeds held so far."""
        known = [point for point in self.held if point.speed * sign > 0.0][-2:]
        if not known:
            return self._push[sign]
        current, last = known[-1].current, known[-1]
        if last.speed != known[0].speed:
            rise = (last.current - known[0].current) / (last.speed - known[0].speed)
            current += max(rise, 0.0) * (sign * speed - last.speed)
        return current if current * sign > 0.0 else self._push[sign]

    def _follow(self, reference: Callable[[float], tuple[float, float]], duration: float,
                allowance: float, speed: float,
                factor: float = 1.0
                ) -> Generator[float, Sample, tuple[float, list[Sample], list[float]]]:
        """Follow reference(t) -> (position, velocity); return its begin in s, samples, commands.

        Each command in A is the one that was applied before its sample.
        """
        parameters, state = self._controller(factor * BANDWIDTH, speed)
        begin, last = self.sample.time, self.sample.time - 1e-3
        samples, commands, sample = [], [], self.sample
        while sample.time - begin < duration:
            position, velocity = reference(sample.time - begin)
            command = velocity_controller_step(
                parameters, state, position, velocity, sample.position, sample.time - last)
            if abs(position - sample.position) > allowance:
                raise IdentificationError(
                    f'the joint lags {abs(position - sample.position):.3g} rad behind its '
                    f'reference at {abs(command):.3g} A: blocked, encoder stuck, or current limit '
                    f'({parameters[LIMIT]:.3g} A, or what was plausible so far) too low')
            last = sample.time
            sample = yield from self._step(command)
            samples.append(sample)
            commands.append(command)
        return begin, samples, commands

    def _travel(self, target: float) -> Generator[float, Sample, None]:
        """Travel to a position and stop there."""
        start = self.sample.position
        distance = target - start
        if abs(distance) > 0.01 * self.goal.motion_range:
            self.phase = 'travel'
            duration = self._travel_time(distance)

            def reference(t: float) -> tuple[float, float]:
                position, velocity = at_travel(t, distance, duration)
                return start + position, velocity

            yield from self._follow(
                reference, duration, max(0.5 * abs(distance), 0.05 * self.goal.motion_range),
                speed=0.5 * self.goal.speeds[0])
            self._slid = 1 if distance > 0.0 else -1
        yield from self._standstill(STILL_TIME)

    def _travel_time(self, distance: float) -> float:
        return max(1.875 * abs(distance) / min(0.5, self.goal.speeds[-1]), 0.5)
