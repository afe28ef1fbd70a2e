# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Samples made ready for choosing effects: thinned, with a scene, divided into folds."""

from __future__ import annotations

import numpy as np

from friction_comp.drive import Drive
from friction_comp.refinement.fit.effect_sum import first_fit
from friction_comp.refinement.prepare.fit_data import (
    FINAL_ROWS,
    FitData,
    Measured,
    scene_of,
    thinned,
    with_transition,
)
from friction_comp.refinement.prepare.folds import runs_of, split
from friction_comp.samples import Samples


def prepare(samples: Samples, usable: np.ndarray, drive: Drive, slowest: float,
            load_coefficient: float = 0.0) -> FitData:
    """Return the `FitData` to choose effects on.

    Parameters
    ----------
    samples : Samples
        With velocity and acceleration.
    usable : ndarray of bool, shape (N,)
    drive : Drive
    slowest : float
        Speed of standstill, rad/s.
    load_coefficient : float
        A per N·m of load by which the motor is spared, 0 where that is to be found.
    """
    scene, runs = scene_of(samples, usable, drive, slowest), runs_of(samples)
    thin, fine, window, origin = thinned(samples, usable)
    plain = first_fit(Measured(thin, fine, window, scene), fine)
    folds = split(thin, fine, plain.residual, runs[origin])
    scene = with_transition(scene, 2.0 / plain.steepness, samples.sample_time)
    return FitData(thin, fine, window, scene, load_coefficient, folds=folds, origin=origin)


def finer(data: FitData, samples: Samples, usable: np.ndarray) -> Measured:
    """Return the samples that a `FitData` was made of, less thinned, for the last fit.

    Parameters
    ----------
    data : FitData
    samples, usable
        As for `prepare`.
    """
    thin, fine, window, _ = thinned(samples, usable, FINAL_ROWS)
    return Measured(thin, fine, window, data.scene, data.load_coefficient)


def fold_of_all(data: FitData, size: int) -> np.ndarray:
    """Return the fold of every original sample, shape (size,)."""
    place = np.searchsorted(data.origin, np.arange(size), side='right') - 1
    return data.fold[np.clip(place, 0, len(data.fold) - 1)]
