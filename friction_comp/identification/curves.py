# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Fits friction curves to tables of speeds and mean currents.

**Eq. 6** is fitted to an identification's look-up table by the L1 error of Eq. 7. For a given
steepness and shift of the transition it is linear in the rest, which reweighted least squares find:
only these two are searched. A transition that the table does not resolve is centred as near to zero
as the error allows, and as gentle, but ends at the lowest speed, or at 5 deg/s. Friction reverses
at rest: a centre beyond a quarter of the lowest speed needs more evidence than noise.

**A table of steady states** gets offset, Coulomb and viscous friction, and what lowers Akaike's
criterion for small samples (Hurvich and Tsai 1989): viscous friction that differs between the
directions, and Stribeck friction. Intervals are Student's, from the scatter about the curve.
"""

from __future__ import annotations

from dataclasses import dataclass
import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.statistics import rms, student_quantile

# So few points leave the transition open. Rounds of reweighting, to compare the best ones.
_FEW, _CLOSE = 6, 30
_STEPS = np.array(list(itertools.product((0.0, -1.0, 1.0), repeat=2)))

# Eq. 6.

def fit_sigmoid(speeds: ArrayLike, currents: ArrayLike) -> tuple[Sigmoid, float]:
    """Fit the sigmoid of Eq. 6 to a look-up table; return it and its minimal E of Eq. 7 in A.

    Speeds in rad/s and mean currents in A, shape (N,), in any order. Raises InputError if the table
    has fewer than two speeds of each sign, or is not finite.
    """
    speeds, currents = np.asarray(speeds, dtype=float), np.asarray(currents, dtype=float)
    if speeds.ndim != 1 or speeds.shape != currents.shape:
        raise InputError(f'look-up table: speeds and currents must have the same length, not '
                         f'{speeds.shape} and {currents.shape}')
    if not (np.all(np.isfinite(speeds)) and np.all(np.isfinite(currents))):
        raise InputError('look-up table: speeds and currents must be finite')
    values = np.unique(speeds)
    if np.sum(values > 0.0) < 2 or np.sum(values < 0.0) < 2:
        raise InputError('look-up table: at least two speeds of each sign are needed')

    unit = float(np.max(np.abs(speeds)))
    height = float(np.max(np.abs(currents))) or 1.0
    x, y = speeds / unit, currents / height
    steepness, shift = _well_behaved(x, y, *_search(x, y), math.radians(5.0) / unit)
    middle, half, viscous = _fit(x, y, np.array([steepness]), shift, 2 * _CLOSE)[1][0] * height
    sigmoid = Sigmoid(upper=float(middle + half), lower=float(middle - half),
                      steepness=steepness / unit, shift=shift * unit, viscous=float(viscous / unit))
    return sigmoid, sigmoid_error(sigmoid, speeds, currents)


def sigmoid_error(sigmoid: Sigmoid, speeds: ArrayLike, currents: ArrayLike) -> float:
    """Return E of Eq. 7 in A: the sum of absolute deviations over the look-up table."""
    return float(np.sum(np.abs(np.asarray(currents) - sigmoid(speeds))))


def _fit(x: np.ndarray, y: np.ndarray, steepness: np.ndarray, shift: ArrayLike, rounds: int
         ) -> tuple[np.ndarray, np.ndarray]:
    """Return L1 error, (G,), and coefficients, (G, 3), of transitions: reweighted least squares.

    The columns are 1, tanh of half the steepness times the distance from the shift, and x.
    """
    share = np.tanh(0.5 * steepness[:, None] * (x - np.asarray(shift).reshape(-1, 1)))
    columns = np.stack([np.ones_like(share), share, np.broadcast_to(x, share.shape)], axis=1)
    # Outside the transition, the second column is constant like the first. Rounding grows with N.
    ridge = 1e-13 * max(1.0, len(x) / 100.0) * np.eye(3)
    weights = np.ones_like(share)
    best, kept = np.full(len(share), np.inf), np.zeros((len(share), 3))
    for k in range(rounds):
        weighted = columns * weights[:, None]
        found = np.linalg.solve(
            weighted @ columns.transpose(0, 2, 1) + ridge, (weighted @ y)[..., None])[..., 0]
        rest = np.abs(y - (found[:, None] @ columns)[:, 0])
        better = (error := rest.sum(axis=1)) < best
        best[better], kept[better] = error[better], found[better]
        least = max(10.0 ** (-1.0 - 10.0 * k / _CLOSE), 1e-12)
        weights = np.maximum(least, rest.min(axis=1, keepdims=True)) / np.maximum(rest, least)
    return best, kept


def _search(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return steepness and shift with the smallest error; speeds are scaled to [-1, 1]."""
    values = np.unique(x)
    steepest = 40.0 / float(np.min(np.diff(values)))
    steepness = np.geomspace(0.5, steepest, 24)
    # Steep transitions only differ near a point.
    beside = values[:, None] + np.array([-5.0, -2.0, -0.6, 0.6, 2.0, 5.0])[:, None, None] / (
        steepness)
    shift = np.concatenate([beside.reshape(-1, len(steepness)),
                            np.repeat(np.linspace(-1.0, 1.0, 41)[:, None], len(steepness), axis=1)])
    shift = np.clip(shift, -1.0, 1.0)
    errors = _fit(x, y, np.tile(steepness, len(shift)), shift.ravel(), 8)[0]
    order = np.argsort(errors.reshape(shift.shape), axis=0)[:2]
    now = np.column_stack([np.tile(steepness, 2), np.take_along_axis(shift, order, 0).ravel()])
    reach = np.ones((len(now), 1))
    # A closer search, whose steps are halved where none is better.
    for _ in range(40):
        trial = np.stack([
            np.clip(now[:, :1] * np.exp(reach * _STEPS[:, 0]), 0.5, steepest),
            np.clip(now[:, 1:] + reach * _STEPS[:, 1] / now[:, :1], -1.0, 1.0)], axis=2)
        tried = _fit(x, y, trial[..., 0].ravel(), trial[..., 1].ravel(), _CLOSE)[0].reshape(
            trial.shape[:2])
        best = np.argmin(tried, axis=1)
        reach[best == 0] *= 0.5
        # Half of the starts are continued, until a few are left.
        few = np.argsort(tried.min(axis=1))[:max(6, len(now) // 2)]
        now, reach = trial[few, best[few]], reach[few]
    return float(now[0, 0]), float(now[0, 1])


def _well_behaved(x: np.ndarray, y: np.ndarray, steepness: float, shift: float, ends: float
                  ) -> tuple[float, float]:
    """Return a centred and gentle transition among those that fit equally well.

    One that has ended at the lowest speed, or at `ends`, comes first. A falling viscous term must
    not make up for a gentler one: it has a lower bound.
    """
    (error,), (best,) = _fit(x, y, np.array([steepness]), shift, _CLOSE)
    lowest = float(np.min(np.abs(x[x != 0.0])))
    # In drives, transitions end at 1 to 5 deg/s.
    limit, ended = 0.25 * lowest, 2.0 * math.atanh(0.98) / min(lowest, ends)
    gentler = np.geomspace(0.5, max(4.0 * steepness, 2.0 * ended), 120)
    first = np.argsort(gentler < ended, kind='stable')

    def errors_at(centre: float) -> np.ndarray:
        errors, coefficients = _fit(x, y, gentler, centre, _CLOSE)
        return np.where(coefficients[:, 2] >= min(best[2], 0.0) - 1e-9, errors, math.inf)
    if abs(shift) > limit or x.size <= _FEW:
        for centre in np.linspace(0.0, math.copysign(limit, shift), 6).tolist():
            errors = errors_at(centre)
            least = float(errors[gentler >= ended].min() if x.size <= _FEW else errors.min())
            # Of the largest current: means at constant velocity scatter by a tenth of that, and a
            # table that shows another centre has a point between, which is off by friction.
            if least <= error + 0.1:
                error, shift = least, centre
                break
    bound = error * (1.0 + 3e-4) + 1e-9 * x.size
    for centre in dict.fromkeys((shift * np.concatenate(([0.0], np.geomspace(1e-3, 1.0, 24)))
                                 ).tolist()):
        alike = errors_at(centre) <= bound
        if alike.any():
            return float(gentler[first[np.argmax(alike[first])]]), centre
    return steepness, shift


# Steady states.

@dataclass(frozen=True)
class SteadyStates:
    """Friction over speed, from a table; currents in A, speeds in rad/s."""

    speeds: np.ndarray
    currents: np.ndarray
    values: dict[str, float]    # offset (absent in one direction), coulomb, viscous, …
    intervals: dict[str, tuple[float, float]]   # 95 %
    model: FrictionModel
    fit_rmse: float
    left_out_rmse: float    # each row predicted by a fit to all others
    plain_rmse: float       # the same of Coulomb and viscous friction alone
    is_curved: bool         # whether errors of neighbouring speeds are alike


def fit_steady_states(speeds: np.ndarray, currents: np.ndarray, drive: Drive) -> SteadyStates:
    """Fit friction to mean currents in A at constant speeds in rad/s, shape (N,).

    Raises InputError if there are too few rows.
    """
    used = np.isfinite(speeds) & np.isfinite(currents) & (speeds != 0.0)
    order = np.argsort(speeds[used], kind='stable')
    speeds, currents = speeds[used][order], currents[used][order]
    if len(speeds) < 5 or len(np.unique(np.abs(speeds))) < 2:
        raise InputError('a table of steady states needs at least 5 rows with two speeds, not '
                         f'{len(speeds)}')
    if not currents.any():
        raise InputError('all efforts are zero: there is no friction to fit')
    both = bool((speeds > 0.0).any() and (speeds < 0.0).any())
    plain = {'coulomb': np.sign(speeds), 'viscous': speeds}
    plain |= {'offset': np.ones_like(speeds)} if both else {}
    skewed = {**plain, 'viscous_asymmetry': np.abs(speeds)}
    fits = [_fit_terms(speeds, currents, terms, power)
            for terms in ((plain, skewed) if both else (plain,)) for power in (0.0, 1.0, 2.0)]
    best = min(fits, key=lambda fit: fit.criterion)
    # Whether the errors of neighbouring speeds are more alike than chance makes them.
    alike = np.concatenate([side[1:] * side[:-1] for side in (
        best.residual[speeds > 0.0], best.residual[speeds < 0.0])])
    squares = float(np.mean(best.residual ** 2))
    return SteadyStates(
        speeds=speeds, currents=currents, values=best.values, intervals={
            name: (value - half, value + half)
            for (name, value), half in zip(best.values.items(), best.halves)},
        model=_model_of(best.values, best.power, speeds, currents, drive),
        fit_rmse=rms(best.residual), left_out_rmse=best.left_out, plain_rmse=fits[0].left_out,
        is_curved=len(alike) >= 6 and squares > (0.01 * rms(currents)) ** 2 and bool(
            np.mean(alike) > 2.0 * squares / math.sqrt(len(alike))))


class _Fit(NamedTuple):
    criterion: float        # Akaike's for small samples
    values: dict[str, float]
    halves: list[float]     # of the values' 95 % intervals
    power: float            # of Stribeck friction's exponent; 0: none
    residual: np.ndarray
    left_out: float         # RMS error of each row, predicted by a fit to the others


def _fit_terms(speeds: np.ndarray, currents: np.ndarray, terms: dict[str, np.ndarray],
               power: float) -> _Fit:
    """Fit terms, (N,) each, and Stribeck friction that fades as exp(-|v / speed|^power)."""
    size, names, design = np.abs(speeds), list(terms), np.column_stack(list(terms.values()))

    def with_stribeck(fading: float) -> np.ndarray:
        return np.column_stack((*terms.values(), np.sign(speeds) * np.exp(
            -(size / fading) ** power)))

    def error(fading: float) -> float:
        tried = with_stribeck(fading)
        return rms(currents - tried @ np.linalg.lstsq(tried, currents, rcond=None)[0])
    if power:
        # As in the effect: from below the slowest to two thirds of the top speed.
        grid = np.geomspace(0.5 * size.min(), 0.7 * size.max(), 60)
        k = int(np.clip(np.argmin([error(one) for one in grid]), 1, len(grid) - 2))
        fading = float(optimize.minimize_scalar(
            error, bounds=(grid[k - 1], grid[k + 1]), method='bounded').x)
        names, design = [*names, 'stribeck', 'stribeck_speed'], with_stribeck(fading)
    found = np.linalg.lstsq(design, currents, rcond=None)[0]
    residual = currents - design @ found
    if power:
        slope = (with_stribeck(1.0001 * fading) - design)[:, -1] / (1e-4 * fading)
        design, found = np.column_stack((design, found[-1] * slope)), np.append(found, fading)
    count, free = design.shape
    inverse, values = np.linalg.pinv(design), dict(zip(names, found.tolist()))
    # One more parameter is the scatter, which is at least rounding.
    spare, criterion, squares = count - free - 2, math.inf, float(residual @ residual)
    if spare > 0 and values.get('stribeck', 1.0) > 0.0:
        criterion = 2.0 * (free + 1) * count / spare + count * math.log(
            max(squares / count, (1e-9 * float(np.max(np.abs(currents)))) ** 2))
    spread = np.sqrt(squares / max(count - free, 1) * np.diag(inverse @ inverse.T))
    halves = (student_quantile(max(count - free, 1)) * spread).tolist()
    return _Fit(criterion, values, halves, power, residual, rms(
        residual / np.maximum(1.0 - np.diag(design @ inverse), 1e-6)))


def _model_of(value: dict[str, float], power: float, speeds: np.ndarray, currents: np.ndarray,
              drive: Drive) -> FrictionModel:
    """Return a curve as a model with the table in it."""
    # The sign changes within a fifth of the slowest speed.
    steepness = 10.0 / float(np.min(np.abs(speeds)))
    offset, coulomb = value.get('offset', 0.0), value['coulomb']
    forms: dict[str, dict[str, Any]] = {
        'stribeck': {'velocity': value.get('stribeck_speed'), 'exponent': power,
                     'coefficients': [value.get('stribeck')]},
        'direction_asymmetry': {
            'offset': 1.0, 'coefficients': [0.0, value.get('viscous_asymmetry')]}}
    effects = [EFFECTS[name]({**own, 'transition': 2.0 / steepness})
               for name, own in forms.items() if None not in own['coefficients']]
    means = {float(speed): currents[speeds == speed] for speed in np.unique(speeds)}
    return FrictionModel(
        drive, Sigmoid(offset + coulomb, offset - coulomb, steepness, 0.0, value['viscous']),
        effects=effects, lookup_table={
            'speeds': list(means),
            'currents': [float(np.mean(one)) for one in means.values()],
            'standard_deviations': [float(np.std(one)) for one in means.values()]})
