# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Validates slow inputs of the compensator (direction, temperature) and checks their age."""

from __future__ import annotations

from collections.abc import Sequence
import math

import numpy as np

# Friction follows the motor's temperature over minutes: an older reading says nothing.
_TEMPERATURE_TIMEOUT = 60_000_000_000


class Direction:
    """Holds the last direction d per joint; 0 where it is malformed or old.

    It may come by either of two ways, plain or with the planner's stamp; for each joint the later
    word wins. Where several announce, and a joint's direction changes and changes back within the
    timeout, they contradict each other: it counts as 0 for twice as long.

    Parameters
    ----------
    joints : list of str
    timeout : float
        s of silence after which d is 0.

    Attributes
    ----------
    planners : list of str
        Who announces directions, as far as it is known: to be set by the node now and then.
    refused : int
        Number of messages so far that were not as they should be.
    why : str
        What was wrong with the last of them.
    """

    def __init__(self, joints: Sequence[str], timeout: float) -> None:
        self.timeout = timeout
        self.refused = 0
        self.why = ''
        self.planners: list[str] = []
        self._indices = {joint: index for index, joint in enumerate(joints)}
        self._zeros = np.zeros(len(joints))
        self.forget()

    def forget(self) -> None:
        """Fall back to 0 until the next message."""
        self._values = self._zeros
        self._times: list[int | None] = [None] * len(self._zeros)
        # What each joint's direction was before, when it changed, and when it changed back.
        self._before = self._zeros
        self._changed: list[int | None] = [None] * len(self._zeros)
        self._disputed: list[int | None] = [None] * len(self._zeros)

    def begin(self, time: int) -> None:
        """Joint states begin at a time in ns; earlier announcements count from then.

        Until then only the node's own clock could tell when it came, and a driver's clock that is
        behind would let it outlast the announcements that follow.
        """
        self._times = [taken if taken is None else min(taken, time) for taken in self._times]

    def take(self, values: Sequence[int], time: int) -> bool:
        """Take a message that came at a time in ns; return whether it was as it should be.

        A message of the wrong length counts as 0 for all joints, a value other than -1, 0 or +1
        as 0 for its joint.
        """
        count = len(self._zeros)
        if len(values) != count:
            return self._refuse(f'{len(values)} values for {count} joints', range(count), time)
        known = [value in (-1, 0, 1) for value in values]
        self._set(range(count), [float(v) if ok else 0.0 for v, ok in zip(values, known)], time)
        if not all(known):
            return self._refuse('a value other than -1, 0 and +1', (), time)
        return True

    def take_stamped(self, names: Sequence[str], velocities: Sequence[float], stamp: int,
                     now: int) -> bool:
        """Take a message that bears the planner's stamp; return whether it was as it should be.

        Parameters
        ----------
        names : sequence of str
            Joints; those of others are passed over, those not named keep their direction. One
            that is named twice has none: 0.
        velocities : sequence of float
            Of which the signs are the directions. One that is not finite counts as 0.
        stamp, now : int
            When the planner said so, and the time of the joint states, ns. A stamp ahead of time
            by more than the timeout is refused, and counts as 0: nobody knows its age.
        """
        if len(names) != len(velocities):
            return self._refuse(f'{len(velocities)} velocities for {len(names)} names',
                                range(len(self._zeros)), max(stamp, now))
        mine = [(self._indices[name], value) for name, value in zip(names, velocities)
                if name in self._indices]
        indices = [index for index, _ in mine]
        if stamp - now > self.timeout * 1e9:
            return self._refuse('a stamp ahead of time', indices, min(stamp, now))
        if len(set(indices)) < len(indices):
            return self._refuse('a joint named twice', indices, stamp)
        finite = [math.isfinite(value) for _, value in mine]
        self._set(indices, [float(np.sign(value)) if good else 0.0
                            for (_, value), good in zip(mine, finite)], stamp)
        if not all(finite):
            return self._refuse('a velocity that is not finite', (), stamp)
        return True

    def _refuse(self, why: str, indices: Sequence[int], time: int) -> bool:
        """Count the joints' direction as 0 from a time in ns on, and return False."""
        self.refused += 1
        self.why = why
        self._set(indices, [0.0] * len(indices), time)
        return False

    def _set(self, indices: Sequence[int], values: Sequence[float], time: int) -> None:
        mixed, times = self._values.copy(), list(self._times)
        for index, value in zip(indices, values):
            if times[index] is None or time >= times[index]:
                if value != mixed[index]:
                    self._note_change(index, value, time)
                mixed[index], times[index] = value, time
        self._values, self._times = mixed, times

    def _note_change(self, index: int, value: float, time: int) -> None:
        before, changed = self._before[index], self._changed[index]
        if (len(self.planners) > 1 and changed is not None and value == before
                and time - changed <= self.timeout * 1e9):
            self._disputed[index] = time
        self._before = self._before.copy()
        self._before[index], self._changed[index] = self._values[index], time

    def disputed(self, time: int) -> list[str]:
        """Return the joints whose planners contradict each other at a time in ns."""
        return [joint for joint, index in self._indices.items()
                if self._is_disputed(index, time)]

    def _is_disputed(self, index: int, time: int) -> bool:
        since = self._disputed[index]
        return since is not None and time - since <= 2.0 * self.timeout * 1e9

    def at(self, time: int) -> np.ndarray:
        """Return d at a time in ns, shape (J,)."""
        limit = time - self.timeout * 1e9
        for index, taken in enumerate(self._times):
            if taken is None or taken < limit or self._disputed[index] is not None:
                return np.array([
                    0.0 if taken is None or taken < limit or self._is_disputed(index, time)
                    else value
                    for index, (value, taken) in enumerate(zip(self._values, self._times))])
        return self._values

    def age(self, index: int, time: int) -> float:
        """Return how old a joint's direction is at a time in ns, s; NaN where there is none."""
        taken = self._times[index]
        return math.nan if taken is None else (time - taken) * 1e-9

    def silent(self, time: int) -> list[str]:
        """Return the joints whose last direction, +1 or -1, was not taken back but fell silent."""
        return [joint for joint, index in self._indices.items()
                if self._values[index] != 0.0
                and self.age(index, time) > self.timeout]


