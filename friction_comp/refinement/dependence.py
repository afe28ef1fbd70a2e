# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the variables that the residual still depends on, whatever the shape of the dependence.

The range of a variable is divided into cells. The residual depends on the variable if its mean
differs between cells by more than it does when the signs of long blocks of consecutive samples are
flipped at random. A residual that changes as slowly as such blocks are long depends on time; with
what it changes, the recording is too short to tell.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools
from itertools import combinations
from typing import Any

import numpy as np

from friction_comp.model.effects.base import segment_starts
from friction_comp.refinement import thresholds
from friction_comp.samples import Samples
from friction_comp.statistics import quantile_edges, robust_std

_FLIPS, _FEW_FLIPS, _CHANCE = 1500, 50, 0.001
# Errors beyond so many standard deviations are clipped.
_OUTLYING = 8.0
_SINGLE = {'velocity': 20, 'position': 16, 'acceleration': 12, 'time': 12, 'history': 12,
           'load': 12, 'temperature': 10}
# Ranges of each of two variables.
_OF_PAIR = 8
_FEWEST_BLOCKS, _MOST_BLOCKS = 20, 400


@dataclass(frozen=True)
class Dependence:
    """A variable on which the residual depends."""

    variable: str
    strength: float  # share of the residual's variance that it explains, 0..1, beyond chance
    note: str


def remaining_dependences(samples: Samples, residual: np.ndarray, slowest: float
                          ) -> list[Dependence]:
    """Return the variables that a residual, shape (N,), still depends on, the strongest first.

    Each dependence is subtracted before the next is searched for, so that a variable is reported
    only if it explains a part that others do not; then pairs of variables are tried. The samples
    are in motion; `slowest` is the speed of standstill, rad/s.
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
    cells = {name: _cells(name, signals, side) for name in _SINGLE if name in signals}
    while cells:
        block, known_memory = _blocks(values)
        share = float(values @ values) / power
        strength, name = max((explained_share(values, cell, block), name)
                             for name, cell in cells.items())
        slow = not known_memory and 'time' in cells and (
            name == 'time' or strength * share < thresholds.LEAST_STRENGTH)
        if slow:
            # By chance, whatever varies as slowly explains it, so that its cause stays open; that
            # it is no noise does not.
            strength, name = share_of_means(values, cells['time']), 'time'
        if strength * share < thresholds.LEAST_STRENGTH:
            break
        dependences.append(_dependence(name, strength * share, values, name, slow))
        cell = cells.pop(name)
        mean = np.bincount(cell, values) / np.maximum(np.bincount(cell), 1)
        values = values - mean[cell]
    share = float(values @ values) / power
    pair, strength = _strongest_pair(values, signals, side)
    if strength * share > 2.0 * thresholds.LEAST_STRENGTH:
        known = {item.variable for item in dependences}
        dependences += [_dependence(name, strength * share, values, ' and '.join(pair))
                        for name in pair if name not in known]
    return sorted(dependences, key=lambda item: -item.strength)


@functools.lru_cache(maxsize=1)
def _signs(blocks: int) -> np.ndarray:
    """Return the signs of blocks in each of the random flips, shape (_FLIPS, B)."""
    return np.random.default_rng(0).integers(0, 2, size=(_FLIPS, blocks)) * 2.0 - 1.0


def explained_share(residual: np.ndarray, cells: np.ndarray, block: np.ndarray) -> float:
    """Return the share of a residual's variance that cells explain; 0 if it may be chance.

    `cells` and `block`, shape (N,), are the indices of each sample's cell and block. Blocks are
    longer than the correlation time, so that without a dependence their signs are independent.
    """
    count, rows = int(cells.max()) + 1, int(block.max()) + 1
    table = np.bincount(block * count + cells, residual, minlength=rows * count
                        ).reshape(rows, count)
    weight = 1.0 / np.maximum(np.bincount(cells, minlength=count), 1)
    power = float(residual @ residual)
    explained = float(weight @ np.sum(table, axis=0) ** 2) / power
    # What is due to chance shows in a few flips.
    for flips in (_FEW_FLIPS, _FLIPS):
        by_chance = (_signs(rows)[:flips] @ table) ** 2 @ weight / power
        if float(np.sum(by_chance >= explained)) + 1.0 > _CHANCE * (_FLIPS + 1.0):
            return 0.0
    # A strong dependence is in the flipped table, too, so that the strength is underestimated.
    expected = min(float(np.mean(by_chance)), 0.999)
    return (explained - expected) / (1.0 - expected)


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
    """Return the cell of each sample; directions have separate cells, or signs might cancel."""
    tails = (0.003, 0.01, 0.03) if name in ('velocity', 'acceleration') else ()
    cell = _ranges(signals[name], _SINGLE[name], tails)
    if name == 'velocity':
        return cell
    if name == 'position':
        # A ripple's phase changes with the speed.
        cell = 3 * cell + _ranges(np.abs(signals['velocity']), 3)
    return cell if name == 'acceleration' else 2 * cell + side


def _strongest_pair(values: np.ndarray, signals: dict[str, np.ndarray], side: np.ndarray
                    ) -> tuple[tuple[str, ...], float]:
    """Return the two variables that together explain most, and the share that they explain."""
    ranges = {name: _ranges(signals[name], _OF_PAIR) for name in _SINGLE
              if name in signals and name != 'history'}
    block, _ = _blocks(values)
    best: tuple[float, tuple[str, ...]] = (0.0, ())
    for names in combinations(ranges, 2):
        cell = 2 * (_OF_PAIR * ranges[names[0]] + ranges[names[1]]) + side
        cell = np.unique(cell, return_inverse=True)[1].reshape(-1)
        best = max(best, (explained_share(values, cell, block), names))
    return best[1], best[0]


def share_of_means(values: np.ndarray, cells: np.ndarray) -> float:
    """Return the share of a residual's power in the means of its cells."""
    total = np.bincount(cells, values)
    return float(total ** 2 @ (1.0 / np.maximum(np.bincount(cells), 1)) / (values @ values))


def _blocks(values: np.ndarray) -> tuple[np.ndarray, bool]:
    """Return the block of each value, shape (N,), and whether blocks outlast the correlation."""
    size = len(values)
    padded = 1 << (2 * size - 1).bit_length()
    correlation = np.fft.irfft(np.abs(np.fft.rfft(values, padded)) ** 2)[:max(2, size // 10)]
    below = np.nonzero(correlation < 0.2 * correlation[0])[0]
    memory = int(below[0]) if below.size else size // 10
    longest = size // _FEWEST_BLOCKS
    length = max(2 * memory, size // _MOST_BLOCKS)
    return np.arange(size) // max(2, min(length, longest)), memory <= longest


def _dependence(name: str, strength: float, values: np.ndarray, label: str, slow: bool = False
                ) -> Dependence:
    """Return the dependence on a variable; `label` names it, or a pair, in the note."""
    size = np.sqrt(max(strength, 0.0) * np.mean(values ** 2))
    how = ('change so slowly that the recording is too short to tell with what' if slow else
           f'depend on {label}, in a way that no effect of the package describes')
    return Dependence(name, strength, f'about {size:.2g} A RMS of the remaining error {how}')


def _ranges(values: np.ndarray, count: int, tails: tuple[float, ...] = ()) -> np.ndarray:
    return np.searchsorted(quantile_edges(values, count, tails), values, side='right')
