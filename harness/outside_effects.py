# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Adds effects that the package does not know to recordings of simulated drives.

Each function takes a `Trial`, its `SimulatedDrive` and a random generator, and returns the trial
with the effect added to its current. They are defined here, independently of the package.
"""

from dataclasses import replace

import numpy as np


def _moving(samples):
    """Return velocity and a direction that is 0 at rest, from the counted position."""
    step = samples.sample_time
    reach = max(1, round(0.01 / step))
    padded = np.pad(samples.position, reach, mode='edge')
    velocity = (padded[2 * reach:] - padded[:-2 * reach]) / (2 * reach * step)
    return velocity, np.where(np.abs(velocity) > 0.004, np.sign(velocity), 0.0)


def _added(trial, extra):
    samples = trial.samples
    return replace(trial, samples=samples.with_(current=samples.current + extra),
                   noise_free=trial.noise_free + extra)


def product(trial, drive, rng):
    """Viscous friction that grows along the joint: current ~ position · velocity."""
    velocity, _ = _moving(trial.samples)
    gain = drive.model.sigmoid.upper * rng.uniform(0.25, 0.5)
    return _added(trial, gain * trial.samples.position * velocity)


def moving_dead_spot(trial, drive, rng):
    """Friction almost vanishes at a spot that moves through the range over time."""
    samples = trial.samples
    _, direction = _moving(samples)
    share = (samples.time - samples.time[0]) / (samples.time[-1] - samples.time[0])
    spot = -1.6 + 3.2 * share
    depth = drive.model.sigmoid.upper * rng.uniform(0.6, 0.8)
    dip = depth * np.exp(-0.5 * ((samples.position - spot) / rng.uniform(0.3, 0.5)) ** 2)
    return _added(trial, -dip * direction)


def saturation(trial, drive, rng):
    """The current sensor saturates below the current of fast movements."""
    samples = trial.samples
    limit = np.quantile(np.abs(trial.noise_free), rng.uniform(0.7, 0.8))
    return replace(trial, samples=samples.with_(current=np.clip(samples.current, -limit, limit)),
                   noise_free=np.clip(trial.noise_free, -limit, limit))


# What the report may name: the variables each of them truly depends on.
OUTSIDE = {
    'product': (product, {'position', 'velocity'}),
    'moving_dead_spot': (moving_dead_spot, {'position', 'time'}),
    'saturation': (saturation, {'velocity'}),
}
