# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The direction in which a person begins to move a joint, from a cheap sensor of force.

The sensor is calibrated at rest. From then on the onset of a push is found by a test with a stated
rate of false alarms; the direction is the side of the force.
"""

from __future__ import annotations

from collections import deque
import math
from typing import Any

import numpy as np

from friction_comp.direction.announcement import Announcement
from friction_comp.direction.attempt import Attempt, REARM
from friction_comp.direction.channel import Channel
from friction_comp.direction.joint_motion import JointMotion
from friction_comp.errors import InputError

CALIBRATION_TIME = 3.0
"""s at rest."""
# Samples on the same side that an onset needs.
_AGREE = 3
# Change between the halves of the last 0.3 s, in units of the scatter, below which a sensor rests.
_QUIET = 2.0


class SensedDirection:
    """Announces the direction of one joint from its sensor.

    The force is positive if it pushes towards larger positions. `sensor_range` are the lowest and
    the highest value that the converter can give.
    """

    def __init__(self, sensor_range: tuple[float, float]) -> None:
        low, high = sensor_range
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InputError('sensor_range must be the lowest and the highest value that the '
                             f'sensor can give, such as [0, 1023], not [{low:g}, {high:g}]')
        self.motion = JointMotion()
        self._channel, self._ready = Channel(low, high), False
        self._attempt = Attempt()
        self._collected: list[np.ndarray] | None = None
        self._failure: InputError | None = None
        self._since = self._until = math.nan
        self._fault = 'not calibrated'

    # Calibration.

    @property
    def calibrating(self) -> bool:
        """Whether values are collected."""
        return self._collected is not None

    def begin_calibration(self) -> None:
        """Collect values for `CALIBRATION_TIME`; nothing is announced before it has ended."""
        self._collected, self._since = [], math.nan
        self._ready, self._fault = False, 'calibrating'
        self._attempt = Attempt()

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
        values = np.concatenate(collected) if collected else np.zeros(0)
        if not (passed > 0.5 * CALIBRATION_TIME and len(values) > 20.0 * passed):
            raise InputError(
                f'{len(values)} values in {CALIBRATION_TIME:g} s: a calibration needs a sensor '
                'that sends at least 20 per second')
        # The first message has come at the beginning of the time that passed.
        rate = (len(values) - len(collected[0] if collected else ())) / passed
        self._channel.calibrate(values, rate)
        if self.motion.rest(self._until) < passed:
            raise InputError('the joint moved during the calibration, or joint_states are missing')
        self._recent: deque[float] = deque(maxlen=max(_AGREE, round(REARM * rate)))

    # Samples.

    def add(self, time: float, values: Any) -> None:
        """Take samples, shape (N,), of which the last was measured at a time in s."""
        samples = np.asarray(values, dtype=float)
        self._channel.add(time, samples)
        if self._collected is not None:
            self._since = time if math.isnan(self._since) else self._since
            self._until = time
            self._collected.append(samples)
            # By the values' own time, so that what is learnt follows from them alone.
            if time - self._since >= CALIBRATION_TIME:
                self._learn(self._collected)
        elif self._ready:
            for value in samples.tolist():
                self._judge(time, value)

    def _judge(self, time: float, value: float) -> None:
        self._fault = self._find_fault(time)
        if self._fault:
            self._attempt.stop(time, self._fault)
            self._recent.clear()
            return
        self._recent.append(value)
        test = self._channel.test
        alarm = test.add(value)
        if self._attempt.add(time, self.motion, self._side(time, alarm), value - test.level,
                             self._quiet()):
            test.settle(math.fsum(self._recent) / len(self._recent))
        elif self._attempt.resting and not alarm and self.motion.rest(time):
            test.follow()

    def _quiet(self) -> bool:
        """Return whether the sensor has not changed for as long as it is remembered."""
        if self._attempt.resting or self._attempt.direction:
            return True
        if len(self._recent) < (self._recent.maxlen or 0):
            return False
        values, half = list(self._recent), len(self._recent) // 2
        return abs(math.fsum(values[half:]) / (len(values) - half)
                   - math.fsum(values[:half]) / half) < _QUIET * self._channel.test.scatter

    def _find_fault(self, time: float) -> str:
        if fault := self._channel.fault(time):
            return f'sensor: {fault}'
        if self._attempt.contradicted:
            return 'the joint moves against the sensor: is its sign reversed?'
        return '' if self.motion.known(time) else 'joint_states are missing'

    def _side(self, time: float, alarm: int) -> int:
        """Return the direction of a push, 0 unless it is certain."""
        level, last = self._channel.test.level, list(self._recent)[-_AGREE:]
        if not alarm or len(last) < _AGREE or not all(
                (value - level) * alarm > 0.0 for value in last):
            return 0
        jumped = self._attempt.resting and self._channel.jumped()
        if jumped:
            self._attempt.stop(time, 'a jump, no push')
        return alarm if jumped is False else 0

    def at(self, time: float) -> Announcement:
        """Return what is announced at a time in s."""
        fault = self._fault or (self._find_fault(time) if self._ready else '')
        if fault:
            self._attempt.stop(time, fault)
            return Announcement(0, fault, fault=True)
        direction = self._attempt.direction
        return Announcement(direction, self._attempt.reason,
                            is_pushed=self._channel.test.sure * direction > 0)
