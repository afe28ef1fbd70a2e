# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Validates slow inputs of the compensator (direction, temperature) and checks their age."""

from __future__ import annotations

from collections.abc import Sequence
import math

import numpy as np

from friction_comp.samples import beyond

# Largest age of a temperature, ns; friction follows it within minutes.
_TEMPERATURE_TIMEOUT = 60_000_000_000
# Readings that are kept until joint states follow, which may never do so.
_MOST_PENDING = 100
_NEVER = -math.inf


class Direction:
    """Holds the last direction d per joint; 0 if it is malformed or old.

    For each joint the later message is used, and 0 after `timeout` s of silence. If there are
    several `planners` and a joint's direction changes and changes back within the timeout, they
    contradict each other: the direction counts as 0 for twice that time. `refused` is the number of
    invalid messages so far, and `why` the fault of the last of them. `ends` are the positions in
    rad at which the movements end, NaN where no planner says so, shape (J,); they are kept until
    another direction or end comes. `is_pushed`, bool, shape (J,), says where a sensor feels the
    person push in the direction announced. Times are in ns.
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
        """Reset to 0 until the next message."""
        count = len(self._zeros)
        self._values, self._times = self._zeros, [_NEVER] * count
        self.ends, self.is_pushed = np.full(count, math.nan), np.zeros(count, dtype=bool)
        # Previous direction of each joint, and the times of its change and of its change back.
        self._before, self._changed, self._disputed = (
            [0.0] * count, [_NEVER] * count, [_NEVER] * count)

    def begin(self, time: int) -> None:
        """Date earlier directions, whose clock may be ahead, to the first joint state at most."""
        self._times = [min(stamp, time) for stamp in self._times]

    def take(self, values: Sequence[int], time: int) -> bool:
        """Take a message; return whether it is valid. What is not -1, 0 or +1 counts as 0."""
        count = len(self._zeros)
        if len(values) != count:
            return self._refuse(f'{len(values)} values for {count} joints', range(count), time)
        return self._take(range(count), [v if v in (-1, 0, 1) else math.nan for v in values],
                          'a value other than -1, 0 and +1', time)

    def take_stamped(self, names: Sequence[str], velocities: Sequence[float], stamp: int,
                     now: int, ends: Sequence[float] = (), pushes: Sequence[float] = ()) -> bool:
        """Take a message with the planner's stamp; return whether it is valid.

        The signs of the velocities are the directions. Unknown joints are ignored, joints that are
        not named keep their direction, and a joint that is named twice gets 0. A direction whose
        stamp is ahead of `now`, the time of the joint states, by more than the timeout counts as 0,
        since its age is unknown. `ends` and `pushes` may be empty, or NaN where not known; a
        push other than 0 is one that a sensor feels beyond doubt.
        """
        count = len(names)
        for word, values, lengths in (('velocities', velocities, (count,)),
                                      ('positions', ends, (0, count)),
                                      ('efforts', pushes, (0, count))):
            if len(values) not in lengths:
                return self._refuse(f'{len(values)} {word} for {count} names',
                                    range(len(self._zeros)), max(stamp, now))
        unknown = [math.nan] * count
        own = [(self._indices[name], value, end, push) for name, value, end, push in zip(
            names, velocities, ends or unknown, pushes or unknown) if name in self._indices]
        indices = [index for index, *_ in own]
        if stamp - now > self.timeout * 1e9:
            return self._refuse('a stamp ahead of time', indices, min(stamp, now))
        if len(set(indices)) < len(indices):
            return self._refuse('a joint named twice', indices, stamp)
        return self._take(
            indices, [value for _, value, *_ in own], 'a velocity that is not finite', stamp,
            [end for _, _, end, _ in own],
            [math.isfinite(push) and push != 0.0 for *_, push in own])

    def _take(self, indices: Sequence[int], values: Sequence[float], fault: str, time: int,
              ends: Sequence[float] = (), pushes: Sequence[bool] = ()) -> bool:
        """Keep the signs of values; where one is not finite, 0, and the message has a fault."""
        finite = [math.isfinite(value) for value in values]
        self._set(indices, [float(np.sign(value)) if known else 0.0
                            for value, known in zip(values, finite)], time, ends, pushes)
        return all(finite) or self._refuse(fault, (), time)

    def _refuse(self, why: str, indices: Sequence[int], time: int) -> bool:
        self.refused, self.why = self.refused + 1, why
        self._set(indices, [0.0] * len(indices), time)
        return False

    def _set(self, indices: Sequence[int], values: Sequence[float], time: int,
             ends: Sequence[float] = (), pushes: Sequence[bool] = ()) -> None:
        """Keep the directions of some joints, unless those known are newer than `time`, ns.

        Of several planners, two contradict each other if a direction changes back within the
        timeout.
        """
        # Callers of `at` may still hold the previous arrays.
        self._values, self.ends = self._values.copy(), self.ends.copy()
        self.is_pushed = self.is_pushed.copy()
        count = len(indices)
        for index, value, end, push in zip(
                indices, values, ends or [math.nan] * count, pushes or [False] * count):
            if time < self._times[index]:
                continue
            last = float(self._values[index])
            if value != last or not math.isnan(end):
                self.ends[index] = end
            if value != last:
                if (len(self.planners) > 1 and value == self._before[index]
                        and time - self._changed[index] <= self.timeout * 1e9):
                    self._disputed[index] = time
                self._before[index], self._changed[index] = last, time
            self._values[index], self._times[index] = value, time
            self.is_pushed[index] = push

    def disputed(self, time: int) -> list[str]:
        """Return the joints whose planners contradict each other at a time."""
        return [joint for joint, index in self._indices.items() if self._is_disputed(index, time)]

    def _is_disputed(self, index: int, time: int) -> bool:
        return time - self._disputed[index] <= 2.0 * self.timeout * 1e9

    def at(self, time: int) -> np.ndarray:
        """Return d at a time, shape (J,)."""
        limit = time - self.timeout * 1e9
        for index, stamp in enumerate(self._times):
            if stamp < limit or self._disputed[index] > _NEVER:
                return np.array([
                    0.0 if stamp < limit or self._is_disputed(index, time) else value
                    for index, (value, stamp) in enumerate(zip(self._values, self._times))])
        return self._values

    def outlived(self, time: int) -> bool:
        """Return whether there are directions, and all of them are older than a time."""
        return _NEVER < max(self._times) < time

    def age(self, index: int, time: int) -> float:
        """Return the age of a joint's direction at a time, s; NaN if there is none."""
        stamp = self._times[index]
        return (time - stamp) * 1e-9 if stamp > _NEVER else math.nan

    def silent(self, time: int) -> list[str]:
        """Return the joints whose direction, +1 or -1, has timed out."""
        return [joint for joint, index in self._indices.items()
                if self._values[index] != 0.0 and self.age(index, time) > self.timeout]


