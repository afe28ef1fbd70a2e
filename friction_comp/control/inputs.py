# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is known of the joints at a joint state; what is in doubt is reported and counts as missing.

Every check of an input stands here or in the class of that input, and only there: the law takes
what it gets.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
import time
from typing import Any

import numpy as np

from friction_comp.control import joint_states
from friction_comp.control.faults import Faults, WARN
from friction_comp.control.joint_states import JointStateInput, within
from friction_comp.control.watchdog import Watchdog
from friction_comp.facts.motion import BLOCK, FEWEST_BLOCKS, VelocityCheck
from friction_comp.messages import NANO
from friction_comp.samples import beyond, LIMITS

_MAX_POSITION, _MAX_VELOCITY = LIMITS['position'][0], LIMITS['velocity'][0]
_NEVER = -math.inf


class Inputs:
    """Joint states, directions and temperatures of a compensator, validated.

    Age or silence of joint states beyond `timeout` (ns) is a fault: `on_silence` is then called, in
    the watchdog's thread. `direction_timeout` is in s, and that of `directions`.

    Of the last new joint state are: `time`, s since the first one (seconds since 1970 have too
    little resolution as a float); `position`, `direction` and `ends` (of announced movements),
    shape (J,), rad, NaN where in doubt or unknown; `is_pushed`, bool, where a sensor feels the
    person push in that direction, if any; `velocity`, rad/s, and `temperature`, degrees Celsius,
    shape (J,) or None where nobody sent any; whether it begins `anew` rather than continues the
    state before; and how long joint states were silent before it, `silence` in s.
    """

    def __init__(self, joints: Sequence[str], timeout: int, direction_timeout: float,
                 faults: Faults, on_silence: Callable[[], None],
                 clock: Callable[[], float] = time.monotonic) -> None:
        self._joints, self._faults = list(joints), faults
        self._on_silence, self._clock = on_silence, clock
        self.states = JointStateInput(joints, timeout)
        self.directions = Direction(joints, direction_timeout)
        self._temperature = MotorTemperature(joints)
        self.watchdog = Watchdog(timeout / NANO, self._fall_silent, clock)
        self.forget()

    def forget(self, resolutions: Sequence[float] = ()) -> None:
        """Forget all inputs; `resolutions` are those of the encoders, rad, if they change."""
        self.watchdog.rest()
        self.states.forget()
        self.directions.forget()
        self._temperature.forget()
        self._silent_since: float | None = None
        self.silence = 0.0
        if resolutions:
            self._first = 0
            self._velocities = [VelocityCheck(FEWEST_BLOCKS, resolution)
                                for resolution in resolutions]
            self._block: list[tuple[float, np.ndarray, np.ndarray]] = []
            self._due: list[tuple[VelocityCheck, tuple[np.ndarray, ...]]] = []

    def take(self, message: Any, now: int, received: int = 0, sequence: int = 0) -> str:
        """Read a joint state and return the verdict; arguments of `JointStateInput.take`."""
        verdict = self.states.take(message, now, received, sequence)
        if verdict == joint_states.NEW:
            self.silence = 0.0
            if self._silent_since is not None:
                self.silence = self._clock() - self._silent_since
                self._silent_since = None
            self.watchdog.feed()
            self._read()
        elif verdict == joint_states.PART:
            if self.states.overdue:
                self._report_missing()
        elif verdict not in (joint_states.AGAIN, joint_states.LATE):
            self._faults.report(verdict, self.states.wrong)
        return verdict

    def take_direction(self, values: Any, now: int) -> None:
        """Take a plain direction; it is as old as the newest joint state."""
        # By the time of the states, not of arrival: in a simulation, a direction must not age while
        # time stops, and its age must be reproducible.
        if not self.directions.take(values, self.states.stamp or now):
            self._refuse_direction()

    def take_stamped_direction(self, names: Any, velocities: Any, stamp: int, now: int,
                               ends: Any = (), pushes: Any = ()) -> None:
        """Take a direction with its stamp, where the movement ends, and whether a push is felt."""
        at = self.states.stamp or now
        if not self.directions.take_stamped(names, velocities, stamp or at, max(at, now), ends,
                                            pushes):
            self._refuse_direction()

    def _refuse_direction(self) -> None:
        self._faults.report(
            'direction', f'a direction was counted as 0: {self.directions.why}', WARN)

    def take_temperature(self, joint: str, value: float, stamp: int, now: int) -> None:
        """Take a temperature in degrees Celsius with the stamp of its measurement."""
        if not self._temperature.take(joint, value, stamp or self.states.stamp or now):
            self._faults.report('temperature', f'{joint}: a motor temperature of {value:.4g} °C is '
                                'impossible and was passed over', WARN)

    def set_sources(self, states: list[str], planners: list[str]) -> None:
        """Tell who publishes joint states, and directions, if there are several."""
        self.states.publishers, self.directions.planners = states, planners

    def _read(self) -> None:
        states, stamp = self.states, self.states.stamp
        self.anew = states.restarted or states.gap
        if states.restarted:
            self.directions.forget()
            self._temperature.forget()
        if states.restarted or not self._first:
            self._first = stamp
            self.directions.begin(stamp)
        self.time = (stamp - self._first) / NANO
        self.position, self.velocity = states.position, states.velocity
        if not (within(states.position, _MAX_POSITION) and (
                states.velocity is None or within(states.velocity, _MAX_VELOCITY))):
            self.position = np.where(self._possible(), states.position, np.nan)
        # Without a velocity there is no contradiction: the position is used alone.
        wrong = [] if states.velocity is None else [
            j for j, check in enumerate(self._velocities) if check.fault]
        if wrong:
            self.position = self.position.copy()
            self.position[wrong] = np.nan
            self._faults.report('velocity', '; '.join(
                f'{self._joints[j]}: {self._velocities[j].fault}' for j in wrong))
        self.direction, self.ends = self.directions.at(stamp), self.directions.ends
        self.is_pushed = self.directions.is_pushed
        self.temperature = self._temperature.before(stamp)

    def _possible(self) -> np.ndarray:
        """Report values that cannot be; return whose can, bool, shape (J,)."""
        states, joints = self.states, self._joints
        signals = {'position': states.position}
        if states.velocity is not None:
            signals['velocity'] = states.velocity
        possible = np.all(np.isfinite(list(signals.values())), axis=0)
        if states.missing:
            self._report_missing()
        elif not possible.all():
            self._faults.report(
                'values', 'joint_states hold values that are not finite, or too few')
        for signal, values in signals.items():
            for j in np.flatnonzero(possible & beyond(signal, values)):
                possible[j] = False
                self._faults.report(f'{signal} of {joints[j]}', f'{joints[j]}: a {signal} of '
                                    f'{values[j]:.3g} {LIMITS[signal][1]} is impossible')
        return possible

    def _report_missing(self) -> None:
        self._faults.report('missing', f'joint_states lack {", ".join(self.states.missing)}')

    def compare_velocities(self) -> None:
        """Collect blocks of velocity and position, or compare those of one joint.

        To be called after an answer. One joint each time, so that the next answer is not delayed.
        """
        states, block = self.states, self._block
        if self.anew or states.velocity is None:
            block.clear()
        if states.velocity is not None:
            block.append((self.time, states.position, states.velocity))
        if self._due:
            check, signals = self._due.pop()
            check.judge(*signals)
        elif block and self.time - block[0][0] >= BLOCK:
            time, position, velocity = map(np.array, zip(*block))
            self._due = [(check, (time, position[:, j], velocity[:, j]))
                         for j, check in enumerate(self._velocities)]
            # A block begins where the one before ends.
            del block[:-1]

    def _fall_silent(self) -> None:
        self._on_silence()
        self._silent_since = self._clock()
        self._report_silence()

    def _report_silence(self) -> None:
        self._faults.report('silence', 'no joint_states, or none that are new')

    def report(self) -> None:
        """Report what is in doubt now."""
        if self._silent_since is not None:
            self._report_silence()
        direction, stamp = self.directions, self.states.stamp
        disputed, silent = direction.disputed(stamp), direction.silent(stamp)
        if disputed:
            self._faults.report('planners', f'the direction of {", ".join(disputed)} counts as 0: '
                                f'{", ".join(direction.planners)} contradict each other')
        if silent:
            self._faults.report('direction silent', f'the direction of {", ".join(silent)} was not '
                                f'renewed for {direction.timeout:g} s and counts as 0', WARN)

    def in_use(self, joint: int) -> bool:
        """Return whether states come, and no value of a joint is in doubt."""
        return (self._silent_since is None and self.states.stamp != 0
                and math.isfinite(self.position[joint]))

    def why_missing(self, joint: int, signal: str) -> str:
        """Return why a joint lacks a signal at the last state."""
        if signal == 'temperature':
            return self._temperature.why_unknown(joint, self.states.stamp)
        return f'the {signal} is not measured here: the torque sensor is for evaluation only'

    def direction_values(self) -> tuple[np.ndarray, list[float]]:
        """Return directions at the last state, and their ages in s, NaN where there is none."""
        stamp = self.states.stamp
        return self.directions.at(stamp), [
            self.directions.age(joint, stamp) for joint in range(len(self._joints))]

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of messages that were not used, for diagnostics."""
        return {'directions refused': self.directions.refused,
                'joint_states passed over': self.states.passed_over}


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
    """Holds motor temperatures per joint, each for states with later stamps, in ns."""

    def __init__(self, joints: Sequence[str]) -> None:
        self._indices = {joint: index for index, joint in enumerate(joints)}
        self.forget()

    def forget(self) -> None:
        """Remove all readings."""
        # The last reading and the one before, for states that are as old as the last; (J,) each.
        self._values = [np.full(len(self._indices), math.nan) for _ in range(2)]
        self._times = [np.zeros(len(self._indices)) for _ in range(2)]

    def take(self, joint: str, value: float, time: int) -> bool:
        """Add a reading in degrees Celsius, NaN if there is none; return False if impossible."""
        if joint not in self._indices or math.isnan(value):
            return True
        if beyond('temperature', np.array(value)):
            return False
        j = self._indices[joint]
        for held, new in ((self._values, value), (self._times, time)):
            held[1][j], held[0][j] = held[0][j], new
        return True

    def why_unknown(self, index: int, time: int) -> str:
        """Return why there is no reading of a joint for a state with a stamp, as text."""
        if not self._times[0][index]:
            return 'no motor_temperature received'
        return f'last motor_temperature is {(time - self._times[0][index]) * 1e-9:.0f} s old'

    def before(self, time: int) -> np.ndarray | None:
        """Return the temperatures for a state with a stamp, (J,), NaN where old, or None."""
        if not self._times[0].any():
            return None
        values = np.full(len(self._indices), math.nan)
        for held, stamps in zip(self._values[::-1], self._times[::-1]):
            # Friction follows the temperature within minutes.
            known = (stamps > 0) & (stamps < time) & (time - stamps <= 60_000_000_000)
            values[known] = held[known]
        return None if np.isnan(values).all() else values
