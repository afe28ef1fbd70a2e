# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What other joints ask of a joint's motor, where no URDF says how they are connected.

The potential energy of a serial arm is a sum of harmonics of sums and differences of joint angles,
its kinetic energy of such harmonics times two velocities, and what it asks of a joint follows from
these by Lagrange's equations. Which of them count is found in the recording: one group of terms at
a time, as long as times and postures that were not fitted bear it out, or all that neighbours'
links may ask at once, since weight and inertia cancel where an arm swings freely. Such a sum holds
for postures like the recorded ones; a URDF does better.

Two laws of mechanics leave out what would only stand in for something else. Weight asks of a joint
the slope of the potential energy by that joint's own angle, which is therefore part of every term.
And the angle of a joint turns all links behind it as one, which changes nothing of the inertia that
they have about it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
import warnings

import numpy as np
from scipy.cluster.vq import kmeans2

from friction_comp.arm.robust import bulk_weights, STRETCHES, stretches_of
from friction_comp.model.arm.coupling import Coupling, Group
from friction_comp.model.plain_drive import plain_drive_columns

_FOLDS = 3
# A group has to lower the loss on stretches not fitted by this share, this many standard errors
# clear of nothing: over a hundred groups are tried.
LEAST_SHARE, LEAST_ERRORS = 0.04, 3.5
# Neighbours' weight is one of ten, and chance exceeds so many errors in one of forty. Asked of
# what takes away a fifth besides: chance that is not fitted lowers a loss by a few percent.
USUAL_SHARE, USUAL_ERRORS = 0.2, 2.2
_MOST_GROUPS = 12
_MOST_ROWS = 8000
# So many of the groups that fit best are compared on stretches not fitted.
_SHORT_LIST = 6
# Fewer samples than these are not counted by themselves.
_FEWEST = 20
_RIDGE = 1e-6


def groups_for(names: Sequence[str], own: str) -> list[Group]:
    """Return the groups that other joints may add to the current of one.

    Parameters
    ----------
    names : sequence of str
        In the order of the recording, which mostly is that along the arm.
    own : str
        The joint; what depends on it alone is left to its own effects.

    Returns
    -------
    list of Group
    """
    sums: list[tuple[tuple[str, int], ...]] = [
        ((one, 1), (two, side)) for one, two in combinations(names, 2) for side in (1, -1)]
    sums += [tuple((name, 1) for name in names[start:stop])
             for start in range(len(names)) for stop in range(start + 3, len(names) + 1)]
    groups = [Group('weight', angles) for angles in sums if own in (name for name, _ in angles)]
    singles: list[tuple[tuple[str, int], ...]] = [()] + [((name, 1),) for name in names]
    beside = list(zip(names, names[1:]))
    sums = singles + [((one, 1), (two, 1)) for one, two in beside]
    pairs = [(own, name) for name in names] + [
        pair for pair in [(name, name) for name in names] + beside if own not in pair]
    for one, two in pairs:
        for angles in sums:
            turned = {name for name, _ in angles}
            # Of two joints' common inertia the angle of the first one makes no difference, and
            # without accelerating itself a joint feels an energy by its own angle alone.
            if not {one, two} <= turned and (own in (one, two) or own in turned) and (
                    one != two or turned):
                groups.append(Group('kinetic', angles, (own, one, two)))
    return groups


def neighbourhoods(names: Sequence[str], own: str) -> list[set[str]]:
    """Return a joint with each of its neighbours, and with both.

    Parameters
    ----------
    names : sequence of str
        In their order along the arm.
    own : str
    """
    place = list(names).index(own)
    beside = [{own, name} for name in (*names[:place][-1:], *names[place + 1:][:1])]
    return [*beside, set.union(*beside)] if len(beside) > 1 else beside


def hangs_together(group: Group, names: Sequence[str]) -> bool:
    """Tell whether a group is the weight of a link whose angle neighbouring joints make up.

    Links hang behind one another, so that this is where weight is looked for first.

    Parameters
    ----------
    group : Group
    names : sequence of str
        In their order along the arm.
    """
    places = sorted(list(names).index(name) for name, _ in group.angles)
    return group.kind == 'weight' and places[-1] - places[0] == len(places) - 1


