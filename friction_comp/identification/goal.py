# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a joint may be asked to do, and what carries joints meanwhile, by their models."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import check_number, check_whole_number, InputError
from friction_comp.model.effect import CARRIES, Effect, LiveTerm
from friction_comp.model.friction_model import FrictionModel

GOAL_LIMITS = {
    'speeds': (1e-3, 10.0, 'rad/s'), 'motion_range': (1e-3, 100.0, 'rad'),
    'ramp_slope': (1e-4, 100.0, 'A/s'), 'ramp_period': (1.0, 1000.0, 's'),
    'breakaway_cycles': (1, 10_000, '')}
"""Lowest and highest value of each field of a goal, and of its default, with its unit."""
SETTLING, FEWEST = 0.25, 6
"""Time in s at the beginning of a constant-velocity phase that is not used, and fewest samples of
the rest for an average."""
GRAVITY = ('feed_forward', 'left_to_robot')
"""Who carries the limb's weight: the node's currents, or the robot's own controller."""


class IdentificationError(InputError):
    """The drive did not respond as identification requires; the text says what to change."""


def check_field(name: str, value: Any) -> None:
    """Raise InputError if a goal's field is no number within `GOAL_LIMITS`."""
    low, high, _ = GOAL_LIMITS[name]
    check = check_whole_number if isinstance(low, int) else check_number
    check(value, name, least=low, most=high)


def cycle_state(time: float, speed: float, cycle_time: float) -> tuple[float, float]:
    """Return reference position (rad) and velocity (rad/s) of Eq. 3; zero outside the cycle.

    The far end, at T/2, is 0.4·ω_c·T away (Eq. 4). The fifth phase begins at 0.9 T, where the note
    prints ``0.9 < t``.
    """
    share = time / cycle_time
    if not 0.0 < share < 1.0:
        return 0.0, 0.0
    # The second half is the first one backwards in time.
    forth, share = (1.0, share) if share <= 0.5 else (-1.0, 1.0 - share)
    if share <= 0.1:
        moved, slope = 5.0 * share * share, 10.0 * share
    elif share <= 0.4:
        moved, slope = share - 0.05, 1.0
    else:
        moved, slope = 0.4 - 5.0 * (0.5 - share) ** 2, 10.0 * (0.5 - share)
    return speed * cycle_time * moved, forth * speed * slope


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
        return self.ramp_slope and 0.4 * self.ramp_slope * self.ramp_period

    def check(self, drive: Drive, torque: bool = False) -> None:
        """Raise InputError if the drive cannot meet the goal; with `torque`, texts have N·m."""
        if (peak := self.ramp_peak or 0.0) > drive.current_limit:
            raise InputError(
                'ramp_slope and ramp_period: the ramps would reach '
                f'{drive.in_words(peak, torque)}, above the current limit of '
                f'{drive.in_words(drive.current_limit, torque)}')


