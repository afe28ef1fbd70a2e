# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""On what the remaining residual still depends, whatever the shape of the dependence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import itertools
from typing import Any, TYPE_CHECKING

import numpy as np
from scipy import stats

from friction_comp.model.effects.base import segment_starts
from friction_comp.refinement.fit.robust_regression import robust_scale
from friction_comp.refinement.prepare.correlation import stretch_length
from friction_comp.refinement.search.spectrum import position_spectrum
from friction_comp.series import lag1_autocorrelation, quantile_edges

if TYPE_CHECKING:
    from friction_comp.samples import Samples

_FLIPS = 1500
_CHANCE = 0.001
# Share of the residual's variance below which a dependence is not worth a word.
LEAST_STRENGTH = 0.02
# Accelerations are often short bursts between long constant speeds: ends of the range count too.
_TAILS = (0.003, 0.01, 0.03)
# Errors larger than so many times the usual one count as if they were of that size.
_OUTLYING = 8.0
# Variables that go together more closely than this by rank cannot be told apart.
_INSEPARABLE = 0.97
# Friction is a matter of the joint's state before all: two variables of it are named unless
# another pair explains so many times as much.
_STATE = frozenset(('position', 'velocity', 'load', 'temperature'))
_PLAIN = 1.5


@dataclass(frozen=True)
class ResidualDependence:
    """A variable on which the residual depends.

    Parameters
    ----------
    variable : str
    strength : float
        Share of the residual's variance that the variable explains, 0..1, beyond chance.
    note : str
    """

    variable: str
    strength: float
    note: str


def cells_of(samples: Samples, slowest: float) -> dict[str, np.ndarray]:
    """Return for each variable the cell that every sample falls into.

    A variable is cut into ranges that hold as many samples each; all but velocity and
    acceleration apart for the two directions of motion, so that what changes sign with the
    direction does not cancel.

    Returns
    -------
    dict of str to ndarray of int
    """
    side = (samples.velocity > 0).astype(int)
    speed = _ranges(np.abs(samples.velocity), 3)
    cells = {
        'velocity': _ranges(samples.velocity, 20, _TAILS),
        'position': _pair(_ranges(samples.position, 16), _pair(side, speed)),
        'acceleration': _ranges(samples.acceleration, 12, _TAILS),
        'time': _pair(_ranges(samples.time, 12), side),
        'history': _pair(_ranges(_way_since_reversal(samples, slowest), 12), side),
    }
    if samples.load is not None:
        cells['load'] = _pair(_ranges(samples.load, 12), side)
    if samples.temperature is not None:
        cells['temperature'] = _pair(_ranges(samples.temperature, 10), side)
    return cells


def test_dependence(residual: np.ndarray, cells: np.ndarray, stretch: np.ndarray,
                    rng: np.random.Generator) -> tuple[float, float]:
    """Test whether a residual's mean differs between cells.

    Parameters
    ----------
    residual : ndarray, shape (N,)
    cells : ndarray of int, shape (N,)
    stretch : ndarray of int, shape (N,)
        Stretches longer than the residual's memory. Without a dependence, the sign of the
        residual in one is independent of that in the next: the null flips them at random.
    rng : numpy.random.np.random.Generator

    Returns
    -------
    strength : float
        Share of variance explained, beyond what the null explains on average.
    p_value : float
    """
    number = int(cells.max()) + 1
    rows = int(stretch.max()) + 1
    table = np.bincount(stretch * number + cells, residual, minlength=rows * number)
    table = table.reshape(rows, number)
    count = np.bincount(cells, minlength=number)
    weight = 1.0 / np.maximum(count, 1)
    power = float(residual @ residual)
    real = float(weight @ np.sum(table, axis=0) ** 2) / power
    signs = rng.integers(0, 2, size=(_FLIPS, rows)) * 2.0 - 1.0
    null = (signs @ table) ** 2 @ weight / power
    # With a strong dependence the flipped table holds it still; the average is then too high, and
    # the strength on the careful side.
    expected = min(float(np.mean(null)), 0.999)
    return ((real - expected) / (1.0 - expected),
            (float(np.sum(null >= real)) + 1.0) / (_FLIPS + 1.0))


