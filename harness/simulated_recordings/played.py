# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Plays plans on simulated drives, one after the other, as `improve` has them played."""

from __future__ import annotations

import numpy as np

from friction_comp.samples import Samples
from friction_comp.simulation.undeclared import Undeclared
from simulated_recordings.drives import _driven, STEP

RATE = 200.0


class PlayedDrive:
    """A simulated joint under the velocity controller of identification.

    `seed` is that of noise.
    """

    def __init__(self, drive, seed):
        self.drive = drive
        self._rng = np.random.default_rng([seed, 11])
        self._clock = 1000.0

    def follow(self, path):
        """Return the recording of a path, shape (N,), in rad at steps of `STEP`."""
        drive = self.drive
        undeclared = Undeclared.from_effects(drive.effects, {**drive.thermal, 'heating': 0.0})
        position, current, _, _ = _driven(drive, undeclared, np.asarray(path),
                                          np.zeros(len(path)), self._rng)
        keep = slice(None, None, round(1.0 / (STEP * RATE)))
        time = self._clock + np.arange(len(path))[keep] * STEP
        # A minute passes between recordings.
        self._clock += len(path) * STEP + 60.0
        count = drive.model.drive.position_resolution
        noise = drive.noise * self._rng.standard_normal(len(time))
        return Samples(time=time, position=np.round(position[keep] / count) * count,
                       current=current[keep] + noise, joint=drive.model.joint)

    def __call__(self, plan):
        """Return the recording of a plan."""
        return self.follow(plan.samples(1.0 / STEP).position)
