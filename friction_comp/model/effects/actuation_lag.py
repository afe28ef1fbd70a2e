# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Delay between the current and the torque it makes."""

from __future__ import annotations

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.effects.base import Effect


class ActuationLag(Effect):
    """Current and motion do not belong to the same moment.

    It adds no current of its own. Where `first_order` is 0 the current at time t is what the motion
    at t + lag asks for: positive where torque follows the current late, negative where the
    recorded current comes after the motion. Where it is 1, the recorded current is behind a
    first-order low pass of that time constant; where it is -1, the torque is, behind the current.
    """

    name = 'actuation_lag'
    variable = 'history'
    constants = {'lag': ('linear', 1.0), 'first_order': None}

    @classmethod
    def check(cls, values):
        """Refuse a time constant that is none."""
        super().check(values)
        if values['first_order'] not in (-1.0, 0.0, 1.0):
            raise InputError(f"first_order must be -1, 0 or 1, not {values['first_order']!r}")
        if values['first_order'] and values['lag'] <= 0:
            raise InputError(f"lag must be positive for a low pass, not {values['lag']!r}")

    @classmethod
    def grid(cls, scene):
        """Lags of half a sample to some thirty, either way, and low passes of as much."""
        step = scene.sample_time
        steps = np.array([0.5, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128])
        steps = steps[steps * step <= 0.15]
        grid = [{'lag': float(side * value * step), 'first_order': 0.0}
                for value in steps for side in (1.0, -1.0)]
        return grid + [{'lag': float(value * step), 'first_order': side}
                       for value in steps for side in (1.0, -1.0)]

    @classmethod
    def columns(cls, samples, lag, first_order):
        """Return no column."""
        return np.empty((len(samples), 0))

    def why_left_out(self):
        """Return why the lag is not compensated."""
        return 'to make up for a delay the compensator would have to know the motion in advance'

    def describe(self):
        """Return the effect in words."""
        lag = 1e3 * self.values['lag']
        if self.values['first_order'] > 0:
            return f'Lag: the recorded current is behind a low pass of {lag:.2g} ms'
        if self.values['first_order'] < 0:
            return f'Lag: torque is behind the recorded current by a low pass of {lag:.2g} ms'
        if lag < 0:
            return f'Lag: the recorded current comes {-lag:.2g} ms after the motion'
        return f'Lag: torque follows the recorded current by {lag:.2g} ms'

    def formula(self):
        """Return the formula with its numbers."""
        if self.values['first_order'] > 0:
            return f'all behind 1/(1 + {self.values["lag"]:.4g}·s)'
        if self.values['first_order'] < 0:
            return f'all before 1/(1 + {self.values["lag"]:.4g}·s)'
        return f'all terms at t {self.values["lag"]:+.4g} s'
