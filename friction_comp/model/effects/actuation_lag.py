# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Delay between the current and the torque it makes."""

from __future__ import annotations

import numpy as np

from friction_comp.model.effects.base import Effect


class ActuationLag(Effect):
    """The current at time t is what the motion at t + lag asks for.

    It adds no current of its own: the model evaluates all its terms for the motion shifted in
    time. A negative lag says that the recorded current comes after the motion, as a filtered or
    late current signal does.
    """

    name = 'actuation_lag'
    variable = 'history'
    constants = {'lag': ('linear', 1.0)}

    @classmethod
    def grid(cls, scene):
        """Lags of one to some forty samples either way."""
        step = scene.sample_time
        steps = np.array([0.5, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32])
        steps = steps[steps * step <= 0.15]
        return [{'lag': float(side * value * step)} for value in steps for side in (1.0, -1.0)]

    @classmethod
    def columns(cls, samples, lag):
        """Return no column."""
        return np.empty((len(samples), 0))

    def why_left_out(self):
        """Return why the lag is not compensated."""
        return 'to make up for a delay the compensator would have to know the motion in advance'

    def describe(self):
        """Return the effect in words."""
        lag = self.values['lag']
        return f'Lag: torque follows the recorded current by {1e3 * lag:.2g} ms'

    def formula(self):
        """Return the formula with its numbers."""
        return f'all terms at t {self.values["lag"]:+.4g} s'
