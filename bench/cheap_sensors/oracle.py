# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How early the onset of a simulated muscle can be known at all, at a rate of false alarms.

The oracle knows the exact densities before and after the onset: electrodes, noise, spectrum and how
the push grows; and looks for an onset every 10 ms, to either side. No test with mean time T between
false alarms has, in the limit, a shorter mean delay than it takes the divergence of Kullback and
Leibler to reach log(T) (Lorden 1971; Lai 1998 for values that depend on each other).
"""

import math

import numpy as np
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.signal import sosfilt

from cheap_sensors.attempts import ATTEMPT, BEFORE, pushes, STEP

BLOCK = 10
# Natural logarithm of the blocks in an hour; of both sides; of 99 correct decisions to one wrong.
PER_HOUR = math.log(3600.0 / (BLOCK * STEP))
EITHER, SURELY = PER_HOUR + math.log(2.0), math.log(99.0)


def earliest(joints, each, seed):
    """Return delays in s, shape (N,), NaN for misses: least, the oracle's, and with a doubt.

    The last oracle also has to tell the push from a co-contraction that grows alike.
    """
    first, length = round(BEFORE / STEP), round(ATTEMPT / STEP)
    delays = []
    for sensors, side, push, torque in pushes('muscle_raw', joints, each, seed):
        plant, values = sensors.plant, sensors.plant.sample(torque)[:first + length]
        for j in range(joints):
            own = push[first:first + length, j, None]
            less = plant._antagonist[j]
            worlds = [_World(plant, j, own * shares) for shares in ((1, less), (less, 1), (1, 1))]
            evidence = np.array([world.evidence(values[:, j]) for world in worlds])
            one = evidence[:2].max(axis=0)
            pushed = one > EITHER
            delays.append([
                _after(worlds[int(side[j] < 0.0)].divergence > PER_HOUR),
                _after(pushed), _after(pushed & (one > evidence[2] + SURELY))])
    return np.array(delays).T


class _World:
    """Two channels whose muscles act from an onset on, for torques of shape (N, 2)."""

    def __init__(self, plant, j, torque):
        count = len(torque)
        # Of the filter's output for white noise: how values depend on each other.
        impulse = sosfilt(plant._band, np.eye(1, 2 * count)[0])
        alike = toeplitz(np.correlate(impulse, impulse, 'full')[2 * count - 1:][:count])
        sizes = torque * plant._gain[j] / plant._kept
        flexor, extensor = (np.outer(own, own) * alike for own in sizes.T)
        first, second = plant._cross_talk[j]
        # The channels' samples in turn, so that what has come by then stands first.
        covariance = np.empty((2 * count, 2 * count))
        covariance[::2, ::2] = flexor + first**2 * extensor
        covariance[1::2, 1::2] = extensor + second**2 * flexor
        covariance[::2, 1::2] = second * flexor + first * extensor
        covariance[1::2, ::2] = covariance[::2, 1::2].T
        self._rest = np.tile(plant._noise[j], count)
        covariance[np.diag_indices(2 * count)] += self._rest**2
        self._root = cholesky(covariance, lower=True)
        self._logs = np.log(np.diag(self._root) / self._rest)
        each = 0.5 * (np.diag(covariance) / self._rest**2 - 1.0) - self._logs
        self.divergence = np.cumsum(each)[2 * BLOCK - 1::2 * BLOCK]

    def evidence(self, values):
        """Return the log likelihood ratio of the likeliest onset, every 10 ms from the true one."""
        count = len(self._rest) // 2
        onsets = np.arange(0, len(values), BLOCK)
        padded = np.concatenate([values, np.zeros((count, 2))])
        windows = np.stack([padded[k:k + count].ravel() for k in onsets], axis=1)
        gains = 0.5 * ((windows / self._rest[:, None])**2
                       - solve_triangular(self._root, windows, lower=True)**2)
        ratios = np.cumsum(gains - self._logs[:, None], axis=0)[2 * BLOCK - 1::2 * BLOCK]
        # Row r of column c is the time of block c + r.
        best = np.full(len(onsets), -np.inf)
        for column, own in enumerate(ratios.T):
            rows = own[:len(onsets) - column]
            best[column:column + len(rows)] = np.maximum(best[column:column + len(rows)], rows)
        return best[-(count // BLOCK):]


def _after(decided):
    """Return the time in s of the first decision, NaN if there is none."""
    return (np.argmax(decided) + 1) * BLOCK * STEP if decided.any() else np.nan