def unexplained(samples: Samples, usable: np.ndarray, residual: np.ndarray, slowest: float,
                least: float = 0.0) -> list[ResidualDependence]:
    """Return what the residual of usable samples still depends on, strongest first.

    Variables go together in most recordings. The strongest is taken out of the residual before
    the next is looked for, so that only those are named that add something of their own.

    Parameters
    ----------
    samples : Samples
    usable : ndarray of bool, shape (N,)
    residual : ndarray, shape (N,)
    slowest : float
        Speed of standstill, rad/s.
    least : float
        RMS in A below which a dependence is not worth a word.

    Returns
    -------
    list of ResidualDependence
    """
    values = residual[usable]
    limit = _OUTLYING * robust_scale(values)
    values = np.clip(values, -limit, limit)
    values = values - values.mean()
    # History needs the samples in between, so cells are cut on all samples.
    cells = {name: cell[usable] for name, cell in cells_of(samples, slowest).items()}
    power = float(values @ values)
    rng = np.random.default_rng(0)
    found: list[ResidualDependence] = []
    worth = LEAST_STRENGTH
    if power > 0:
        worth = max(worth, least ** 2 * len(values) / power)
    if power <= 0:
        return found
    while cells:
        stretch = _stretches(values)
        best = None
        share = float(values @ values) / power
        for name, cell in cells.items():
            strength, p_value = test_dependence(values, cell, stretch, rng)
            if p_value <= _CHANCE and strength * share > worth and (
                    best is None or strength > best[1]):
                best = (name, strength)
        if best is None:
            break
        name, strength = best
        found.append(ResidualDependence(name, strength * share, _note(name, strength, values)))
        values = _less_means(values, cells.pop(name))
    left, worth = float(values @ values) / power, max(worth, 2.0 * LEAST_STRENGTH)
    for more in (_of_two_variables(values, samples, usable, rng), _of_a_tone(
            values, samples.take(usable))):
        known = {item.variable for item in found}
        found += [replace(item, strength=item.strength * left) for item in more
                  if item.strength * left > worth and item.variable not in known]
    found.sort(key=lambda item: -item.strength)
    return found + _that_went_along(found, samples, usable)


def _of_two_variables(values: np.ndarray, samples: Samples, usable: np.ndarray,
                      rng: np.random.Generator) -> list[ResidualDependence]:
    pair = strongest_pair(values, samples, usable, rng)
    if pair is None:
        return []
    names, strength = pair
    return [ResidualDependence(name, strength, _note(' and '.join(names), strength, values))
            for name in names]


def _of_a_tone(values: np.ndarray, moving: Samples) -> list[ResidualDependence]:
    tone = strongest_tone(values, moving)
    if tone is None:
        return []
    frequency, share = tone
    return [ResidualDependence(
        'time', share, f'the remaining error swings {frequency:.3g} times a second, '
        'whatever the position; no effect known to the package does')]


def _that_went_along(found: list[ResidualDependence], samples: Samples,
                     usable: np.ndarray) -> list[Any]:
    """Return the variables that the recording cannot tell from those found."""
    known = {item.variable for item in found}
    more = []
    for item in found:
        for name in inseparable(item.variable, samples, usable):
            if name not in known:
                known.add(name)
                more.append(ResidualDependence(
                    name, item.strength, f'{name} went with {item.variable} all through the '
                    'recording, so that it may as well be this on which the error depends'))
    return more


def strongest_tone(values: np.ndarray, moving: Samples) -> tuple[float, float] | None:
    """Return frequency in Hz and share of variance of the strongest swing in time; None if none.

    A swing counts where it stands out of its neighbourhood in the spectrum, as the rising slope
    that correlated noise has does not.
    """
    k, tone = np.empty(0), np.empty(0)
    highest = 2.0 * np.pi * 0.3 / max(moving.sample_time, 1e-9)
    for number in np.unique(moving.recording):
        rows = moving.recording == number
        found = position_spectrum(moving.time[rows], values[rows], np.ones(int(rows.sum())),
                                  highest, periods=10.0)
        if len(found[0]) and (not len(k) or found[0].size > k.size):
            k, tone = found
            power = float(values[rows] @ values[rows])
    if not len(k) or power <= 0:
        return None
    peak = int(np.argmax(tone))
    near = tone[max(0, peak - 400):peak + 400]
    # Power of noise is spread like an exponential: 14 times its median by chance is one in 10,000.
    if tone[peak] < 30.0 * float(np.median(near)):
        return None
    return float(k[peak] / (2.0 * np.pi)), float(tone[peak]) / power


