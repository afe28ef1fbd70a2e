# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What an identification measured, how certain that is, and what is doubtful, in words.

What is measured twice must agree; else the result says by how much it does not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
import math

import numpy as np

from friction_comp.drive import Drive
from friction_comp.identification.cycles import (
    changes,
    Cycle,
    Inertia,
    KineticPoint,
    MAX_SCATTER,
    pairs,
)
from friction_comp.identification.goal import IdentificationError, IdentificationGoal
from friction_comp.model.arm import Arm
from friction_comp.model.effects.base import Effect
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import Breakaway, Presliding
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.statistics import rms

# Shares of friction above which a result is doubtful: by which the curve of Eq. 6 is off the table
# (RMS), measured and commanded currents differ, friction or load vary over position, and one
# direction needs more; and by which breakaway scatters, or the load changes, under a person's hand.
_CURVE, _CURRENTS, _POSITION, _ONE_SIDED, _TOUCHED = 0.03, 0.04, 0.05, 0.12, 0.6
# Share by which inertias at different speeds may differ, and that inertia may leave unexplained:
# rigid joints with fine encoders stay below 0.01.
_SWINGS = 0.05
PRESLIDING_RATE = 500.0
"""Rate of joint states in Hz from which on presliding is within its stated deviation."""


@dataclass(frozen=True)
class IdentificationResult:
    """Result of an identification."""

    points: list[KineticPoint]      # the look-up table in ascending speed, negative speeds first
    sigmoid: Sigmoid                # fit of Eq. 6
    sigmoid_error: float            # E of Eq. 7, A
    breakaway: Breakaway
    breakaways: np.ndarray          # every single one, A, signed, in order of time
    # k_t·n/J in rad/s² per A from the cycles of Eq. 3, else, less exactly, from the short push.
    acceleration_per_current: float
    goal: IdentificationGoal
    uncertainty: float              # share by which friction may differ, half of a 95 % interval
    warnings: list[str] = field(default_factory=list)
    presliding: Presliding | None = None        # None if the encoder is too coarse
    backlash: float | None = None               # rad; None if the ramps show none
    # How much friction at a speed in rad/s drifted, a share of it; empty if it hardly did.
    drift: dict[float, float] = field(default_factory=dict)

    @property
    def speeds(self) -> np.ndarray:
        """Speeds of the look-up table, rad/s, shape (N,)."""
        return np.array([point.speed for point in self.points])

    @property
    def currents(self) -> np.ndarray:
        """Mean currents of the look-up table, A, shape (N,)."""
        return np.array([point.current for point in self.points])

    @property
    def standard_deviations(self) -> np.ndarray:
        """Standard deviations of the current, A, shape (N,)."""
        return np.array([point.standard_deviation for point in self.points])

    @property
    def coefficients(self) -> tuple[float, ...]:
        """c1..c6 of Eq. 6 with velocity in rad/s."""
        return self.sigmoid.coefficients()

    def model(self, drive: Drive, joint: str = '',
              position_limits: tuple[float, float] | None = None,
              carrying: Sequence[Effect] = (), arm: Arm | None = None) -> FrictionModel:
        """Return the `FrictionModel` of the drive; it is not saved.

        `carrying` are the effects whose current was `carried`, and `arm` what they need: they
        remain part of the model, and breakaway is what it takes beside them, at any position.
        """
        breakaway = self.breakaway if not carrying else replace(
            self.breakaway, positive_position=None, negative_position=None)
        return FrictionModel(
            drive=drive, position_limits=position_limits, joint=joint,
            sigmoid=self.sigmoid, breakaway=breakaway, presliding=self.presliding,
            uncertainty=self.uncertainty, effects=list(carrying), arm=arm if carrying else None,
            lookup_table={name: getattr(self, name).tolist() for name in (
                'speeds', 'currents', 'standard_deviations')},
            notes={
                'source': 'identification: constant velocities and current ramps',
                'sigmoid_error': self.sigmoid_error,
                **{name: getattr(self.goal, name) for name in (
                    'motion_range', 'ramp_slope', 'ramp_period', 'breakaway_cycles')},
                'drift': [{'speed': speed, 'share': share} for speed, share in self.drift.items()],
                'warnings': list(self.warnings),
            })


def uncertainty_of(cycles: Sequence[Cycle], repeated: Sequence[Cycle], misfit: float) -> float:
    """Return the share by which sliding friction may differ, half of a 95 % interval.

    From the standard errors of the means, from how far friction moved between repetitions, and from
    `misfit`, the share of friction by which the curve of Eq. 6 is off the table (RMS).
    """
    both = pairs(cycles, repeated)
    moved = [change / a.friction for (a, _), sides in zip(both, changes(both)) for change in sides]
    # The difference of two measurements scatters by the root of two more than one.
    again = rms(np.array(moved)) / math.sqrt(2.0) if moved else 0.0
    return 2.0 * math.hypot(rms(np.array([cycle.error for cycle in cycles])), again, misfit)


def curve_misfit(points: Sequence[KineticPoint], sigmoid: Sigmoid) -> float:
    """Return by how much the curve of Eq. 6 is off the look-up table, RMS, a share of friction."""
    errors = np.array([float(sigmoid(point.speed)) - point.current for point in points])
    return rms(errors) / max(float(np.mean([abs(point.current) for point in points])), 1e-9)


# What is doubtful, as texts.