class MotorTemperature:
    """Holds the last motor temperature per joint, for states with later stamps, in ns."""

    def __init__(self, joints: Sequence[str]) -> None:
        self._indices = {joint: index for index, joint in enumerate(joints)}
        self.forget()

    def forget(self) -> None:
        """Remove all readings."""
        # Of each joint; then readings later than the states so far: time, joint index and value.
        self._values, self._times = [math.nan] * len(self._indices), [0] * len(self._indices)
        self._pending: list[tuple[int, int, float]] = []

    def take(self, joint: str, value: float, time: int) -> bool:
        """Add a reading in degrees Celsius, NaN if there is none; return False if impossible."""
        if joint not in self._indices or math.isnan(value):
            return True
        if beyond('temperature', np.array(value)):
            return False
        self._pending.append((time, self._indices[joint], value))
        del self._pending[:-_MOST_PENDING]
        return True

    def why_unknown(self, index: int, time: int) -> str:
        """Return why there is no reading of a joint for a state with a stamp, as text."""
        if self._times[index] == 0:
            return 'no motor_temperature received'
        return f'last motor_temperature is {(time - self._times[index]) * 1e-9:.0f} s old'

    def before(self, time: int) -> np.ndarray | None:
        """Return the temperatures for a state with a stamp, (J,), NaN where old, or None."""
        for stamp, index, value in self._pending:
            if stamp < time:
                self._times[index], self._values[index] = stamp, value
        self._pending = [reading for reading in self._pending if reading[0] >= time]
        values = [value if time - stamp <= _TEMPERATURE_TIMEOUT else math.nan
                  for value, stamp in zip(self._values, self._times)]
        return None if all(map(math.isnan, values)) else np.array(values)
