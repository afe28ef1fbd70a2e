# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Fit of the kinetic friction curve, Eq. 6, to the look-up table by the L1 error of Eq. 7.

For a given steepness and shift of the transition the curve is linear in what remains, and that
L1 problem is solved exactly. So the search is over two numbers only: a coarse grid that places a
transition in every gap of the table, then a descent from the best places. No start is needed.

Where the transition is steeper than the table resolves, every transition inside a gap fits
alike; the one returned is centred as near to zero as the error allows, and no steeper than the
data show.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from numba import njit
import numpy as np

from friction_comp.errors import InputError
from friction_comp.identification.least_absolute import independent_rows, least_absolute
from friction_comp.model.sigmoid import Sigmoid

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

TOLERANCE = 3e-4
"""Share by which the error may rise for the sake of a well-behaved transition."""

_STARTS = 20
# Distances between table points and trial transitions, in units of one over the steepness. At
# eight a transition hardly reaches the point any more, but it still shifts its residual.
_CLOSE = (-8.0, -5.5, -3.5, -1.8, -0.6, 0.6, 1.8, 3.5, 5.5, 8.0)
_FAR = (-1.5, 1.5)


@njit(cache=True)
def _fill(speeds: np.ndarray, steepness: float, shift: float, design: np.ndarray) -> None:
    """Fill the columns 1, share, speed; the share is scaled about its own middle."""
    for i in range(speeds.size):
        argument = 0.5 * steepness * (speeds[i] - shift)
        design[i, 0] = 1.0
        design[i, 1] = math.tanh(argument)
        design[i, 2] = speeds[i]


@njit(cache=True)
def _error(speeds: np.ndarray, currents: np.ndarray, steepness: float, shift: float,
           basis: np.ndarray, coefficients: np.ndarray) -> float:
    """E of Eq. 7 at a given transition, the linear coefficients being the best ones."""
    design = np.empty((speeds.size, 3))
    _fill(speeds, steepness, shift, design)
    return least_absolute(design, currents, basis, coefficients)


@njit(cache=True)
def _descend(speeds: np.ndarray, currents: np.ndarray, transition: np.ndarray, steepest: float,
             gentlest: float, rounds: int) -> float:
    """Improve (steepness, shift) in place: linearised L1 steps, then a shrinking search."""
    basis, coefficients = np.arange(3), np.empty(3)
    design = np.empty((speeds.size, 3))
    _fill(speeds, transition[0], transition[1], design)
    independent_rows(design, basis)
    error = _error(speeds, currents, transition[0], transition[1], basis, coefficients)
    basis_full = np.arange(5)
    reach = 0.5
    for _ in range(rounds):
        before = error
        error = _linearised_step(speeds, currents, transition, steepest, gentlest, error, basis,
                                 coefficients, basis_full)
        if error >= 0.998 * before:
            error = _look_around(speeds, currents, transition, steepest, gentlest, error, basis,
                                 coefficients, reach)
            if error >= before:
                reach *= 0.4
                if reach < 2e-4:
                    break
        error = _error(speeds, currents, transition[0], transition[1], basis, coefficients)
    return error


@njit(cache=True)
def _linearised_step(speeds: np.ndarray, currents: np.ndarray, transition: np.ndarray,
                     steepest: float, gentlest: float, error: float, basis: np.ndarray,
                     coefficients: np.ndarray, basis_full: np.ndarray) -> float:
    """Move the transition in place to where the linearised problem has it, if that is better."""
    count = speeds.size
    if count <= 5:
        return error
    steepness, shift = transition[0], transition[1]
    full, residual, step = np.empty((count, 5)), np.empty(count), np.empty(5)
    for i in range(count):
        share = math.tanh(0.5 * steepness * (speeds[i] - shift))
        bend = 0.5 * coefficients[1] * (1.0 - share * share)
        full[i, 0] = 1.0
        full[i, 1] = share
        full[i, 2] = speeds[i]
        full[i, 3] = bend * steepness * (speeds[i] - shift)
        full[i, 4] = -bend
        residual[i] = (currents[i] - coefficients[0] - coefficients[1] * share
                       - coefficients[2] * speeds[i])
    regular = independent_rows(full, basis_full) == 5
    if not regular or least_absolute(full, residual, basis_full, step) >= error:
        return error
    span = speeds.max() - speeds.min()
    scale = min(1.0, 1.0 / max(abs(step[3]), abs(step[4]) * 0.5, 1e-30))
    for _halving in range(6):
        trial_steepness = min(max(steepness * math.exp(scale * step[3]), gentlest), steepest)
        trial_shift = shift + scale * step[4] / steepness
        if abs(trial_shift) < span:
            trial = _error(speeds, currents, trial_steepness, trial_shift, basis, coefficients)
            if trial < error * (1.0 - 1e-6):
                transition[0], transition[1] = trial_steepness, trial_shift
                return trial
        scale *= 0.35
    return error


