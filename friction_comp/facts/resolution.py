# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Facts about the steps of an encoder."""

from __future__ import annotations

import math

import numpy as np

from friction_comp.drive import Drive

# rad; smaller changes of position are rounding.
_ROUNDING = 1e-9
# Largest change of position that is compared, in its steps; the least step that is reported, in
# counts; how exactly changes are whole numbers of steps, of how many, with which share of longer
# ones.
_MOST_STEPS, _SEVERAL, _EXACT, _FEWEST, _LONGER = 6.0, 5.0, 0.02, 20, 0.1


def positions(position: np.ndarray) -> float:
    """Return the number of positions that an encoder resolves, infinite if hardly any repeats."""
    values = np.unique(np.round(position / max(float(np.ptp(position)), 1e-300), 9))
    return math.inf if len(values) > 0.5 * len(position) else float(len(values))


def encoder_fault(drive: Drive, position: np.ndarray) -> str:
    """Return what is wrong with a drive's `encoder_counts` by a position, rad, (N,); or ''.

    Its changes are then one, two and more steps of several counts, and nothing in between. A
    constant velocity shows no steps.
    """
    known, changes = drive.position_resolution, np.abs(np.diff(position))
    changes = changes[changes > _ROUNDING]
    if known is None or not len(changes) or changes.min() < _SEVERAL * known:
        return ''
    step = float(changes.min())
    parts = changes[changes < _MOST_STEPS * step] / step
    whole = np.rint(parts)
    if (len(parts) < _FEWEST or np.abs(parts - whole).max() > _EXACT
            or np.mean(whole > 1.0) < _LONGER):
        return ''
    per_turn = 2.0 * math.pi / (step * drive.gear_ratio)
    return (f'the position changes in steps of {step:.3g} rad, {step / known:.3g} times that '
            f'of drive.encoder_counts, {drive.encoder_counts:g}: these seem to be about '
            f'{per_turn:.3g} per motor turn')
