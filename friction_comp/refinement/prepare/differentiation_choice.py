# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How velocity and acceleration are best derived: from which signal, at which bandwidth."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError
from friction_comp.huber import huber_weights
from friction_comp.model.differentiation import differentiate, earlier
from friction_comp.model.plain_drive import plain_drive_columns
from friction_comp.refinement.fit.robust_regression import robust_scale, solve
from friction_comp.refinement.judge.evidence import rms
from friction_comp.refinement.prepare import fit_data as recordings
from friction_comp.refinement.thresholds import AT_ODDS

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.samples import Samples

_MOST_SAMPLES = 150_000
_PIECES = 15
# Hz: low enough for any encoder, high enough for a person's movements.
_SMOOTH = 20.0
# Position and velocity are compared over windows of so many seconds.
_WINDOW, _FEWEST_WINDOWS = 0.25, 8


def excerpt(samples: Samples, *masks: Any) -> tuple[Any, ...]:
    """Return stretches from all over the samples, not too many, and the same of masks."""
    size = len(samples)
    if size <= _MOST_SAMPLES:
        return (samples, *masks)
    length = _MOST_SAMPLES // _PIECES
    starts = np.linspace(0, size - length, _PIECES).astype(int)
    keep = np.concatenate([np.arange(start, start + length) for start in starts])
    return (samples.take(keep), *(mask[keep] for mask in masks))


def choose_differentiation(samples: Samples, clipped: np.ndarray) -> dict[str, Any]:
    """Return the settings whose motion explains the current best, by a plain model."""
    samples, clipped = excerpt(samples, clipped)
    best = None
    thin = max(1, len(samples) // 20000)
    choices = recordings.bandwidths(samples)
    # What moves is told from a smooth velocity: unfiltered, an encoder's steps are standstill and
    # bursts.
    smooth = max((choice for choice in choices if (choice['bandwidth'] or np.inf) <= _SMOOTH),
                 key=lambda choice: (choice['bandwidth'], choice['source']), default=choices[-1])
    moving = differentiate(samples, smooth)
    speed = np.abs(moving.velocity)
    usable = (speed > 0.05 * np.percentile(speed, 95)) & ~clipped
    usable = recordings.without_few(usable, recordings.beside_gaps(samples, smooth))
    rows = np.nonzero(usable)[0][::thin]
    if len(rows) < 50:
        raise InputError('the joint hardly moves in the recordings: '
                         f'{len(rows)} samples of motion are too few')
    for settings in reversed(choices):
        part = differentiate(samples, settings).take(rows)
        top = float(np.percentile(np.abs(part.velocity), 95))
        if not top > 0.0:
            # Unfiltered, a coarse encoder stands still in nearly all samples.
            continue
        error = min(_motion_error(part, top / share) for share in (3.0, 10.0, 30.0, 100.0, 300.0))
        # Narrower than needed blunts reversals, so that a wider one wins when as good.
        if best is None or error < 0.995 * best[0]:
            best = (error, settings)
    return best[1] if best else smooth


def sharpest(model: FrictionModel, samples: Samples, rows: np.ndarray, settings: dict[str, Any],
             keep: np.ndarray | None = None) -> dict[str, Any]:
    """Return the settings by which a finished model predicts some samples best.

    Parameters
    ----------
    model : FrictionModel
    samples : Samples
        As recorded.
    rows : ndarray of bool, shape (N,)
        The samples that count.
    settings : dict
        The present settings, which are kept unless others are clearly better.
    keep : ndarray of bool, shape (N,), optional
        Samples on which others must not be worse.
    """
    samples, rows, keep = excerpt(samples, rows, rows if keep is None else keep)
    errors = []
    for choice in [settings, *recordings.bandwidths(samples)]:
        moving = differentiate(samples, choice)
        error = np.abs(samples.current - model.current(moving))
        limit = np.quantile(error[rows], 0.999)
        kept = rms(np.minimum(error[keep], limit))
        errors.append((rms(np.minimum(error[rows], limit)), kept, choice))
    present = errors[0]
    allowed = [entry for entry in errors if entry[1] <= 1.005 * present[1]]
    best = min(allowed, key=lambda entry: entry[0])
    return best[2] if best[0] < 0.97 * present[0] else settings


def velocity_against_position(samples: Samples) -> str | None:
    """Return a sentence where recorded velocity is not the slope of position, else None.

    Parameters
    ----------
    samples : Samples
        As recorded.
    """
    if samples.velocity is None:
        return None
    ways, integrals = [], []
    for part in samples.segments():
        length = max(2, round(_WINDOW / max(samples.sample_time, 1e-9)))
        edges = np.arange(part.start, part.stop, length)
        if len(edges) < 2:
            continue
        step = np.diff(samples.time[part], prepend=samples.time[part.start])
        travelled = np.concatenate(([0.0], np.cumsum(samples.velocity[part] * step)))[1:]
        ways.append(np.diff(samples.position[edges]))
        integrals.append(np.diff(travelled[edges - part.start]))
    if not ways:
        return None
    way, integral = np.concatenate(ways), np.concatenate(integrals)
    moving = np.abs(integral) > 0.1 * np.max(np.abs(integral), initial=0.0)
    if moving.sum() < _FEWEST_WINDOWS:
        return None
    ratio = float(np.median(way[moving] / integral[moving]))
    if abs(ratio - 1.0) < AT_ODDS:
        return None
    return (f'Position changes by {ratio:.3g} times what the recorded velocity says: scaling or '
            'clock of one of them is wrong. Acceleration, spatial frequencies and viscous friction '
            'are as uncertain.')


def lagging(samples: Samples, moving: np.ndarray) -> bool:
    """Tell whether current and motion are apart in time by more than two samples.

    A lag shows at reversals, next to standstill: where there is one, they must not be left out.

    Parameters
    ----------
    samples : Samples
        With velocity and acceleration.
    moving : ndarray of bool, shape (N,)
        Every sample that does not stand still.
    """
    samples, moving = excerpt(samples, moving)
    step = samples.sample_time
    longest = min(0.06, 0.02 * float(np.ptp(samples.time)))
    shifts = [0.0] + [side * value for value in np.geomspace(2.0 * step, longest, 8)
                      for side in (1.0, -1.0)] if longest > 2.0 * step else [0.0]
    rows = np.nonzero(moving)[0][::max(1, int(moving.sum()) // 15000)]
    top = float(np.percentile(np.abs(samples.velocity[moving]), 95))
    matrix = plain_drive_columns(
        samples.velocity, samples.acceleration, 0.01 * top, 0.05 * top)
    errors = []
    for shift in shifts:
        part = earlier(matrix, samples, shift)[rows]
        current = samples.current[rows]
        residual = np.abs(current - part @ solve(part, current, np.ones(len(rows))))
        errors.append(rms(np.minimum(residual, np.quantile(residual, 0.999))))
    return min(errors) < 0.97 * errors[0]


def _motion_error(part: Samples, transition: float) -> float:
    v = part.velocity
    columns = [plain_drive_columns(v, part.acceleration, transition), np.cos(part.position),
               np.sin(part.position)]
    if part.load is not None:
        # A load that is not in the model would drown what the bandwidth changes.
        columns += [part.load, np.abs(part.load) * np.tanh(v / transition)]
    matrix = np.column_stack(columns)
    weights = np.ones(len(v))
    for _ in range(3):
        residual = part.current - matrix @ solve(matrix, part.current, weights)
        weights = huber_weights(residual, 2.0 * robust_scale(residual))
    return rms(residual)
