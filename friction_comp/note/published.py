# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The note's experiments and results, by configuration."""

from __future__ import annotations

from dataclasses import dataclass
import math

from friction_comp.exercise.exercise_script import ReferenceMovement
from friction_comp.model.friction_model import FrictionModel
from friction_comp.package_files import package_file

RAMP_PERIOD = 10.0
"""T of Eq. 8 in s, all configurations."""

FALSE_START = math.radians(1.0)
"""rad by which a joint has started by itself; sticking joints deflect by 0.01 to 0.02 degrees."""


@dataclass(frozen=True)
class Experiment:
    """One of the note's three configurations."""

    number: int
    # Mean and standard deviation of section 3, A.
    breakaway: float
    breakaway_std: float
    # Slope s of Eq. 8, A/s.
    ramp_slope: float
    # Section 3: peak torque with d = 0 and with d = ±1, N·m, and the reduction stated.
    peak_kinetic: float
    peak_compensated: float
    reduction: float
    # Slowest speeds of the table, deg/s, not in the note: they determine the transition's
    # steepness.
    slow: tuple[float, ...]

    @property
    def speeds(self) -> tuple[float, ...]:
        """Speeds of the look-up table in rad/s, each measured in both directions."""
        return tuple(math.radians(speed) for speed in (*self.slow, 5.0, *range(10, 101, 10)))

    def model(self) -> FrictionModel:
        """Return the model of the simulated joint: the drive as the note describes it."""
        return FrictionModel.load(package_file('config', f'armin_configuration_{self.number}.yaml'))

    def movement(self, compensated: bool = True) -> ReferenceMovement:
        """Return one repetition of the reference movement, forth and back."""
        entry = self.model().simulation['movement']
        return ReferenceMovement(
            amplitude=math.radians(entry['amplitude']), speed=math.radians(entry['speed']),
            acceleration_time=float(entry['acceleration_time']), standstill=3.0,
            announcement=1.0, repetitions=1, compensated=compensated)


EXPERIMENTS = (
    Experiment(1, 0.0995, 0.0034, 0.05, 0.98, 0.39, 0.60, (3.0,)),
    Experiment(2, 0.1377, 0.0043, 0.06, 1.28, 0.44, 0.65, (2.25,)),
    Experiment(3, 0.3357, 0.0172, 0.12, 6.02, 1.21, 0.80, (0.35, 1.0, 2.0)),
)