class MotorTemperature:
    """Holds the last motor temperature per joint.

    A reading counts for joint states later than itself. Topics may overtake each other; this way
    the same reading meets the same state in every run of a simulation.

    Parameters
    ----------
    joints : list of str
    """

    def __init__(self, joints: Sequence[str]) -> None:
        self._indices = {joint: index for index, joint in enumerate(joints)}
        self.forget()

    def forget(self) -> None:
        """Know nothing until the next reading."""
        self._values = np.full(len(self._indices), np.nan)
        self._times = [0] * len(self._indices)
        self._coming: list[tuple[int, int, float]] = []
        self._shown: np.ndarray | None = None
        self._fresh_until = math.inf

    def take(self, joint: str, value: float, time: int) -> None:
        """Take a reading in degrees Celsius with its stamp in ns."""
        if joint in self._indices and np.isfinite(value):
            self._coming.append((time, self._indices[joint], value))

    def why_unknown(self, index: int, time: int) -> str:
        """Return in words why there is no reading of a joint for a state stamped `time` ns."""
        if self._times[index] == 0:
            return 'no motor_temperature received'
        return f'last motor_temperature is {(time - self._times[index]) * 1e-9:.0f} s old'

    def before(self, time: int) -> np.ndarray | None:
        """Return the temperatures for a state stamped `time` ns, shape (J,), or None.

        NaN where a joint has no fresh reading; None where no joint has one.
        """
        if not self._coming and time <= self._fresh_until:
            return self._shown
        later = []
        for reading in self._coming:
            if reading[0] < time:
                self._times[reading[1]], self._values[reading[1]] = reading[0], reading[2]
            else:
                later.append(reading)
        # Without an end, readings of another clock would pile up.
        self._coming = later[-100:]
        for index, taken in enumerate(self._times):
            if time - taken > _TEMPERATURE_TIMEOUT:
                self._values[index] = np.nan
        known = ~np.isnan(self._values)
        self._shown = self._values if known.any() else None
        self._fresh_until = min(
            (taken for taken, fresh in zip(self._times, known) if fresh),
            default=math.inf) + _TEMPERATURE_TIMEOUT
        return self._shown
