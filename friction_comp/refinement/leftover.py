# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the variables that the residual still depends on, whatever the shape of the dependence.

The range of a variable is cut into cells. Where the residual's mean differs between cells by more
than it does with the signs of long stretches flipped at random, it depends on the variable.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
from scipy import stats

from friction_comp.model.effects.base import segment_starts
from friction_comp.refinement import thresholds
from friction_comp.samples import Samples
from friction_comp.statistics import quantile_edges, robust_std

_FLIPS, _CHANCE = 1500, 0.001
# Errors beyond so many standard deviations are clipped.
_OUTLYING = 8.0
_SINGLE = {'velocity': 20, 'position': 16, 'acceleration': 12, 'time': 12, 'history': 12,
           'load': 12, 'temperature': 10}
_PAIRED = {'position': 12, 'velocity': 8, 'time': 12, 'acceleration': 6, 'load': 8,
           'temperature': 6}
# A pair of these variables is preferred unless another pair explains this many times as much.
_STATE, _OTHER_PAIR = frozenset(('position', 'velocity', 'load', 'temperature')), 1.5
_FEWEST_STRETCHES, _MOST_STRETCHES = 20, 400


@dataclass(frozen=True)
class Dependence:
    """A variable on which the residual depends."""

    variable: str
    strength: float  # share of the residual's variance that it explains, 0..1, beyond chance
    note: str


def leftover(samples: Samples, residual: np.ndarray, slowest: float) -> list[Dependence]:
    """Return the variables that a residual, shape (N,), still depends on, the strongest first.

    Each dependence is subtracted before the next is looked for, so that only variables that
    explain something of their own are named; then pairs of variables are tried. The samples are in
    motion, with velocity and acceleration, and may have gaps; `slowest` is the speed of standstill.
    """
    limit = _OUTLYING * float(robust_std(residual)) + 1e-300
    values = np.clip(residual, -limit, limit)
    values = values - values.mean()
    power = float(values @ values)
    signals = _signals(samples, slowest)
    side = (np.asarray(samples.velocity) > 0).astype(int)
    dependences: list[Dependence] = []
    if not power > 0.0:
        return dependences
    rng = np.random.default_rng(0)
    cells = {name: _cells(name, signals, side) for name in _SINGLE if name in signals}
    while cells:
        stretch = _stretches(values)
        share = float(values @ values) / power
        strength, name = max((depends(values, cell, stretch, rng), name)
                             for name, cell in cells.items())
        if strength * share < thresholds.LEAST_STRENGTH:
            break
        dependences.append(_entry(name, strength * share, values, name))
        cell = cells.pop(name)
        mean = np.bincount(cell, values) / np.maximum(np.bincount(cell), 1)
        values = values - mean[cell]
    share = float(values @ values) / power
    pair, strength = _strongest_pair(values, signals, side, rng)
    if strength * share > 2.0 * thresholds.LEAST_STRENGTH:
        known = {item.variable for item in dependences}
        dependences += [_entry(name, strength * share, values, ' and '.join(pair))
                        for name in pair if name not in known]
    dependences.sort(key=lambda item: -item.strength)
    return dependences + _inseparable(dependences, signals)


def depends(residual: np.ndarray, cells: np.ndarray, stretch: np.ndarray,
            rng: np.random.Generator) -> float:
    """Return the share of a residual's variance that cells explain; 0 where it may be chance.

    It is the share beyond the average with flipped signs. Stretches are longer than the residual's
    memory: without a dependence, the sign of the residual in one is independent of that in the
    next.
    """
    count, rows = int(cells.max()) + 1, int(stretch.max()) + 1
    table = np.bincount(stretch * count + cells, residual, minlength=rows * count)
    table = table.reshape(rows, count)
    weight = 1.0 / np.maximum(np.bincount(cells, minlength=count), 1)
    power = float(residual @ residual)
    explained = float(weight @ np.sum(table, axis=0) ** 2) / power
    signs = rng.integers(0, 2, size=(_FLIPS, rows)) * 2.0 - 1.0
    by_chance = (signs @ table) ** 2 @ weight / power
    if float(np.sum(by_chance >= explained)) + 1.0 > _CHANCE * (_FLIPS + 1.0):
        return 0.0
    # A strong dependence is in the flipped table, too, so that the strength is underestimated.
    expected = min(float(np.mean(by_chance)), 0.999)
    return (explained - expected) / (1.0 - expected)