@njit(cache=True)
def _look_around(speeds: np.ndarray, currents: np.ndarray, transition: np.ndarray,
                 steepest: float, gentlest: float, error: float, basis: np.ndarray,
                 coefficients: np.ndarray, reach: float) -> float:
    """Move the transition in place to the best of twelve places about it, if that is better."""
    steepness, shift = transition[0], transition[1]
    span = speeds.max() - speeds.min()
    after = min(max(np.searchsorted(speeds, shift), 1), speeds.size - 1)
    for k in range(12):
        if k < 8:
            angle = math.pi * k / 4.0
            trial_steepness = steepness * math.exp(reach * math.cos(angle))
            trial_shift = shift + reach * math.sin(angle) / steepness
        else:
            # Along the valleys in which a neighbouring point keeps its share.
            point = speeds[after - k % 2]
            trial_steepness = steepness * math.exp(reach if k < 10 else -reach)
            trial_shift = point + (shift - point) * steepness / trial_steepness
        if not gentlest <= trial_steepness <= steepest or abs(trial_shift) >= span:
            continue
        trial = _error(speeds, currents, trial_steepness, trial_shift, basis, coefficients)
        if trial < error * (1.0 - 1e-7):
            transition[0], transition[1] = trial_steepness, trial_shift
            error = trial
    return error


@njit(cache=True)
def _scan(speeds: np.ndarray, currents: np.ndarray, steepnesses: np.ndarray, shifts: np.ndarray,
          errors: np.ndarray) -> None:
    basis = np.arange(3)
    coefficients = np.empty(3)
    design = np.empty((speeds.size, 3))
    for j in range(shifts.shape[1]):
        for i in range(steepnesses.shape[0]):
            _fill(speeds, steepnesses[i, j], shifts[i, j], design)
            if i == 0:
                independent_rows(design, basis)
            errors[i, j] = least_absolute(design, currents, basis, coefficients)


@njit(cache=True)
def _gentlest_within(speeds: np.ndarray, currents: np.ndarray, shift: float,
                     steepnesses: np.ndarray, bound: float, least_viscous: float) -> float:
    """The smallest of ascending steepnesses whose error is within the bound; NaN if none is.

    A gentle transition must not live off a falling line under it, so the viscous share has a
    floor.
    """
    basis = np.arange(3)
    coefficients = np.empty(3)
    for steepness in steepnesses:
        error = _error(speeds, currents, steepness, shift, basis, coefficients)
        if error <= bound and coefficients[2] >= least_viscous:
            return steepness
    return np.nan


def fit_sigmoid(speeds: ArrayLike, currents: ArrayLike) -> tuple[Sigmoid, float]:
    """Fit the sigmoid of Eq. 6 to a look-up table with the least L1 error of Eq. 7.

    Parameters
    ----------
    speeds : array_like, shape (N,)
        Joint velocities in rad/s, of both signs, in any order; at least two different ones each.
    currents : array_like, shape (N,)
        Mean currents in A.

    Returns
    -------
    Sigmoid
    float
        E of Eq. 7 in A.

    Raises
    ------
    InputError
        If the table is too small, one-sided or not finite.
    """
    speeds = np.ascontiguousarray(speeds, dtype=float)
    currents = np.ascontiguousarray(currents, dtype=float)
    if speeds.ndim != 1 or speeds.shape != currents.shape:
        raise InputError(f'look-up table: speeds and currents must be of one length, not '
                         f'{speeds.shape} and {currents.shape}')
    if not (np.all(np.isfinite(speeds)) and np.all(np.isfinite(currents))):
        raise InputError('look-up table: speeds and currents must be finite')
    values = np.unique(speeds)
    if np.sum(values > 0.0) < 2 or np.sum(values < 0.0) < 2:
        raise InputError('look-up table: at least two speeds of each sign are needed')

    order = np.argsort(speeds, kind='stable')
    unit = float(np.max(np.abs(speeds)))
    x = np.ascontiguousarray(speeds[order] / unit)
    height = float(np.max(np.abs(currents))) or 1.0
    y = np.ascontiguousarray(currents[order] / height)
    # Exact ties stop the descent from edge to edge early; a part in 10^10 breaks them.
    disturbed = y + 1e-10 * np.sin(np.arange(1.0, y.size + 1.0) * 12.9898)

    gap = float(np.min(np.diff(values))) / unit
    gentlest, steepest = 0.5, 40.0 / gap
    steepness, shift, error = _search(x, disturbed, values / unit, gentlest, steepest)
    steepness, shift = _well_behaved(x, disturbed, steepness, shift, error, gentlest)

    basis, coefficients = np.arange(3), np.empty(3)
    design = np.empty((x.size, 3))
    _fill(x, steepness, shift, design)
    independent_rows(design, basis)
    least_absolute(design, y, basis, coefficients)
    middle, half, viscous = coefficients * height
    sigmoid = Sigmoid(upper=float(middle + half), lower=float(middle - half),
                      steepness=float(steepness / unit), shift=float(shift * unit),
                      viscous=float(viscous / unit))
    return sigmoid, sigmoid_error(sigmoid, speeds, currents)


