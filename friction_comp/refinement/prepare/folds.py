# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is held out: runs or stretches of samples in two folds, whatever file they are in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friction_comp.refinement.prepare.correlation import correlation_samples
from friction_comp.refinement.thresholds import RUN_GAP, RUN_STEPS
from friction_comp.samples import Samples

# A half that holds less than this share of the samples teaches too little.
_LEAST_HALF = 0.25
_FEWEST_STRETCHES, _MOST_STRETCHES = 24, 120
# A half that holds less than this share of the motion in one direction cannot tell Coulomb friction
# from an offset.
_LEAST_DIRECTION = 0.1


@dataclass(frozen=True)
class Folds:
    """How samples were divided.

    Parameters
    ----------
    run : ndarray of int, shape (N,)
        Number of the unbroken run each sample is from, in whatever file.
    fold : ndarray of int, shape (N,)
        0 or 1: each half is predicted by the model fitted on the other half.
    guard : ndarray of bool, shape (N,)
        Samples beside the edge of a stretch, which are not fitted.
    words : str
        The same for a reader.
    """

    run: np.ndarray
    fold: np.ndarray
    guard: np.ndarray
    words: str


def runs_of(samples: Samples) -> np.ndarray:
    """Return the number of the run that each sample is from, shape (N,).

    A run ends where a recording ends and where data are missing for a while, so that it makes no
    difference whether two runs are in one file or in two.
    """
    step = np.diff(samples.time)
    gap = max(float(RUN_GAP), RUN_STEPS * samples.sample_time)
    new = (step > gap) | (step < 0) | (np.diff(samples.recording) != 0)
    return np.concatenate(([0], np.cumsum(new)))


def split(samples: Samples, usable: np.ndarray, residual: np.ndarray, run: np.ndarray) -> Folds:
    """Deal samples to two folds.

    Whole runs are held out where there are several, else stretches several times as long as the
    residual stays correlated, in turn. Either way both halves hold motion in both directions, if
    there is a way to have it: strokes to and fro may be as long as the stretches are, or each be a
    run of its own.

    Parameters
    ----------
    samples : Samples
    usable : ndarray of bool, shape (N,)
    residual : ndarray, shape (N,)
        Of a plain model.
    run : ndarray of int, shape (N,)
    """
    fold = _whole_runs(samples, usable, run)
    last = '; standstill and clipped samples are left out'
    if fold is not None and _both_ways(samples, usable, fold):
        words = (f'{len(np.unique(run))} whole recordings (or runs with a gap between them) in two '
                 'halves, each half predicted by the model fitted on the other')
        return Folds(run, fold, np.zeros(len(samples), dtype=bool), words + last)
    step = max(samples.sample_time, 1e-9)
    total = int(usable.sum())
    length = correlation_samples(residual, usable)
    rows = max(int(np.clip(10 * length, total / _MOST_STRETCHES, total / _FEWEST_STRETCHES)), 4)
    # Counted in usable samples, so that rests do not make empty stretches; each run by itself.
    block = np.empty(len(samples), dtype=int)
    before = 0
    for number in np.unique(run):
        part = run == number
        count = np.cumsum(usable[part])
        pieces = max(int(count[-1]) // rows, 1)
        block[part] = before + np.minimum((count - 1).clip(0) // rows, pieces - 1)
        before += pieces
    guard = np.zeros(len(samples), dtype=bool)
    width = min(int(length), rows // 8)
    for place in np.nonzero(np.diff(block, prepend=block[:1]))[0]:
        guard[max(0, int(place) - width):int(place) + width] = True
    words = (f'{before} stretches of about {rows * step:.2g} s in turn, each half predicted by the '
             f'model fitted on the other half, with {2 * width * step:.2g} s beside every edge not '
             'fitted')
    fold = block % 2
    if not _both_ways(samples, usable, fold):
        uneven = _thue_morse(before)[block]
        if _both_ways(samples, usable, uneven):
            fold = uneven
    return Folds(run, fold, guard, words + last)


def _both_ways(samples: Samples, usable: np.ndarray, fold: np.ndarray) -> bool:
    """Tell whether both halves hold their part of either direction of motion."""
    forwards = np.asarray(samples.velocity)[usable] > 0.0
    first = fold[usable] == 0
    for side in (forwards, ~forwards):
        total = int(side.sum())
        least = min(int((side & first).sum()), int((side & ~first).sum()))
        if total > 0.02 * len(side) and least < _LEAST_DIRECTION * total:
            return False
    return True


def _thue_morse(number: int) -> np.ndarray:
    """Return zeros and ones in a sequence that is in step with nothing, shape (number,)."""
    bits = np.arange(number)
    total = np.zeros(number, dtype=int)
    while np.any(bits):
        total += bits & 1
        bits = bits >> 1
    return total % 2


def _whole_runs(samples: Samples, usable: np.ndarray, run: np.ndarray) -> np.ndarray | None:
    """Return folds of whole runs, larger ones placed first; None where halves are uneven."""
    numbers, sums, where = np.unique(run), [0, 0], {}
    if len(numbers) < 2:
        return None

    def content(number: int) -> tuple[int, float, float]:
        rows = np.nonzero(run == number)[0]
        return (-int(usable[rows].sum()), float(samples.position[rows[0]]),
                float(samples.current[rows[0]]))
    for number in sorted(numbers, key=content):
        side = int(sums[1] < sums[0])
        where[number] = side
        sums[side] += int((usable & (run == number)).sum())
    if min(sums) < _LEAST_HALF * sum(sums):
        return None
    return np.array([where[number] for number in run])