def rank_correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Return the absolute rank correlation of two signals."""
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return 0.0
    return abs(float(stats.spearmanr(first, second).statistic))


def _signals(samples: Samples, slowest: float) -> dict[str, np.ndarray]:
    signals: dict[str, Any] = {name: getattr(samples, name) for name in (
        'velocity', 'position', 'acceleration', 'time', 'load', 'temperature')}
    velocity = np.asarray(samples.velocity)
    moving = np.where(np.abs(velocity) > slowest, np.sign(velocity), 0.0)
    start = segment_starts(samples) | (np.diff(moving, prepend=moving[:1]) != 0)
    first = np.maximum.accumulate(np.where(start, np.arange(len(samples)), 0))
    # Distance since the motion last changed direction or stood still.
    signals['history'] = np.abs(samples.position - samples.position[first])
    return {name: values for name, values in signals.items() if values is not None}


def _cells(name: str, signals: dict[str, np.ndarray], side: np.ndarray) -> np.ndarray:
    """Return the cell of each sample, directions apart so that signs do not cancel."""
    tails = (0.003, 0.01, 0.03) if name in ('velocity', 'acceleration') else ()
    cell = _ranges(signals[name], _SINGLE[name], tails)
    if name == 'velocity':
        return cell
    if name == 'position':
        # A ripple's phase changes with the speed.
        cell = 3 * cell + _ranges(np.abs(signals['velocity']), 3)
    return cell if name == 'acceleration' else 2 * cell + side


def _strongest_pair(values: np.ndarray, signals: dict[str, np.ndarray], side: np.ndarray,
                    rng: np.random.Generator) -> tuple[tuple[str, ...], float]:
    ranges = {name: _ranges(signals[name], count) for name, count in _PAIRED.items()
              if name in signals}
    stretch = _stretches(values)
    best: tuple[float, float, tuple[str, ...]] = (0.0, 0.0, ())
    for names in combinations(ranges, 2):
        cell = ranges[names[0]] * (int(ranges[names[1]].max()) + 1) + ranges[names[1]]
        if 'velocity' not in names:
            cell = 2 * cell + side
        cell = np.unique(cell, return_inverse=True)[1].reshape(-1)
        strength = depends(values, cell, stretch, rng)
        weighted = strength * (_OTHER_PAIR if _STATE.issuperset(names) else 1.0)
        best = max(best, (weighted, strength, names))
    return best[2], best[1]


def _inseparable(dependences: list[Dependence], signals: dict[str, np.ndarray]) -> list[Dependence]:
    """Return the variables that the recording cannot distinguish from those found."""
    known = {item.variable for item in dependences}
    recorded = {name: values for name, values in signals.items() if name != 'history'}
    inseparable = []
    for item, (name, values) in product(dependences, recorded.items()):
        if name not in known and item.variable in recorded and rank_correlation(
                values, recorded[item.variable]) > thresholds.INSEPARABLE:
            known.add(name)
            inseparable.append(Dependence(
                name, item.strength, f'{name} changed with {item.variable} throughout the '
                'recording, so that the error may depend on it instead'))
    return inseparable


def _stretches(values: np.ndarray) -> np.ndarray:
    """Return the stretch of each value; stretches are longer than the correlation time."""
    size = len(values)
    padded = 1 << (2 * size - 1).bit_length()
    correlation = np.fft.irfft(np.abs(np.fft.rfft(values, padded)) ** 2)[:max(2, size // 10)]
    below = np.nonzero(correlation < 0.2 * correlation[0])[0]
    memory = int(below[0]) if below.size else size // 10
    length = max(2 * memory, size // _MOST_STRETCHES)
    return np.arange(size) // max(2, min(length, size // _FEWEST_STRETCHES))


def _entry(name: str, strength: float, values: np.ndarray, words: str) -> Dependence:
    size = np.sqrt(max(strength, 0.0) * np.mean(values ** 2))
    return Dependence(name, strength, f'about {size:.2g} A RMS of the remaining error depend on '
                      f'{words}, in a way that no effect of the package describes')


def _ranges(values: np.ndarray, count: int, tails: tuple[float, ...] = ()) -> np.ndarray:
    return np.searchsorted(quantile_edges(values, count, tails), values, side='right')
