# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Fit of the kinetic friction curve, Eq. 6, to the look-up table by the L1 error of Eq. 7.

For a given steepness and shift of the transition, the curve is linear in the other parameters, and
reweighted least squares find those, and in the end linear programming. So only these two are
searched: on a grid with transitions around every point of the table, then closer and closer around
the best ones. No initial guess is needed.

If the transition is steeper than the table resolves, all transitions within a gap fit equally well.
The one returned is centred as near to zero as the error allows, and as gentle, but ends at the
lowest speed, or at 5 deg/s: friction below the table is that at its lowest speeds. Friction
reverses at rest: a centre beyond a quarter of the lowest speed needs more evidence than noise.
"""

from __future__ import annotations

import math

from numba import njit
import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, sparse

from friction_comp.errors import InputError
from friction_comp.model.sigmoid import Sigmoid

# Shares by which the error may increase: for a transition that is centred and gentle; and, of the
# largest current, for one that is centred within a quarter of the lowest speed. Means at constant
# velocity scatter by a tenth of that; where a table shows another centre, it has a point between,
# which is off by friction.
_TOLERANCE, _CENTRED = 3e-4, 0.1
# rad/s at which a transition that no speed resolves has ended (in drives, at 1 to 5 deg/s), and
# that end in units of one over the steepness.
_ENDS, _ENDED = math.radians(5.0), 2.0 * math.atanh(0.98)
# So few points leave the five parameters of Eq. 6 open: the transition is the usual one.
_FEW = 6
# Rounds of reweighting: enough to rank transitions and to agree with linear programming. Rounds of
# the closer search, each with steps of this share of those before.
_RANK, _CLOSE, _ROUNDS, _CLOSER = 12, 45, 14, 0.6
_STEPS = np.array([(a, b) for a in (-1.0, -0.5, 0.0, 0.5, 1.0) for b in (-1.0, -0.5, 0.0, 0.5, 1.0)
                   ])


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
    steepness, shift = _well_behaved(x, y, *_search(x, y), _ENDS / unit)
    middle, half, viscous = _exact(x, y, steepness, shift) * height
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
    best, kept = np.full(len(steepness), np.inf), np.zeros((len(steepness), 3))
    shifts = np.ascontiguousarray(np.broadcast_to(shift, len(steepness)), dtype=float)
    _reweight(np.ascontiguousarray(x), np.ascontiguousarray(y), np.ascontiguousarray(steepness),
              shifts, rounds, best, kept)
    return best, kept


@njit(cache=True)
def _reweight(x: np.ndarray, y: np.ndarray, steepness: np.ndarray, shift: np.ndarray, rounds: int,
              best: np.ndarray, kept: np.ndarray) -> None:
    """Write the L1 errors and coefficients of `_fit` into `best` and `kept`."""
    count = len(x)
    # Outside the transition, the second column is constant like the first. Rounding grows with N.
    ridge = 1e-13 * max(1.0, count / 100.0)
    share, rest, weights = np.empty(count), np.empty(count), np.empty(count)
    for g in range(len(steepness)):
        weights[:] = 1.0
        for i in range(count):
            share[i] = math.tanh(0.5 * steepness[g] * (x[i] - shift[g]))
        for k in range(rounds):
            # Sums of products of the columns 1, share and speed, and of the current.
            s, sa, sx, saa, sax, sxx, sy, say, sxy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(count):
                w, wa, wx = weights[i], weights[i] * share[i], weights[i] * x[i]
                s, sa, sx, sy = s + w, sa + wa, sx + wx, sy + w * y[i]
                saa, sax, say = saa + wa * share[i], sax + wa * x[i], say + wa * y[i]
                sxx, sxy = sxx + wx * x[i], sxy + wx * y[i]
            # Cholesky's decomposition of the normal equations, and both substitutions.
            a = math.sqrt(s + ridge)
            b, c = sa / a, sx / a
            d = math.sqrt(max(saa - b * b, 0.0) + ridge)
            e = (sax - b * c) / d
            f = math.sqrt(max(sxx - c * c - e * e, 0.0) + ridge)
            middle = sy / a
            half = (say - b * middle) / d
            viscous = (sxy - c * middle - e * half) / f / f
            half = (half - e * viscous) / d
            middle = (middle - b * half - c * viscous) / a
            error = 0.0
            for i in range(count):
                rest[i] = abs(y[i] - middle - half * share[i] - viscous * x[i])
                error += rest[i]
            if error < best[g]:
                best[g] = error
                kept[g, 0], kept[g, 1], kept[g, 2] = middle, half, viscous
            least = 10.0 ** (-1.0 - 10.0 * k / _CLOSE)
            smallest = max(least, rest.min())
            for i in range(count):
                weights[i] = smallest / max(rest[i], least)


def _exact(x: np.ndarray, y: np.ndarray, steepness: float, shift: float) -> np.ndarray:
    """Return the coefficients with the smallest L1 error for a transition: linear programming."""
    columns = np.column_stack([np.ones_like(x), np.tanh(0.5 * steepness * (x - shift)), x])
    beside = sparse.eye(len(x))
    return np.asarray(optimize.linprog(
        np.concatenate([np.zeros(3), np.ones(2 * len(x))]),
        A_eq=sparse.hstack([columns, beside, -beside]), b_eq=y,
        bounds=[(None, None)] * 3 + [(0, None)] * (2 * len(x))).x[:3])


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
    errors = _fit(x, y, np.tile(steepness, len(shift)), shift.ravel(), _RANK)[0]
    order = np.argsort(errors.reshape(shift.shape), axis=0)[:2]
    now = np.column_stack([np.tile(steepness, 2), np.take_along_axis(shift, order, 0).ravel()])
    reach = 1.0
    for _ in range(_ROUNDS):
        trial = np.stack([
            np.clip(now[:, :1] * np.exp(reach * _STEPS[:, 0]), 0.5, steepest),
            np.clip(now[:, 1:] + reach * _STEPS[:, 1] / now[:, :1], -1.0, 1.0)], axis=2)
        tried = _fit(x, y, trial[..., 0].ravel(), trial[..., 1].ravel(), _CLOSE)[0].reshape(
            trial.shape[:2])
        best = np.argmin(tried, axis=1)
        # Half of the starts are continued, until a few are left.
        few = np.argsort(tried.min(axis=1))[:max(6, len(now) // 2)]
        now = trial[few, best[few]]
        reach *= _CLOSER

    def at(point: np.ndarray) -> float:
        k = np.clip(now[:1, 0] * np.exp(point[0]), 0.5, steepest)
        return float(_fit(x, y, k, now[0, 1] + point[1] / k, _CLOSE)[0][0])
    # Along a valley, finer than the rounds.
    moved = optimize.minimize(at, np.zeros(2), method='Nelder-Mead', options={
        'fatol': 1e-12, 'initial_simplex': 0.1 * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])}).x
    best = float(np.clip(now[0, 0] * np.exp(moved[0]), 0.5, steepest))
    return best, float(now[0, 1] + moved[1] / best)


def _well_behaved(x: np.ndarray, y: np.ndarray, steepness: float, shift: float, ends: float
                  ) -> tuple[float, float]:
    """Return a centred and gentle transition among those that fit equally well.

    One that has ended at the lowest speed, or at `ends`, comes first. A falling viscous term must
    not make up for a gentler one: it has a lower bound.
    """
    (error,), (best,) = _fit(x, y, np.array([steepness]), shift, _CLOSE)
    lowest = float(np.min(np.abs(x[x != 0.0])))
    limit, ended = 0.25 * lowest, _ENDED / min(lowest, ends)
    gentler = np.geomspace(0.5, max(4.0 * steepness, 2.0 * ended), 120)
    first = np.argsort(gentler < ended, kind='stable')

    def errors_at(centre: float) -> np.ndarray:
        errors, coefficients = _fit(x, y, gentler, centre, _CLOSE)
        return np.where(coefficients[:, 2] >= min(best[2], 0.0) - 1e-9, errors, math.inf)
    if abs(shift) > limit or x.size <= _FEW:
        for centre in np.linspace(0.0, math.copysign(limit, shift), 6).tolist():
            errors = errors_at(centre)
            least = float(errors[gentler >= ended].min() if x.size <= _FEW else errors.min())
            if least <= error + _CENTRED:
                error, shift = least, centre
                break
    bound = error * (1.0 + _TOLERANCE) + 1e-9 * x.size
    for centre in dict.fromkeys((shift * np.concatenate(([0.0], np.geomspace(1e-3, 1.0, 24)))
                                 ).tolist()):
        alike = errors_at(centre) <= bound
        if alike.any():
            return float(gentler[first[np.argmax(alike[first])]]), centre
    return steepness, shift
