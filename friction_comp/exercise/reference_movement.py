# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The note's reference movement (section 2.6) with the direction announced for it."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from friction_comp.checks import check_number
from friction_comp.errors import InputError


@dataclass(frozen=True)
class ReferenceMovement:
    """Repeated movements back and forth, each with acceleration, constant velocity, deceleration.

    Standstill, the positive movement, standstill, the negative one back. The direction d is
    announced during the standstill before, and returns to 0 when the movement begins to decelerate,
    so that the compensation does not drive the joint beyond the target. Raises InputError if a
    number is out of range, or the amplitude leaves no phase of constant velocity.
    """

    amplitude: float = math.radians(40.0)  # between the ends, rad; negative: negative way first
    speed: float = math.radians(20.0)  # of the constant velocity phase, rad/s
    # s from standstill to that speed, by a raised cosine, and from it to standstill.
    acceleration_time: float = 0.5
    standstill: float = 2.0  # before each movement, s
    announcement: float = 1.0  # time by which the direction is announced before the movement, s
    repetitions: int = 10
    compensated: bool = True  # False keeps the direction at 0 throughout: the note's case 1

    def __post_init__(self) -> None:
        for name in ('speed', 'acceleration_time', 'standstill'):
            check_number(getattr(self, name), f'movement.{name}', above=0.0)
        if not math.isfinite(self.amplitude) or self.amplitude == 0.0:
            raise InputError('movement.amplitude must be finite and not 0')
        if not 0.0 <= self.announcement <= self.standstill:
            raise InputError('movement.announcement must be between 0 and the standstill')
        if self.repetitions < 1:
            raise InputError('movement.repetitions must be at least 1')
        if self.constant_time <= 0.0:
            raise InputError(
                f'movement.amplitude of {self.amplitude} rad is too short to reach the speed of '
                f'{self.speed} rad/s within {self.acceleration_time} s')

    @property
    def constant_time(self) -> float:
        """Duration of the constant velocity phase in s."""
        return abs(self.amplitude) / self.speed - self.acceleration_time

    @property
    def movement_time(self) -> float:
        """Duration of one movement in s, standstill not counted."""
        return self.constant_time + 2.0 * self.acceleration_time

    @property
    def duration(self) -> float:
        """Duration of the whole exercise in s, including a last standstill."""
        return 2.0 * self.repetitions * (self.standstill + self.movement_time) + self.standstill

    def begins(self, movement: int) -> float:
        """Return when movement 0, 1, 2 … begins, s; even ones are in the first direction."""
        return self.standstill + movement * (self.standstill + self.movement_time)

    def end(self, direction: float) -> float:
        """Return where the movement in a direction ends, rad; NaN for 0."""
        if direction == 0.0:
            return math.nan
        return self.amplitude if direction * self.amplitude > 0.0 else 0.0

    def at(self, time: ArrayLike) -> tuple[Any, Any, Any]:
        """Return position (rad), velocity (rad/s) and direction (-1, 0, +1) at times in s."""
        time = np.asarray(time, dtype=float)
        period = self.standstill + self.movement_time
        movement = np.floor(time / period)
        over = (movement >= 2 * self.repetitions) | (time < 0.0)
        forth = movement % 2 == 0
        since = time - movement * period - self.standstill
        travelled, speed = self._profile(since)
        sign = math.copysign(1.0, self.amplitude)
        announced = (since >= -self.announcement) & (
            since < self.acceleration_time + self.constant_time)
        position, velocity, direction = (np.where(over, 0.0, values) for values in (
            np.where(forth, travelled, abs(self.amplitude) - travelled) * sign,
            np.where(forth, speed, -speed) * sign,
            np.where(announced & self.compensated, np.where(forth, sign, -sign), 0.0)))
        if time.ndim == 0:
            return float(position), float(velocity), int(direction)
        return position, velocity, direction.astype(int)

    def _profile(self, since: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return angle and speed of a positive movement that began `since` seconds ago."""
        ramp, top = self.acceleration_time, self.speed
        since = np.clip(since, 0.0, self.movement_time)

        def angle(t: np.ndarray) -> np.ndarray:
            return 0.5 * top * (t - ramp / math.pi * np.sin(math.pi * t / ramp))

        left = self.movement_time - since
        speeding, slowing = since < ramp, left < ramp
        travelled = np.where(
            speeding, angle(since), np.where(
                slowing, abs(self.amplitude) - angle(left), top * (since - 0.5 * ramp)))
        share = np.where(speeding, since, np.where(slowing, left, ramp)) / ramp
        return travelled, 0.5 * top * (1.0 - np.cos(math.pi * share))
