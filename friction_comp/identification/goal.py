# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Goal and result of an identification."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from friction_comp.checks import check_number, check_whole_number
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.identification.breakaway import BreakawayRecords
from friction_comp.identification.kinetic import KineticPoint, shortest_cycle
from friction_comp.model.arm.arm import Arm
from friction_comp.model.effects.base import Effect
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import Breakaway, Presliding
from friction_comp.model.sigmoid import Sigmoid

GOAL_LIMITS = {
    'speeds': (1e-3, 10.0, 'rad/s'), 'motion_range': (1e-3, 100.0, 'rad'),
    'ramp_slope': (1e-4, 100.0, 'A/s'), 'ramp_period': (1.0, 1000.0, 's'),
    'breakaway_cycles': (1, 10_000, '')}
"""Lowest and highest value of each field of a goal, and of its default, with its unit."""
# Share of the motion range that the profiles use; the rest is a margin for control errors.
_USED_SHARE = 0.9
# Shortest phase of constant velocity, s.
_SHORTEST = 0.12
_MOST_SPEEDS = 1000


def check_field(name: str, value: Any) -> None:
    """Raise InputError if a goal's field is no number within `GOAL_LIMITS`."""
    low, high, _ = GOAL_LIMITS[name]
    if isinstance(low, int):
        check_whole_number(value, name, least=low, most=high)
    else:
        check_number(value, name, least=low, most=high)


class IdentificationError(InputError):
    """The drive did not respond as identification requires; the text says what to change."""


class MotionGoal(ABC):
    """How a joint may be moved, and the current ramps that break it free."""

    ramp_slope: float | None            # A/s; None: found by the joint's first motion
    ramp_period: float                  # s
    motion_range: float                 # width of the range that the joint may use, rad
    speeds: Sequence[float]             # rad/s, the lowest first

    @abstractmethod
    def cycle(self, speed: float) -> tuple[float, float]:
        """Return the duration in s and the distance in rad of one cycle at a speed in rad/s."""

    @property
    def ramp_peak(self) -> float | None:
        """Largest current in A that the ramps of Eq. 8 reach, 0.4·s·T; None without a slope."""
        return None if self.ramp_slope is None else 0.4 * self.ramp_slope * self.ramp_period

    def check(self, drive: Drive, torque: bool = False) -> None:
        """Raise InputError if the drive cannot meet the goal; with `torque`, texts have N·m."""
        peak = self.ramp_peak
        if peak is not None and peak > drive.current_limit:
            raise InputError(
                'ramp_slope and ramp_period: the ramps would reach '
                f'{drive.in_words(peak, torque)}, above the current limit of '
                f'{drive.in_words(drive.current_limit, torque)}')


@dataclass(frozen=True)
class IdentificationGoal(MotionGoal):
    """Speeds, range and ramps of one identification.

    Parameters
    ----------
    speeds : sequence of float
        Constant velocities ω_c in rad/s, at least two different magnitudes, each driven in both
        directions.
    motion_range : float
        Width in rad of the range, centred on the position at the start, that the joint may use.
    ramp_slope : float, optional
        Slope s of Eq. 8 in A/s. None: a current that grows towards the drive's limit breaks the
        joint free first, and ramps reach what that took within 1.2 s.
    ramp_period : float
        T of Eq. 8 in s.
    breakaway_cycles : int
        Ramps per direction.
    longest_cycle : float
        Longest duration of a cycle in s: low speeds then use only a part of the range.

    Raises
    ------
    InputError
        If an entry is unusable.
    """

    speeds: Sequence[float]
    motion_range: float = 1.0
    ramp_slope: float | None = None
    ramp_period: float = 10.0
    breakaway_cycles: int = 20
    longest_cycle: float = 20.0

    def __post_init__(self) -> None:
        try:
            speeds = sorted({round(abs(float(speed)), 9) for speed in self.speeds})
        except (TypeError, ValueError):
            raise InputError(f'speeds must be numbers, not {self.speeds!r}') from None
        for speed in speeds:
            check_field('speeds', speed)
        if not 2 <= len(speeds) <= _MOST_SPEEDS:
            raise InputError('speeds: at least two different magnitudes are needed, and at most '
                             f'{_MOST_SPEEDS}')
        for name in GOAL_LIMITS.keys() - {'speeds'}:
            if name != 'ramp_slope' or self.ramp_slope is not None:
                check_field(name, getattr(self, name))
        if self.longest_cycle != math.inf:
            check_number(self.longest_cycle, 'longest_cycle', above=0.0)
        object.__setattr__(self, 'speeds', tuple(speeds))
        duration, width = self.cycle(speeds[-1])
        if 0.3 * duration < _SHORTEST:
            cause = (f'motion_range: {self.motion_range:g} rad'
                     if width == _USED_SHARE * self.motion_range
                     else f'longest_cycle: {self.longest_cycle:g} s')
            raise InputError(f'{cause} leaves {0.3 * duration:.2g} s of constant velocity at '
                             f'{speeds[-1]:g} rad/s; {_SHORTEST:g} s are needed')

    @staticmethod
    def largest_speed(motion_range: float) -> float:
        """Return the largest speed in rad/s that is held for long enough within a range in rad."""
        return 0.3 * 2.5 * _USED_SHARE * motion_range / _SHORTEST

    def cycle(self, speed: float) -> tuple[float, float]:
        """Return duration T in s and width in rad of the cycle at a speed (Eq. 5)."""
        width = min(_USED_SHARE * self.motion_range, 0.4 * speed * self.longest_cycle)
        return 2.5 * width / speed, width

    def too_short(self, speed: float, step: float) -> str:
        """Return why a cycle has too few samples, one every `step`, s; '' if it has enough."""
        (duration, width), shortest = self.cycle(speed), shortest_cycle(step)
        if duration >= shortest:
            return ''
        wider = self.motion_range * shortest / duration
        return (f'within {width:.2g} rad it is over too soon for states at {1.0 / step:.0f} Hz: '
                f'widen motion_range to {wider + 0.005:.2f} rad')


@dataclass(frozen=True)
class IdentificationResult:
    """Result of an identification."""

    points: list[KineticPoint]      # the look-up table in ascending speed, negative speeds first
    sigmoid: Sigmoid                # fit of Eq. 6
    sigmoid_error: float            # E of Eq. 7, A
    breakaway: Breakaway
    records: BreakawayRecords       # every single breakaway
    # k_t·n/J in rad/s² per A from the cycles of Eq. 3, else, less exactly, from the short push.
    acceleration_per_current: float
    goal: IdentificationGoal
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
            effects=list(carrying), arm=arm if carrying else None,
            lookup_table={name: getattr(self, name).tolist() for name in (
                'speeds', 'currents', 'standard_deviations')},
            notes={
                'source': 'identification: constant velocities and current ramps',
                'sigmoid_error': self.sigmoid_error,
                'motion_range': self.goal.motion_range,
                'ramp_slope': self.goal.ramp_slope,
                'ramp_period': self.goal.ramp_period,
                'breakaway_cycles': self.goal.breakaway_cycles,
                'drift': [{'speed': speed, 'share': share} for speed, share in self.drift.items()],
                'warnings': list(self.warnings),
            })