def fallback(values: np.ndarray, samples: Any, usable: Any, slowest: Any) -> ResidualDependence:
    """Return the variable that explains most of a residual that should be noise but is not.

    Parameters
    ----------
    values : ndarray, shape (N,)
        Residual of all samples.
    samples, usable, slowest
        As in `unexplained`.

    Returns
    -------
    ResidualDependence
    """
    part = values[usable]
    rng = np.random.default_rng(0)
    stretch = _stretches(part)
    best = ('history', 0.0)
    for name, cell in cells_of(samples, slowest).items():
        strength, _ = test_dependence(part - part.mean(), cell[usable], stretch, rng)
        if strength > best[1]:
            best = (name, strength)
    if best[1] < 0.5 * LEAST_STRENGTH:
        # Slow, and with nothing that was recorded: the past decides.
        best = ('history', max(0.0, lag1_autocorrelation(part - part.mean())))
    name, strength = best
    return ResidualDependence(
        name, strength, 'the remaining error is larger than noise from sample to sample and '
        f'changes slowly; of what was recorded it goes most with {name}')


def strongest_pair(values: np.ndarray, samples: Samples, usable: np.ndarray,
                   rng: np.random.Generator) -> tuple[tuple[str, str], float] | None:
    """Return the two variables whose joint cells explain most, and the strength; None if none.

    Parameters
    ----------
    values : ndarray, shape (M,)
        Residual of the usable samples.
    samples : Samples
    usable : ndarray of bool, shape (N,)
    rng : numpy.random.np.random.Generator
    """
    moving = samples.take(usable)
    ranges = {'position': _ranges(moving.position, 12), 'velocity': _ranges(moving.velocity, 8),
              'time': _ranges(moving.time, 12), 'acceleration': _ranges(moving.acceleration, 6)}
    if moving.load is not None:
        ranges['load'] = _ranges(moving.load, 8)
    if moving.temperature is not None:
        ranges['temperature'] = _ranges(moving.temperature, 6)
    side = (moving.velocity > 0).astype(int)
    stretch = _stretches(values)
    best, most = None, 0.0
    for names in itertools.combinations(ranges, 2):
        cell = _pair(*(ranges[name] for name in names))
        if 'velocity' not in names:
            cell = _pair(cell, side)
        cell = np.unique(cell, return_inverse=True)[1].reshape(-1)
        strength, p_value = test_dependence(values, cell, stretch, rng)
        worth = strength * (_PLAIN if _STATE.issuperset(names) else 1.0)
        if p_value <= _CHANCE and worth > most:
            best, most = (names, strength), worth
    return best


def inseparable(name: str, samples: Samples, usable: np.ndarray) -> list[str]:
    """Return the variables that went with another one all through the recording.

    Parameters
    ----------
    name : str
    samples : Samples
    usable : ndarray of bool, shape (N,)

    Returns
    -------
    list of str
        None where the variable named is not one that has a value of its own.
    """
    moving = samples.take(usable)
    signals = {'position': moving.position, 'velocity': moving.velocity, 'time': moving.time,
               'load': moving.load, 'temperature': moving.temperature}
    mine = signals.get(name)
    if mine is None:
        return []
    return [other for other, values in signals.items()
            if other != name and values is not None
            and rank_correlation(mine, values) > _INSEPARABLE]


def rank_correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Return the size of the rank correlation of two signals."""
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return 0.0
    return abs(float(stats.spearmanr(first, second).statistic))


def _stretches(values: np.ndarray) -> np.ndarray:
    """Return the number of the stretch of each value; stretches outlast the values' memory."""
    return np.arange(len(values)) // stretch_length(values, np.ones(len(values), dtype=bool))


def _less_means(values: np.ndarray, cell: np.ndarray) -> np.ndarray:
    mean = np.bincount(cell, values) / np.maximum(np.bincount(cell), 1)
    return values - mean[cell]


def _note(name: str, strength: float, values: np.ndarray) -> str:
    size = np.sqrt(max(strength, 0.0) * np.mean(values ** 2))
    return (f'about {size:.2g} A RMS of the remaining error go with {name}, and no effect known '
            'to the package describes how')


def _way_since_reversal(samples: Samples, slowest: float) -> np.ndarray:
    """Return the distance since the motion last changed direction or stood still, (N,)."""
    moving = np.where(np.abs(samples.velocity) > slowest, np.sign(samples.velocity), 0.0)
    start = segment_starts(samples) | (np.diff(moving, prepend=moving[:1]) != 0)
    first = np.maximum.accumulate(np.where(start, np.arange(len(samples)), 0))
    return np.abs(samples.position - samples.position[first])


def _ranges(values: np.ndarray, number: int, tails: Sequence[float] = ()) -> np.ndarray:
    return np.searchsorted(quantile_edges(values, number, tails), values, side='right')


def _pair(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return first * (int(second.max()) + 1) + second
