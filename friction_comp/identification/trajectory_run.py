# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Moves a joint along a trajectory of positions under identification's supervision.

First the joint is broken free and pushed briefly at its present position, to measure friction and
acceleration per current, which the controller needs. Then it travels to the first point, follows
the trajectory, and stops.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.identification.goal import check_field, MotionGoal
from friction_comp.identification.kinetic import Sample
from friction_comp.identification.supervised_run import STILL_TIME, SupervisedRun

# Shares of the trajectory's range by which the joint may leave it, be pushed first, and lag behind.
_BEYOND, _PUSHED, _BEHIND = 0.025, 0.1, 0.1
_LONGEST = 3600.0


@dataclass(frozen=True)
class TrajectoryGoal(MotionGoal):
    """A trajectory of one joint, from rest to rest, cubic between its points.

    Raises InputError if it cannot be followed.
    """

    times: Sequence[float]          # s, ascending from zero or later
    positions: Sequence[float]      # rad
    velocities: Sequence[float]     # rad/s
    ramp_slope: float | None = None     # A/s; None: the current grows towards the drive's limit
    ramp_period: float = 10.0
    motion_range: float = field(init=False)         # of the positions
    speeds: Sequence[float] = field(init=False)     # a low one for travel, and the highest

    def __post_init__(self) -> None:
        sizes = {len(self.times), len(self.positions), len(self.velocities)}
        if len(sizes) > 1 or len(self.times) < 2:
            raise InputError('a trajectory needs at least two points, each with position and '
                             'velocity')
        if not np.isfinite([*self.times, *self.positions, *self.velocities]).all():
            raise InputError('the trajectory contains a number that is not finite')
        if not (np.diff(self.times) > 0.0).all() or self.times[0] < 0.0:
            raise InputError('the times of the trajectory do not ascend')
        if self.times[-1] > _LONGEST:
            raise InputError(f'the trajectory takes {self.times[-1]:.4g} s; the limit is '
                             f'{_LONGEST:g} s')
        if any(abs(end) > 1e-6 for end in (self.velocities[0], self.velocities[-1])):
            raise InputError('the trajectory does not begin and end at rest')
        object.__setattr__(self, 'motion_range', float(np.ptp(self.positions)))
        top = max(float(np.abs(self.velocities).max()),
                  float(np.abs(np.diff(self.positions) / np.diff(self.times)).max()))
        object.__setattr__(self, 'speeds', (0.3 * top, top))
        if not self.motion_range > 0.0:
            raise InputError('the trajectory does not move the joint')
        check_field('motion_range', self.motion_range)
        check_field('speeds', top)
        if self.ramp_slope is not None:
            check_field('ramp_slope', self.ramp_slope)
        check_field('ramp_period', self.ramp_period)

    def cycle(self, speed: float) -> tuple[float, float]:
        """Return duration in s and width in rad of a cycle with the trajectory's acceleration."""
        steep = float(np.abs(np.diff(self.velocities) / np.diff(self.times)).max())
        duration = 10.0 * speed / max(steep, 1e-6)
        return duration, 0.4 * speed * duration


class TrajectoryRun(SupervisedRun):
    """One trajectory, from standstill to zero current; see `SupervisedRun`."""

    goal: TrajectoryGoal

    def __init__(self, goal: TrajectoryGoal, drive: Drive, torque: bool = False) -> None:
        super().__init__(goal, drive, torque)
        self._began: float | None = None
        self._path = CubicHermiteSpline(goal.times, goal.positions, goal.velocities)
        self._speed = self._path.derivative()

    def _bounds(self) -> tuple[float, float]:
        width, places = self.goal.motion_range, self.goal.positions
        return (min(min(places) - _BEYOND * width, self.start - _PUSHED * width),
                max(max(places) + _BEYOND * width, self.start + _PUSHED * width))

    def _time_left(self) -> float:
        if self._began is None:
            return self.goal.times[-1] + 5.0 * STILL_TIME
        return max(0.0, self._began + self.goal.times[-1] - self.sample.time)

    def _movements(self) -> Generator[float, Sample, None]:
        goal = self.goal
        yield from self._travel(goal.positions[0])
        self.phase, self._began = 'trajectory', self.sample.time
        yield from self._follow(self._reference, goal.times[-1], _BEHIND * goal.motion_range,
                                goal.speeds[-1])

    def _reference(self, time: float) -> tuple[float, float]:
        time = max(time, self.goal.times[0])
        return float(self._path(time)), float(self._speed(time))
