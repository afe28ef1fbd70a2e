# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The direction in which a person begins to move a joint, from a cheap sensor of force or muscles.

The sensor is calibrated at rest. From then on the onset of a push is found by a test with a stated
rate of false alarms; the direction is the side of the force, or the muscle that dominates. Muscles
that act against each other announce nothing.
"""

from __future__ import annotations

from collections import deque
import math
from typing import Any

import numpy as np

from friction_comp.direction import KINDS
from friction_comp.direction.announcement import Announcement
from friction_comp.direction.attempt import Attempt, REARM
from friction_comp.direction.channel import Channel, FORCE
from friction_comp.direction.joint_motion import JointMotion
from friction_comp.direction.muscle_level import SHORT
from friction_comp.errors import InputError

CALIBRATION_TIME = 3.0
"""s at rest."""
# Samples on the same side that an onset needs; raw signals, in which hum has to be told from a
# muscle, need that many blocks.
_AGREE, _AGREE_RAW = 3, 4
# Factor by which the dominant muscle's energy must exceed the other's, by that one's scatter more:
# half way, as factors go, from muscles that act alike, 2.4 where electrodes differ by half, to one
# alone, a quarter of whose signal appears in the other channel, and 0.15 of it as the other's: 8.5.
_DOMINANT = 4.5
# Change between the halves of the last 0.3 s, in units of the scatter, below which a sensor rests.
_QUIET = 2.0
# Excess, in units of the scatter, and its variation within 0.3 s as a share of it, beyond and below
# which an envelope is that of hum. That of a muscle varies by a fifth.
_HIGH, _STEADY = 10.0, 0.03
# Values over which the strength of a muscle is averaged, at least; at an onset, all that the alarm
# is made of.
_AVERAGED = 4


class SensedDirection:
    """Announces the direction of one joint from its sensor, whose kind is one of `KINDS`.

    A force has one channel, positive if it pushes towards larger positions; muscles have two, the
    first of which moves the joint towards larger positions. `sensor_range` are the lowest and the
    highest value that the converter can give.
    """

    def __init__(self, kind: str, sensor_range: tuple[float, float]) -> None:
        if kind not in KINDS:
            raise InputError(f'sensor must be one of {", ".join(KINDS)}, not {kind!r}')
        low, high = sensor_range
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InputError('sensor_range must be the lowest and the highest value that the '
                             f'sensor can give, such as [0, 1023], not [{low:g}, {high:g}]')
        names = (FORCE,) if kind == FORCE else ('flexor', 'extensor')
        self.kind = kind
        self.motion = JointMotion()
        self._channels = [Channel(name, low, high, kind != 'muscle_raw') for name in names]
        self._raw, self._ready = kind == 'muscle_raw', False
        self._attempt = Attempt(self.kind != FORCE)
        self._collected: list[np.ndarray] | None = None
        self._failure: InputError | None = None
        self._since = self._until = math.nan
        self._fault = 'not calibrated'

    @property
    def channels(self) -> int:
        """Number of values in a sample."""
        return len(self._channels)

    # Calibration.

    @property
    def calibrating(self) -> bool:
        """Whether values are collected."""
        return self._collected is not None

    def begin_calibration(self) -> None:
        """Collect values for `CALIBRATION_TIME`; nothing is announced before it has ended."""
        self._collected, self._since = [], math.nan
        self._ready, self._fault = False, 'calibrating'
        self._attempt = Attempt(self.kind != FORCE)

    def end_calibration(self) -> None:
        """Learn from the values so far, if not done yet; raises InputError if they are unusable."""
        if self._collected is not None:
            self._learn(self._collected)
        if self._failure is not None:
            raise self._failure

    def _learn(self, collected: list[np.ndarray]) -> None:
        self._collected = self._failure = None
        try:
            self._learn_from(collected)
        except InputError as error:
            self._failure = error
            self._fault = f'not calibrated: {error}'
        else:
            self._ready, self._fault = True, ''

    def _learn_from(self, collected: list[np.ndarray]) -> None:
        passed = self._until - self._since
        values = np.concatenate(collected) if collected else np.zeros((0, len(self._channels)))
        if not (passed > 0.5 * CALIBRATION_TIME and len(values) > 20.0 * passed):
            raise InputError(
                f'{self._channels[0].name}: {len(values)} values in {CALIBRATION_TIME:g} s: '
                'a calibration needs a sensor that sends at least 20 per second')
        # The first message has come at the beginning of the time that passed.
        rate = (len(values) - len(collected[0] if collected else ())) / passed
        for channel, own in zip(self._channels, values.T):
            channel.calibrate(own, rate)
        if self.motion.rest(self._until) < passed:
            raise InputError('the joint moved during the calibration, or joint_states are missing')
        self._recent: deque[list[float]] = deque(maxlen=max(
            _AVERAGED, round(REARM * self._channels[0].test.rest.rate)))

    # Samples.

    def add(self, time: float, values: Any) -> None:
        """Take samples, shape (N, channels), of which the last was measured at a time in s."""
        rows = np.atleast_2d(np.asarray(values, dtype=float))
        if rows.shape[1] != len(self._channels):
            raise InputError(f'a sensor of kind {self.kind} gives {len(self._channels)} values a '
                             f'joint, not {rows.shape[1]}')
        tested = [channel.add(time, own) for channel, own in zip(self._channels, rows.T)]
        if self._collected is not None:
            self._since = time if math.isnan(self._since) else self._since
            self._until = time
            self._collected.append(rows)
            # By the values' own time, so that what is learnt follows from them alone.
            if time - self._since >= CALIBRATION_TIME:
                self._learn(self._collected)
        elif self._ready:
            for row in np.column_stack(tested).tolist():
                self._judge(time, row)

    def _judge(self, time: float, row: list[float]) -> None:
        """Take one value of each channel."""
        self._fault = self._find_fault(time)
        if self._fault:
            self._attempt.stop(time, self._fault)
            self._recent.clear()
            return
        self._recent.append(row)
        tests = [channel.test for channel in self._channels]
        alarms = [test.add(value) for test, value in zip(tests, row)]
        if self.kind != FORCE and not self._attempt.direction and min(alarms) < 0:
            # A muscle rests lower than was thought.
            last = list(self._recent)[-_AVERAGED:]
            for test, own in zip(tests, zip(*last)):
                if test.alarm < 0:
                    test.settle(min(test.level, math.fsum(own) / len(own)))
            alarms = [test.alarm for test in tests]
        strength, certain = self._push()
        side = self._side(time, alarms, strength) if certain else 0
        if self._attempt.add(time, self.motion, side, strength, self._quiet(),
                             not any(alarms)):
            for test, own in zip(tests, zip(*self._recent)):
                test.settle(math.fsum(own) / len(own))
        elif self._attempt.resting and not any(alarms) and self.motion.rest(time):
            for test in tests:
                test.follow()

    def _quiet(self) -> bool:
        """Return whether the channels have not changed for as long as they are remembered."""
        if self._attempt.resting or self._attempt.direction:
            return True
        if len(self._recent) < (self._recent.maxlen or 0):
            return False
        half = len(self._recent) // 2
        return all(
            abs(math.fsum(own[half:]) / (len(own) - half) - math.fsum(own[:half]) / half)
            < _QUIET * channel.test.scatter
            for channel, own in zip(self._channels, zip(*self._recent)))

    def _find_fault(self, time: float) -> str:
        faults = [channel.fault(time) for channel in self._channels]
        faults += [f'{channel.name}: too steady for a muscle'
                   for index, channel in enumerate(self._channels) if self._too_steady(index)]
        if self._attempt.contradicted:
            faults.append('the joint moves against the sensor: is its sign reversed, or are its '
                          'channels exchanged?')
        elif not self.motion.known(time):
            faults.append('joint_states are missing')
        return next(filter(None, faults), '')

    def _too_steady(self, index: int) -> bool:
        """Return whether an envelope is high and steady, as that of hum is."""
        if self.kind != 'muscle_envelope' or len(self._recent) < (self._recent.maxlen or 0):
            return False
        own, test = np.array([row[index] for row in self._recent]), self._channels[index].test
        excess = float(own.mean()) - test.level
        return excess > _HIGH * test.scatter and float(own.std()) < _STEADY * excess

    def _energy(self, index: int) -> tuple[float, float]:
        """Return a muscle's recent energy above that at rest, and its standard deviation.

        The energy is a power of the sensor's values, in the unit of that power.
        """
        test, power = self._channels[index].test, 3.0 if self._raw else 2.0
        since_alarm = 0 if self._attempt.direction else max(
            channel.test.rising for channel in self._channels)
        values = [max(row[index], 0.0)
                  for row in list(self._recent)[-max(_AVERAGED, since_alarm):]]
        energy = sum(value**power for value in values) / len(values)
        mean = sum(values) / len(values)
        # The scatter is that of sums: fewer values than noise remembers have that of one sum.
        return (energy - max(test.level, 0.0)**power, power * mean**(power - 1.0) * test.scatter
                / math.sqrt(max(len(values), test.rest.memory)))

    def _push(self) -> tuple[float, bool]:
        """Return how much the person pushes, positive in direction +1, and if that is certain.

        The unit is that of a force's values, or the root of a muscle's energy; strengths are only
        compared with others of the same sensor. 0 is certain of no side.
        """
        if self.kind == 'force':
            return self._recent[-1][0] - self._channels[0].test.level, True
        flexor, extensor = self._energy(0), self._energy(1)
        sign, (agonist, _), (antagonist, scatter) = (
            (1.0, flexor, extensor) if flexor[0] > extensor[0] else (-1.0, extensor, flexor))
        if agonist <= _DOMINANT * max(antagonist, 0.0):
            return 0.0, False
        return (sign * math.sqrt(agonist),
                agonist > _DOMINANT * (max(antagonist, 0.0) + scatter))

    def _side(self, time: float, alarms: list[int], strength: float) -> int:
        """Return the direction of a push, 0 unless it is certain."""
        agree = _AGREE_RAW if self._raw else _AGREE
        last = list(self._recent)[-agree:]
        if len(last) < agree:
            return 0
        index = 0 if self.kind == 'force' or strength > 0.0 else 1
        channel, alarm = self._channels[index], alarms[index]
        if self.kind != 'force':
            alarm = max(alarm, 0)
        if not alarm or not all((row[index] - channel.test.level) * alarm > 0.0 for row in last):
            return 0
        if self._raw and channel.hums(SHORT):
            return 0
        jumped = not self._raw and self._attempt.resting and channel.jumped()
        if jumped:
            self._attempt.stop(time, f'{channel.name}: a jump, no push')
        if jumped is not False:
            return 0
        return alarm if index == 0 else -alarm

    def at(self, time: float) -> Announcement:
        """Return what is announced at a time in s."""
        fault = self._fault or (self._find_fault(time) if self._ready else '')
        if fault:
            self._attempt.stop(time, fault)
            return Announcement(0, fault, fault=True)
        direction = self._attempt.direction
        if self.kind == FORCE:
            is_pushed = self._channels[0].test.sure * direction > 0
        else:
            muscle = self._channels[0 if direction > 0 else 1]
            is_pushed = direction != 0 and muscle.test.sure > 0
        return Announcement(direction, self._attempt.reason, is_pushed=is_pushed)