def doubts_of_cycles(cycles: Sequence[Cycle], repeated: Sequence[Cycle], inertia: Inertia | None,
                     drift: dict[float, float]) -> list[str]:
    """Return what is doubtful about cycles: currents, scatter, inertia, and drift."""
    measured = sum(cycle.friction for cycle in cycles)
    gain = measured / sum(replace(cycle, points=cycle.commanded).friction for cycle in cycles)
    offset = sum(one.current - other.current for cycle in cycles
                 for one, other in zip(cycle.points, cycle.commanded)) / (2.0 * measured)
    said = []
    if abs(gain - 1.0) > _CURRENTS:
        said.append(f'the measured current is {gain:.2f} times the commanded one: torque constant, '
                    'gear ratio or current controller deviate from the model file, and friction is '
                    'the measured one')
    if abs(offset) > _CURRENTS:
        said.append(f'the measured current is off the commanded one by {offset:+.0%} of friction '
                    'in both directions: the current sensor has an offset, now part of the model')
    worst = max(cycles, key=lambda cycle: cycle.scatter)
    if worst.scatter > MAX_SCATTER:
        said.append(f'at {worst.speed:.3g} rad/s, the current varies by ±{worst.scatter:.0%} of '
                    'friction, with lower gains as well: friction varies there, or the joint '
                    'oscillates under its velocity controller')
    doubt = max(inertia.differs, inertia.unexplained) if inertia else 0.0
    if doubt > _SWINGS:
        said.append(f'the acceleration per current may be off by {doubt:.0%}: the joint swings, as '
                    'one with an elastic or heavy link, or its encoder is coarse. Presliding of a '
                    'joint that swings may be up to 30 % short')
    if drift:
        sizes = ', '.join(f'by {share:+.1%} at {speed:.3g} rad/s' for speed, share in drift.items())
        said.append(f'friction drifted during the measurement: {sizes}. The look-up table and its '
                    'curve are those of the end, breakaway is the mean of the time before. Let the '
                    'drive warm up, then identify it again')
    return said


def doubts_of_positions(cycles: Sequence[Cycle], slopes: Sequence[float]) -> list[str]:
    """Return whether friction, or the load, rises over the positions of cycles.

    `slopes` are those of `position_slopes`, A/rad.
    """
    forward, backward = slopes
    half = 0.5 * max(float(np.ptp(cycle.samples[:, 1])) for cycle in cycles)
    friction = float(np.mean([cycle.friction for cycle in cycles]))
    return [what.format(share) for what, slope in (
        ('friction rises over position, by about ±{:.0%} of friction: the table has means over the '
         'range, breakaway is that of its middle', 0.5 * (forward - backward)),
        ('the load rises over position, by about ±{:.0%} of friction: gravity, or a spring. Add it '
         'with refine, since compensated friction no longer holds a weight',
         0.5 * (forward + backward))) if (share := half * abs(slope) / friction) > _POSITION]


def doubts_of_ramps(breakaway: Breakaway, points: Sequence[KineticPoint], cycles: int, step: float,
                    presliding: Presliding | None, say: Callable[[float], str]) -> list[str]:
    """Return what is doubtful about `cycles` ramps a direction, with samples every `step`, s.

    Friction is about equal in both directions; gravity, a spring, or a person adds to one and
    reduces the other, and gravity affects look-up table and breakaway alike. Raises
    IdentificationError if a person leant on the joint; `say` returns a current as text.
    """
    friction = 0.5 * (breakaway.positive_mean - breakaway.negative_mean)
    shift = 0.5 * (breakaway.positive_mean + breakaway.negative_mean)
    spread = max(breakaway.positive_std, breakaway.negative_std)
    sliding = 0.5 * sum(float(np.mean([
        point.current for point in points if point.speed * sign > 0.0])) for sign in (1, -1))
    if spread > _TOUCHED * friction:
        raise IdentificationError(f'breakaway scatters by {say(spread)} around {say(friction)}: '
                                  'the joint was touched during the measurement')
    if abs(shift - sliding) > _TOUCHED * friction:
        raise IdentificationError(
            f'the load was {say(sliding)} while the joint moved, but {say(shift)} when it broke '
            'free: somebody leant on it during part of the run')
    said, more = [], 2.0 * max(shift, sliding, key=abs)
    if abs(more) > 2.0 * _ONE_SIDED * friction:
        said.append(f'the {"positive" if more > 0.0 else "negative"} direction needs '
                    f'{say(abs(more))} more than the other: gravity or a spring, friction that '
                    'differs, or somebody leant on the joint. If it is a weight, add it to the '
                    'model with refine before people let go: compensated friction holds it no '
                    'longer')
    if cycles == 1:
        said.append('breakaway was measured once in each direction: how much it scatters is not '
                    'known. Request four breakaway_cycles or more')
    if presliding is not None and step * PRESLIDING_RATE > 1.05:
        said.append(f'presliding was measured at {1.0 / step:.0f} Hz: below {PRESLIDING_RATE:.0f} '
                    'Hz it may be 35 % too long, which costs help where no direction is announced')
    return said


def doubts_of_curve(points: Sequence[KineticPoint], sigmoid: Sigmoid, misfit: float,
                    say: Callable[[float], str]) -> list[str]:
    """Return where the curve of Eq. 6 is off the look-up table; `say` returns a current as text."""
    if misfit <= _CURVE:
        return []
    off, point = max(((abs(float(sigmoid(one.speed)) - one.current), one) for one in points),
                     key=lambda entry: entry[0])
    return [f'the curve of Eq. 6 is off the look-up table by {misfit:.0%} of friction (RMS), most '
            f'at {point.speed:g} rad/s, where {say(abs(point.current))} were measured, by '
            f'{say(off)}: compensation follows the curve. Refine a recording with this model, or '
            'request other speeds']