def sigmoid_error(sigmoid: Sigmoid, speeds: ArrayLike, currents: ArrayLike) -> float:
    """Return E of Eq. 7 in A: the sum of absolute deviations over the look-up table."""
    return float(np.sum(np.abs(np.asarray(currents) - sigmoid(speeds))))


def _search(x: np.ndarray, y: np.ndarray, values: np.ndarray, gentlest: float,
            steepest: float) -> tuple[float, float, float]:
    """Return steepness, shift and error of the best transition; speeds are scaled to [-1, 1]."""
    steepnesses, shifts = _grid(values, gentlest)
    errors = np.empty_like(steepnesses)
    _scan(x, y, steepnesses, shifts, errors)
    errors[~np.isfinite(errors)] = np.inf

    padded = np.pad(errors, 1, constant_values=np.inf)
    rows, columns = errors.shape
    neighbours = [padded[1 + a:1 + a + rows, 1 + b:1 + b + columns]
                  for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b]
    lowest = np.argwhere(errors <= np.min(neighbours, axis=0)).tolist()
    minima: list[list[int]] = sorted(lowest, key=lambda index: errors[tuple(index)])[:_STARTS]
    # Steep transitions beside a point lie in valleys along which the error hardly changes, so
    # that they are no minima of the grid: start in each valley at a few steepnesses.
    beside = np.min([padded[1:-1, :-2], padded[1:-1, 2:]], axis=0)
    for row in (rows // 2, 3 * rows // 4, rows - 1):
        valleys = np.nonzero(errors[row] <= beside[row])[0]
        best = valleys[np.argsort(errors[row, valleys], kind='stable')[:4]]
        minima.extend([row, int(column)] for column in best)
    found = []
    for row, column in minima:
        transition = np.array([steepnesses[row, column], shifts[row, column]])
        error = _descend(x, y, transition, steepest, gentlest, 12)
        found.append((error, float(transition[0]), float(transition[1])))
    best_found = (np.inf, 1.0, 0.0)
    finalists: list[tuple[float, float, float]] = []
    for start in sorted(found):
        # Several starts end in one place; one of them goes on.
        if not finalists or start[0] > finalists[-1][0] * (1.0 + 1e-5):
            finalists.append(start)
    for start in finalists[:4]:
        transition = np.array(start[1:])
        error = _descend(x, y, transition, steepest, gentlest, 150)
        best_found = min(best_found, (error, float(transition[0]), float(transition[1])))
    error, steepness, shift = best_found
    return steepness, shift, error


def _grid(values: np.ndarray, gentlest: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the transitions to try: steepnesses and shifts, both of shape (K, P).

    Transitions are placed about every point of the table, at distances that shrink as they grow
    steeper: a steep one matters only where it cuts through a point. The points about zero, where
    drives have their transition, get more of them.
    """
    if values.size > 40:
        values = values[np.unique(np.linspace(0, values.size - 1, 40).astype(int))]
    gaps = np.diff(values)
    near = np.argsort(np.abs(values), kind='stable')[:10]
    points, offsets, widths = [0.0], [0.0], [gaps[np.argmin(np.abs(values[1:] + values[:-1]))]]
    for number, place in enumerate(values):
        narrow = np.min(gaps[max(number - 1, 0):number + 1])
        for distance in (_CLOSE if number in near else _FAR):
            points.append(place)
            offsets.append(distance)
            widths.append(narrow)
    order = np.lexsort((offsets, points))
    point, offset, width = (np.array(a)[order] for a in (points, offsets, widths))
    exponents = np.linspace(0.0, 1.0, 20)[:, None]
    steepnesses = gentlest * (30.0 / width / gentlest) ** exponents
    shifts = np.clip(point + offset / steepnesses, -1.0, 1.0)
    return np.ascontiguousarray(steepnesses), np.ascontiguousarray(shifts)


def _well_behaved(x: np.ndarray, y: np.ndarray, steepness: float, shift: float, error: float,
                  gentlest: float) -> tuple[float, float]:
    """Return the representative, among transitions that fit alike, that is centred and gentle."""
    bound = error * (1.0 + TOLERANCE) + 1e-9 * x.size
    basis, coefficients = np.arange(3), np.empty(3)
    _error(x, y, steepness, shift, basis, coefficients)
    least = min(coefficients[2], 0.0) - 1e-9
    gentler = np.ascontiguousarray(np.geomspace(gentlest, steepness, 80))
    if shift == 0.0:
        centred = np.array([0.0])
    else:
        centred = np.concatenate([[0.0], shift * np.geomspace(1e-3, 1.0, 24)])
    wide = np.ascontiguousarray(np.geomspace(gentlest, 4.0 * steepness, 120))
    for place in centred[:-1]:
        found = _gentlest_within(x, y, place, wide, bound, least)
        if np.isfinite(found):
            return found, place
    found = _gentlest_within(x, y, shift, gentler, bound, least)
    return (found if np.isfinite(found) else steepness), shift
