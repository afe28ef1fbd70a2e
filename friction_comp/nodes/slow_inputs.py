# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Slow inputs as the compensator trusts them: checked, and only while they are fresh."""

from __future__ import annotations

import numpy as np

# Friction follows the motor's temperature over minutes: an older reading says nothing.
_TEMPERATURE_TIMEOUT = 60_000_000_000


class Direction:
    """Holds the last direction d per joint; 0 where it is malformed or old.

    Parameters
    ----------
    size : int
        Number of joints.
    timeout : float
        s of silence after which d is 0.
    """

    def __init__(self, size, timeout):
        self.timeout = timeout
        self.refused = 0
        self._zeros = np.zeros(size)
        self.forget()

    def forget(self):
        """Fall back to 0 until the next message."""
        self._values = self._zeros
        self._time = None

    def take(self, values, time):
        """Take a message that came at a time in ns.

        A message of the wrong length counts as 0 for all joints, a value other than -1, 0 or +1
        as 0 for its joint.
        """
        values = np.asarray(values, dtype=float)
        self._time = time
        if values.shape != self._zeros.shape:
            self.refused += 1
            self._values = self._zeros
            return
        known = np.isin(values, (-1.0, 0.0, 1.0))
        self.refused += int(not known.all())
        self._values = np.where(known, values, 0.0)

    def at(self, time):
        """Return d at a time in ns, shape (J,)."""
        if self._time is None or time - self._time > self.timeout * 1e9:
            return self._zeros
        return self._values


class MotorTemperature:
    """Holds the last motor temperature per joint.

    A reading counts for joint states later than itself. Topics may overtake each other; this way
    the same reading meets the same state in every run of a simulation.

    Parameters
    ----------
    joints : list of str
    """

    def __init__(self, joints):
        self._numbers = {joint: number for number, joint in enumerate(joints)}
        self.forget()

    def forget(self):
        """Know nothing until the next reading."""
        self._values = np.full(len(self._numbers), np.nan)
        self._times = [0] * len(self._numbers)
        self._coming = []

    def take(self, joint, value, time):
        """Take a reading in degrees Celsius with its stamp in ns."""
        if joint in self._numbers and np.isfinite(value):
            self._coming.append((time, self._numbers[joint], value))

    def why_unknown(self, number, time):
        """Return in words why there is no reading of a joint for a state stamped `time` ns."""
        if self._times[number] == 0:
            return 'no motor_temperature received'
        return f'last motor_temperature is {(time - self._times[number]) * 1e-9:.0f} s old'

    def before(self, time):
        """Return the temperatures for a state stamped `time` ns, shape (J,), or None.

        NaN where a joint has no fresh reading; None where no joint has one.
        """
        if self._coming:
            later = []
            for reading in self._coming:
                if reading[0] < time:
                    self._times[reading[1]], self._values[reading[1]] = reading[0], reading[2]
                else:
                    later.append(reading)
            # Without an end, readings of another clock would pile up.
            self._coming = later[-100:]
        for number, taken in enumerate(self._times):
            if time - taken > _TEMPERATURE_TIMEOUT:
                self._values[number] = np.nan
        return None if np.isnan(self._values).all() else self._values
