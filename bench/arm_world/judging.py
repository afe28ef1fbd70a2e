# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Errors of refinement, and of plain least squares beside it, on recordings not fitted.

Errors are those of the joint's torque, noise included, as multiples of the noise: 1 is the least
that can be had. They are taken where the joint moves, since friction at rest depends on more than
a recording tells, and over both scores, of the same amplitude and of another.
"""

from __future__ import annotations

import time

import numpy as np
from scipy.signal import butter, sosfiltfilt

from arm_world.arms import rms
from arm_world.recording import case
from friction_comp.refinement import refine

STANDING = 0.04  # of the speed that 95 % of the samples to fit are below
BANDWIDTHS = (2, 4, 8, 16, 32)  # Hz


def smooth(position, time, bandwidth):
    """Return position, velocity and acceleration by a filter without delay.

    Parameters
    ----------
    position : ndarray, shape (N,)
        rad.
    time : ndarray, shape (N,)
        Equidistant, s.
    bandwidth : float
        Hz.

    Returns
    -------
    position, velocity, acceleration : ndarray, shape (N,)
        rad, rad/s and rad/s².
    """
    rate = 1 / (time[1] - time[0])
    sections = butter(2, min(bandwidth, 0.45 * rate), fs=rate, output='sos')
    q = sosfiltfilt(sections, position)
    v = np.gradient(q, 1 / rate)
    return q, v, np.gradient(v, 1 / rate)


def least_squares(drawn, moving):
    """Predict the scores by Coulomb and viscous friction, inertia and weight of one link.

    Parameters
    ----------
    drawn : Case
    moving : list of ndarray of bool, shape (N,)
        Which samples of each recording to fit count.

    Returns
    -------
    list of ndarray, shape (N,)
        Torque in N·m for each score, at the bandwidth that leaves least of those to fit.
    """
    def regressor(recording, bandwidth):
        q, v, a = smooth(recording.encoder[:, drawn.joint], recording.time, bandwidth)
        return np.column_stack([np.sign(v), v, np.ones(len(q)), a, np.sin(q), np.cos(q)])

    chosen = np.concatenate(moving)
    torque = np.concatenate([recording.measured for recording in drawn.fit])[chosen]
    found = []
    for bandwidth in BANDWIDTHS:
        matrix = np.concatenate([regressor(r, bandwidth) for r in drawn.fit])[chosen]
        size = np.linalg.norm(matrix, axis=0) + 1e-9
        coefficients = np.linalg.lstsq(matrix / size, torque, rcond=1e-8)[0] / size
        found.append((rms(torque - matrix @ coefficients), bandwidth, coefficients))
    _, bandwidth, coefficients = min(found, key=lambda fit: fit[0])
    return [regressor(recording, bandwidth) @ coefficients for recording in drawn.score]


def judge(seed):
    """Refine the case of a seed and say how well it does.

    Parameters
    ----------
    seed : int

    Returns
    -------
    dict
        Errors `least_squares`, `start`, `refined` and `held_out` as multiples of the noise,
        `noise` in N·m, `seconds` of processor time that refinement took; `failed` instead of what
        refinement says where it ended with an error.
    """
    drawn = case(seed)

    def speed(recording):
        return np.abs(recording.motion.velocity[:, drawn.joint])

    lowest = STANDING * np.quantile(np.concatenate([speed(r) for r in drawn.fit]), 0.95)
    moving = [speed(recording) > lowest for recording in drawn.score]

    def error(predictions):
        left = [(recording.measured - prediction)[mask] for recording, prediction, mask
                in zip(drawn.score, predictions, moving)]
        return rms(np.concatenate(left)) / drawn.noise

    result = {
        'seed': seed, 'kind': drawn.kind, 'joint': drawn.joint + 1,
        'joints': drawn.arm.model.nv, 'noise': drawn.noise,
        'least_squares': error(least_squares(
            drawn, [speed(recording) > lowest for recording in drawn.fit]))}
    score = [drawn.samples(recording) for recording in drawn.score]
    began = time.process_time()
    try:
        refined = refine([drawn.samples(recording) for recording in drawn.fit], unit='N·m')
        result['seconds'] = time.process_time() - began
        report = refined.report
        result.update(
            start=error([refined.start.predict(samples) for samples in score]),
            refined=error([refined.model.predict(samples) for samples in score]),
            held_out=report['after']['held_out_rmse'] / drawn.noise, verdict=report['verdict'],
            effects=[effect['name'] for effect in report['effects']])
    except Exception as failure:  # counted and shown, so that one seed does not end the table
        result['failed'] = f'{type(failure).__name__}: {failure}'
        result.setdefault('seconds', time.process_time() - began)
    return result