@dataclass(frozen=True)
class IdentificationGoal(MotionGoal):
    """Speeds, range and ramps of one identification; InputError if an entry is unusable.

    Without a slope, a current that grows towards the drive's limit breaks the joint free first, and
    ramps reach what that took within 1.2 s.
    """

    speeds: Sequence[float]     # ω_c, two magnitudes or more, each driven both ways, rad/s
    motion_range: float = 1.0   # width about the start that the joint may use, rad
    ramp_slope: float | None = None     # s of Eq. 8, A/s
    ramp_period: float = 10.0   # T of Eq. 8, s
    breakaway_cycles: int = 20  # ramps per direction
    longest_cycle: float = 20.0     # s: low speeds then use only a part of the range

    def __post_init__(self) -> None:
        try:
            speeds = sorted({round(abs(float(speed)), 9) for speed in self.speeds})
        except (TypeError, ValueError):
            raise InputError(f'speeds must be numbers, not {self.speeds!r}') from None
        for speed in speeds:
            check_field('speeds', speed)
        if not 2 <= len(speeds) <= 1000:
            raise InputError('speeds: at least two different magnitudes are needed, and at most '
                             '1000')
        for name in GOAL_LIMITS.keys() - {'speeds'}:
            if name != 'ramp_slope' or self.ramp_slope is not None:
                check_field(name, getattr(self, name))
        if self.longest_cycle != math.inf:
            check_number(self.longest_cycle, 'longest_cycle', above=0.0)
        object.__setattr__(self, 'speeds', tuple(speeds))
        if why := self.too_short(speeds[1], 1e-3):
            raise InputError(f'motion_range, longest_cycle: fewer than two speeds fit: {why}')

    def cycle(self, speed: float) -> tuple[float, float]:
        """Return duration T in s and width in rad of the cycle at a speed (Eq. 5)."""
        # The rest of the range is a margin for control errors.
        width = min(0.9 * self.motion_range, 0.4 * speed * self.longest_cycle)
        return 2.5 * width / speed, width

    def too_short(self, speed: float, step: float) -> str:
        """Return why a cycle has too few samples, one every `step`, s; '' if it has enough."""
        duration, width = self.cycle(speed)
        # A fifth more than needed, as they may come unevenly; without what settles: `phases_of`.
        needed = 1.2 * FEWEST * step
        shortest = max(0.12 / 0.3, min(needed / 0.12, (needed + SETTLING) / 0.3))
        return '' if duration >= shortest else (
            f'within {width:.2g} rad, {speed:g} rad/s is over too soon for states at '
            f'{1.0 / step:.0f} Hz: widen motion_range to '
            f'{self.motion_range * shortest / duration + 0.005:.2f} rad')


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
        points = self.times, self.positions, self.velocities
        if len({*map(len, points)}) > 1 or len(self.times) < 2:
            raise InputError('a trajectory needs at least two points, each with position and '
                             'velocity')
        for holds, text in (
                (np.isfinite(points).all(), 'contains a number that is not finite'),
                ((np.diff(self.times) > 0.0).all() and self.times[0] >= 0.0,
                 'has times that do not ascend'),
                (self.times[-1] <= 3600.0, 'takes longer than 3600 s'),
                (max(abs(self.velocities[0]), abs(self.velocities[-1])) <= 1e-6,
                 'does not begin and end at rest'),
                (np.ptp(self.positions) > 0.0, 'does not move the joint')):
            if not holds:
                raise InputError(f'the trajectory {text}')
        object.__setattr__(self, 'motion_range', float(np.ptp(self.positions)))
        top = max(float(np.abs(self.velocities).max()),
                  float(np.abs(np.diff(self.positions) / np.diff(self.times)).max()))
        object.__setattr__(self, 'speeds', (0.3 * top, top))
        for name, value in (('motion_range', self.motion_range), ('speeds', top),
                            ('ramp_slope', self.ramp_slope), ('ramp_period', self.ramp_period)):
            if value is not None:
                check_field(name, value)

    def cycle(self, speed: float) -> tuple[float, float]:
        """Return duration in s and width in rad of a cycle with the trajectory's acceleration."""
        steep = float(np.abs(np.diff(self.velocities) / np.diff(self.times)).max())
        duration = 10.0 * speed / max(steep, 1e-6)
        return duration, 0.4 * speed * duration


class Carried:
    """The currents that carry `joints` at rest by their models: weight, springs, links.

    Whoever moves a joint by its current adds them to the currents of all: what is measured is then
    friction, and a joint that is not moved stays where it is. Without `weight`, the robot's
    controller carries the limb's. `effects` are those of each joint that carry it.
    """

    def __init__(self, joints: Sequence[str], models: Sequence[FrictionModel],
                 weight: bool = True) -> None:
        self._joints = list(joints)
        self._arms = [model.arm for model in models]
        self.effects: list[list[Effect]] = [[
            effect for effect in model.effects
            if effect.role == CARRIES and set(effect.needs) <= {'rigid_body', 'coupling'}
            and not effect.not_fed_back and (weight or not effect.weight)] for model in models]
        self._terms = [[LiveTerm(effect) for effect in own] for own in self.effects]

    def at(self, position: np.ndarray) -> np.ndarray:
        """Return the currents in A, (J,), at the joints' positions in rad, (J,).

        Raises InputError if a joint's depends on a position that is not known.
        """
        known = dict(zip(self._joints, position.tolist()))
        currents = np.zeros(len(self._joints))
        for j, (joint, arm, terms) in enumerate(zip(self._joints, self._arms, self._terms)):
            signals = {'rigid_body': math.nan, 'coupling': math.nan}
            if arm is not None and any(term.needs for term in terms):
                signals |= arm.at_rest(known, joint)
            currents[j] = sum(term.update(0.0, float(position[j]), 0.0, **signals)
                              for term in terms)
            if not np.isfinite(currents[j]):
                raise InputError(
                    f'what carries {joint} depends on the position of a joint that is not known')
        return currents
