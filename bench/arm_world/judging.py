# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Errors of refinement on recordings not fitted.

Errors are those of the joint's torque, noise included, as multiples of the noise: 1 is the least
that can be had. They are taken where the joint moves, since friction at rest depends on more than
a recording tells, and over both scores, of the same amplitude and of another.
"""

import time

import numpy as np

from arm_world.arms import rms
from arm_world.recording import case
from friction_comp.refinement import Origin, refine

STANDING = 0.04  # of the speed that 95 % of the samples to fit are below


def judge(seed):
    """Refine the case of a seed and say how well it does.

    Returns a dict: errors `start`, `refined` and `held_out` as multiples of the noise, `noise` in
    N·m, `seconds` of processor time that refinement took; `failed` instead of what refinement says
    where it ended with an error.
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
        'joints': drawn.arm.model.nv, 'noise': drawn.noise}
    score = [drawn.samples(recording) for recording in drawn.score]
    began = time.process_time()
    try:
        refined = refine([drawn.samples(recording) for recording in drawn.fit],
                         origin=Origin('N·m'))
        result['seconds'] = time.process_time() - began
        report = refined.report
        result.update(
            start=error([refined.start.predict(samples) for samples in score]),
            refined=error([refined.model.predict(samples) for samples in score]),
            held_out=report.after.held_out_rmse / drawn.noise, verdict=report.verdict,
            effects=[effect.name for effect in report.effects])
    except Exception as failure:  # counted and shown, so that one seed does not end the table
        result['failed'] = f'{type(failure).__name__}: {failure}'
        result.setdefault('seconds', time.process_time() - began)
    return result