def find_coupling(current: np.ndarray, names: Sequence[str], own: str,
                  motion: tuple[np.ndarray, np.ndarray, np.ndarray], recording: np.ndarray,
                  rows: np.ndarray) -> Coupling | None:
    """Return what other joints add to a joint's current.

    Parameters
    ----------
    current : ndarray, shape (N,)
        A.
    names : sequence of str, length J
    own : str
        The joint whose current it is.
    motion : tuple of ndarray, each of shape (N, J)
        Position, velocity and acceleration of all joints.
    recording : ndarray of int, shape (N,)
    rows : ndarray of bool, shape (N,)
        Samples that count.

    Returns
    -------
    Coupling or None
        None where what was not fitted shows no need.
    """
    index = np.nonzero(rows)[0]
    index = index[::max(1, len(index) // _MOST_ROWS)]
    if len(index) < _FEWEST * STRETCHES:
        return None
    q, v, a = (values[index] for values in motion)
    search = _Search(current[index], names, own, (q, v, a), stretches_of(recording[index]))
    chosen = search.run()
    if not chosen:
        return None
    return Coupling(tuple(search.groups[k] for k in chosen), search.coefficients(chosen),
                    search.errors(chosen))


def _cells(stretch: np.ndarray, position: np.ndarray
           ) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Return which samples are left out together, and two ways to hold them out.

    Most excitations come by the same postures again and again: what is left out of some stretches
    of time was driven in others, and a sum of wrong terms passes. A term therefore has to help in
    stretches of time and in regions of posture that it was not fitted to.

    Parameters
    ----------
    stretch : ndarray of int, shape (L,)
    position : ndarray, shape (L, J)
        rad.

    Returns
    -------
    cell : ndarray of int, shape (L,)
        Stretch and region of posture in one.
    own : ndarray of int, shape (C,)
        The stretch of each cell.
    ways : list of ndarray of int, shape (C,)
        The fold of each cell.
    """
    spread = (position - position.mean(axis=0)) / (position.std(axis=0) + 1e-9)
    with warnings.catch_warnings():
        # A region without a sample is none.
        warnings.simplefilter('ignore', UserWarning)
        _, region = kmeans2(spread, _FOLDS, minit='++', seed=0)
    cells, cell = np.unique(_FOLDS * stretch + region, return_inverse=True)
    ways = [cells // _FOLDS % _FOLDS, cells % _FOLDS]
    return cell, cells // _FOLDS, [way for way in ways if len(np.unique(way)) > 1]


class _Search:
    """Choice of groups beside the joint's own friction, weight and inertia."""

    def __init__(self, current: np.ndarray, names: Sequence[str], own: str,
                 motion: tuple[np.ndarray, np.ndarray, np.ndarray], stretch: np.ndarray) -> None:
        q, v, a = motion
        k = list(names).index(own)
        top = max(float(np.percentile(np.abs(v[:, k]), 95)), 1e-9)
        base = np.column_stack((
            plain_drive_columns(v[:, k], a[:, k], 0.03 * top), np.cos(q[:, k]), np.sin(q[:, k])))
        self.groups = groups_for(names, own)
        self._usual = [hangs_together(group, names) for group in self.groups]
        self._together = [
            [k for k, group in enumerate(self.groups) if group.everyone <= near]
            for near in neighbourhoods(names, own)]
        parts = [base] + [group.columns(names, q, v, a) for group in self.groups]
        edges = np.cumsum([0] + [part.shape[1] for part in parts])
        self._places = [np.arange(one, two) for one, two in zip(edges[:-1], edges[1:])]
        matrix = np.hstack([*parts, current[:, None]])
        self._norm = np.sqrt(np.mean(matrix ** 2, axis=0)) + 1e-300
        self._matrix = matrix / self._norm
        cell, self._stretch, self._ways = _cells(stretch, q)
        self._rows = [np.nonzero(cell == number)[0] for number in range(len(self._stretch))]
        # A few samples by themselves say more of the noise than of a term.
        self._told = np.array([len(rows) >= _FEWEST for rows in self._rows])
        self._even = np.ones(len(q))

    def run(self) -> list[int]:
        """Return the numbers of the groups chosen: the better choice of several starts."""
        self._weigh(self._even)
        none = self._losses([])
        starts = [near for near in self._together if self._certain(none, self._losses(near))]
        choices = [self._grown(start) for start in ([], *starts)]
        self._weigh(self._even)
        return min(choices, key=lambda chosen: float(self._losses(chosen).sum()))

    def _grown(self, start: list[int]) -> list[int]:
        """Return groups without those that are not missed, and with those that lower the losses."""
        self._weigh(self._even)
        chosen = self._pruned(list(start))
        while len(chosen) < _MOST_GROUPS:
            self._weigh(bulk_weights(self._residual(chosen)))
            before = self._losses(chosen)
            gains = self._gains(chosen)
            short = [k for gain, k in sorted(gains, reverse=True)[:_SHORT_LIST] if gain > 0.0]
            trials = [(self._losses([*chosen, k]), k) for k in short]
            # Of those that chance does not explain, the one that explains most.
            sure = [(float(after.sum()), k) for after, k in trials
                    if self._shows(k, before, after)]
            if not sure:
                break
            chosen.append(min(sure)[1])
        return self._pruned(chosen)

    def _pruned(self, chosen: list[int]) -> list[int]:
        """Return groups without those that what was not fitted does not miss."""
        while chosen:
            losses = self._losses(chosen)
            least, without = min(
                ((self._losses([k for k in chosen if k != gone]), gone) for gone in chosen),
                key=lambda entry: float(entry[0].sum()))
            if self._shows(without, least, losses):
                break
            chosen = [k for k in chosen if k != without]
        return chosen

    def _shows(self, group: int, before: np.ndarray, after: np.ndarray) -> bool:
        """Tell whether the cells' losses with a group are lower than chance makes them."""
        if self._usual[group]:
            # Slow motion passes each posture once: there is none that was not fitted.
            old, new = (np.bincount(self._stretch, losses[0])[None] for losses in (before, after))
            if _lowers(old, new, USUAL_SHARE, USUAL_ERRORS):
                return True
        return self._certain(before, after)

    def _certain(self, before: np.ndarray, after: np.ndarray) -> bool:
        """Tell whether losses are lower in times and in postures that were not fitted."""
        return self._told.sum() > _FOLDS and _lowers(
            before[:, self._told], after[:, self._told], LEAST_SHARE, LEAST_ERRORS)

    def coefficients(self, chosen: list[int]) -> tuple[tuple[float, ...], ...]:
        """Return the coefficients of chosen groups in A per unit, a tuple for each."""
        self._weigh(bulk_weights(self._residual(chosen)))
        columns, found = self._solved(chosen, np.arange(len(self._grams)))
        values = dict(zip(columns, found * self._norm[-1] / self._norm[columns]))
        return tuple(tuple(float(values[c]) for c in self._places[k + 1]) for k in chosen)

    def errors(self, chosen: list[int]) -> tuple[float, ...]:
        """Return the RMS error in A on what was not fitted, without groups and with them.

        With them also by how it was held out, in times and in postures, where these differ.
        """
        self._weigh(self._even)
        before, after = (
            np.sqrt(self._losses(some).sum(axis=1) / len(self._even)) * self._norm[-1]
            for some in ([], chosen))
        ways = after.tolist() if len(after) > 1 else []
        return float(np.sqrt(np.mean(before ** 2))), float(np.sqrt(np.mean(after ** 2))), *ways

    def _weigh(self, weights: np.ndarray) -> None:
        self._grams = np.array([
            (self._matrix[rows] * weights[rows, None]).T @ self._matrix[rows]
            for rows in self._rows])

    def _solved(self, chosen: list[int], stretches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        columns = np.concatenate([self._places[0], *(self._places[k + 1] for k in chosen)])
        gram = self._grams[stretches].sum(axis=0)
        return columns, np.linalg.solve(_ridged(gram, columns), gram[columns, -1])

    def _residual(self, chosen: list[int]) -> np.ndarray:
        columns, found = self._solved(chosen, np.arange(len(self._grams)))
        return self._matrix[:, -1] - self._matrix[:, columns] @ found

    def _losses(self, chosen: list[int]) -> np.ndarray:
        """Return every cell's weighted sum of squares by fits on other folds, (W, C)."""
        numbers = np.arange(len(self._grams))
        losses = np.empty((len(self._ways), len(numbers)))
        for way, loss in zip(self._ways, losses):
            for fold in np.unique(way):
                columns, found = self._solved(chosen, numbers[way != fold])
                mix = np.append(found, -1.0)
                places = np.append(columns, self._matrix.shape[1] - 1)
                for number in numbers[way == fold]:
                    loss[number] = mix @ self._grams[number][np.ix_(places, places)] @ mix
        return losses

    def _gains(self, chosen: list[int]) -> list[tuple[float, int]]:
        """Return by how much each other group lowers the weighted sum of squares of everything."""
        gram = self._grams.sum(axis=0)
        columns, found = self._solved(chosen, np.arange(len(self._grams)))
        had = np.linalg.solve(_ridged(gram, columns), gram[columns])
        gains = []
        for k in range(len(self.groups)):
            if k in chosen:
                continue
            own = self._places[k + 1]
            rest = _ridged(gram, own) - gram[np.ix_(columns, own)].T @ had[:, own]
            slope = gram[own, -1] - gram[np.ix_(columns, own)].T @ found
            gains.append((float(slope @ np.linalg.solve(rest, slope)), k))
        return gains


def _ridged(gram: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return a block of a matrix of products, with what keeps it solvable."""
    block = gram[np.ix_(columns, columns)]
    return np.asarray(block + _RIDGE * np.trace(block) / len(block) * np.eye(len(block)))


def _lowers(before: np.ndarray, after: np.ndarray, least_share: float, least_errors: float) -> bool:
    """Tell whether losses, (W, C), are lower by a share and by standard errors, in every way."""
    # Ratios, since some cells hold far more of a term than others.
    lower = np.log((before + 1e-300) / (after + 1e-300))
    deviation = np.std(lower, axis=1, ddof=1) / np.sqrt(lower.shape[1]) + 1e-300
    errors = lower.mean(axis=1) / deviation
    shares = 1.0 - after.sum(axis=1) / before.sum(axis=1)
    return bool((shares >= least_share).all() and (errors >= least_errors).all())
