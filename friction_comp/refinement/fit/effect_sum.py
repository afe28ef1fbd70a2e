# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Robust fit of a sum of effects: coefficients by Huber's estimator, constants by search."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import copy
from dataclasses import dataclass, field, replace
import math
from typing import Any, TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from friction_comp.huber import huber_weights
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement.fit.robust_regression import robust_scale, side_by_side, solve

if TYPE_CHECKING:
    from friction_comp.model.effects.base import Effect
    from friction_comp.model.effects.scene import Scene, Search
    from friction_comp.refinement.prepare.fit_data import Measured
    from friction_comp.samples import Samples

# Weights that change by less than this have settled.
_SETTLED = 1e-3
# Terms whose columns are worked on together: few enough to stay in the processor's cache.
_TOGETHER = 16


@dataclass(frozen=True)
class Term:
    """An effect class with the constants that are tried."""

    kind: type[Effect]
    constants: dict[str, Any] = field(default_factory=dict)

    def turned(self, transition: float) -> Term:
        """Return the term with another velocity over which its friction changes sign."""
        if self.constants.get('transition', transition) == transition:
            return self
        return self.with_constants(transition=transition)

    def columns(self, samples: Samples, window: float) -> np.ndarray:
        """Return the design matrix; ripple is damped as the averaging of samples damps it."""
        matrix = self.kind.matrix(samples, self.constants)
        if window and self.kind.spectral:
            turns = (self.constants[self.kind.spectral] * samples.velocity * window
                     / (2.0 * math.pi))
            matrix = matrix * np.sinc(turns)[:, None]
        return matrix

    def with_constants(self, **changes: Any) -> Term:
        """Return the term with other values of some constants."""
        return Term(self.kind, {**self.constants, **changes})


def base_columns(samples: Samples, steepness: float, shift: float = 0.0) -> np.ndarray:
    """Return the columns of Eq. 6: constant, transition and viscous."""
    v = samples.velocity
    transition = Sigmoid(1.0, -1.0, steepness, shift)
    return np.column_stack((np.ones_like(v), transition(v), v))


class Fit:
    """A sum of effects being fitted on some rows of the data.

    Parameters
    ----------
    data : FitData
    rows : ndarray of bool, shape (N,)
        The samples it may learn from.
    steepness : float
        Of the sigmoid, s/rad.
    terms : sequence of Term
    offset : ndarray, shape (N,), optional
        Current in A that is known and not fitted.
    transition : float, optional
        Velocity in rad/s over which the friction of the terms changes sign: one for all, which
        need not be the sigmoid's own. That of the sigmoid when omitted.
    """

    def __init__(self, data: Measured, rows: np.ndarray, steepness: float,
                 terms: Sequence[Term] = (), offset: np.ndarray | None = None,
                 transition: float | None = None) -> None:
        self.data, self.rows, self.steepness = data, rows, steepness
        self.offset, self.shift = offset, 0.0
        self.index = np.nonzero(rows)[0]
        self.transition = transition or 2.0 / steepness
        self.terms = [term.turned(self.transition) for term in terms]
        self._basis: tuple[Any, ...] | None = None
        self._pick: tuple[Samples, Samples] | None = None
        self.refresh()

    def copy(self) -> Fit:
        """Return a copy whose terms and coefficients may change."""
        twin = copy.copy(self)
        twin.terms, twin.parts = list(self.terms), list(self.parts)
        return twin

    def forget(self) -> None:
        """Drop what was kept of the samples, for they are others now."""
        self._pick = None

    def own_coefficients(self) -> list[np.ndarray]:
        """Return the coefficients in A of the base and of each term."""
        edges = np.cumsum([part.shape[1] for part in self.parts])[:-1]
        return np.split(self.coefficients, edges)

    def loaded(self, term: Term) -> Term:
        """Return a term with the load in it that the others carry now, if it asks for that."""
        if not term.kind.carried:
            return term
        base, *own = self.own_coefficients()
        others = [(other, gains) for other, gains in zip(self.terms, own)
                  if not other.kind.carried]
        shares = [other.kind.load_share([float(gain) for gain in gains], other.constants)
                  for other, gains in others]
        if any(other.kind.gives_load and other.kind.holds_offset(self.data.scene)
               for other, _ in others):
            shares.append({'offset': base[0]})
        return replace(term, constants=term.kind.carrying(term.constants, shares))

    @property
    def signs(self) -> list[int]:
        """Sign that physics asks of every coefficient: friction takes energy from the motion."""
        signs = [0, 1, 1]
        for term, part in zip(self.terms, self.parts[1:]):
            own = list(term.kind.signs[:part.shape[1]])
            signs += own + [0] * (part.shape[1] - len(own))
        return signs

    def refresh(self) -> None:
        """Compute all columns again and solve."""
        self.fill()
        self.solve()

    def fill(self) -> None:
        """Compute all columns again."""
        self.samples = self.data.samples
        for term in self.terms:
            self.samples = term.kind.seen_by(self.samples, term.constants)
        self.terms = [term.turned(self.transition) for term in self.terms]
        self.parts = [self.base()] + [self.columns(term) for term in self.terms]

    @property
    def reshaped(self) -> bool:
        """Whether a term changes the current of all others."""
        return any(term.kind.reshapes for term in self.terms)

    def recorded_as(self, columns: np.ndarray) -> np.ndarray:
        """Return columns, shape (N, M), as the recording holds them."""
        for term in self.terms:
            columns = term.kind.recorded_as(columns, self.samples, term.constants)
        return columns

    def base(self) -> np.ndarray:
        """Return the sigmoid's columns, shape (N, 3)."""
        columns = base_columns(self.samples, self.steepness, self.shift)
        if not self.data.scene.both_directions:
            # From motion in one direction a constant cannot be told from Coulomb friction, and the
            # two together would bend into any shape: friction is taken to be odd.
            columns[:, 0] = 0.0
        return self.recorded_as(columns)

    def columns(self, term: Term) -> np.ndarray:
        """Return a term's columns, shape (N, M)."""
        return self.recorded_as(term.columns(self.samples, self.data.window))

    @property
    def target(self) -> np.ndarray:
        """Current in A to explain, shape (N,)."""
        current = self.data.target
        return current if self.offset is None else current - self.offset

    def solve(self, rounds: int = 6) -> None:
        """Find the coefficients by iteratively reweighted least squares."""
        inner, goal = side_by_side(self.parts, self.index), self.target[self.index]
        weights, signs = np.ones(len(goal)), self.signs
        loaded = [place for place, term in enumerate(self.terms) if term.kind.carried]
        for number in range(rounds):
            if loaded and number:
                for place in loaded:
                    self.terms[place] = self.loaded(self.terms[place])
                    self.parts[place + 1] = self.columns(self.terms[place])
                inner = side_by_side(self.parts, self.index)
            self.coefficients = solve(inner, goal, weights, signs)
            residual = goal - inner @ self.coefficients
            self.scale = robust_scale(residual)
            before, weights = weights, huber_weights(residual, self.scale)
            if number and not loaded and np.max(np.abs(weights - before)) < _SETTLED:
                break
        self.weights = weights
        self.prediction = sum((part @ own for part, own in zip(
            self.parts, self.own_coefficients())), np.zeros(len(self.target)))
        self.residual = self.target - self.prediction
        self._basis = None

    def with_term(self, term: Term) -> Fit:
        """Return a copy with one more term, solved."""
        twin = self.copy()
        if term.kind.reshapes:
            twin.terms.append(term)
            twin.refresh()
            return twin
        term = self.loaded(term.turned(self.transition))
        twin.terms.append(term)
        twin.parts = self.parts + [self.columns(term)]
        twin.solve()
        return twin

    def without(self, place: int) -> Fit:
        """Return a copy that lacks one term, solved."""
        twin = self.copy()
        gone = twin.terms.pop(place)
        if gone.kind.reshapes:
            twin.refresh()
            return twin
        twin.parts = self.parts[:place + 1] + self.parts[place + 2:]
        twin.solve()
        return twin

    def reordered(self, places: Sequence[int]) -> Fit:
        """Return a copy with its terms in another order."""
        twin = self.copy()
        twin.terms = [self.terms[place] for place in places]
        twin.parts = [self.parts[0], *(self.parts[place + 1] for place in places)]
        own = self.own_coefficients()
        twin.coefficients = np.concatenate([own[0], *(own[place + 1] for place in places)])
        twin._basis = None
        return twin

    def basis(self, every: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return orthonormal weighted columns and the weighted residual on the fitted rows."""
        if self._basis is None or self._basis[0] != every:
            index = self.index[::every]
            root = np.sqrt(self.weights[::every])
            matrix = side_by_side(self.parts, index) * root[:, None]
            norm = np.linalg.norm(matrix, axis=0) + 1e-300
            q, _ = np.linalg.qr(matrix / norm)
            residual = self.residual[index] * root
            residual = residual - q @ (q.T @ residual)
            self._basis = (every, index, root, q, residual)
        return self._basis[1:]

    def gain(self, term: Term, every: int = 1) -> float:
        """Return by how much a term would lower the weighted sum of squares, in A²."""
        return self.gains([term], every)[0]

    def gains(self, terms: Sequence[Term], every: int = 1) -> list[float]:
        """Return by how much each term, alone, would lower the weighted sum of squares, in A²."""
        found: list[float] = []
        for first in range(0, len(terms), _TOGETHER):
            found += self._gains([self.loaded(term) for term in terms[first:first + _TOGETHER]],
                                 every)
        return found

    def _gains(self, terms: Sequence[Term], every: int) -> list[float]:
        """Return the gains of a few terms, whose columns are orthogonalised all at once."""
        index, root, q, residual = self.basis(every)
        parts = [self._columns_at(term, index) for term in terms]
        edges = np.cumsum([0, *(part.shape[1] for part in parts)])
        if not edges[-1]:
            return [0.0] * len(terms)
        rows = side_by_side(parts).T * root
        before = np.sqrt(np.einsum('ij,ij->i', rows, rows))
        rows -= (rows @ q) @ q.T
        after = np.sqrt(np.einsum('ij,ij->i', rows, rows))
        # A column that the model already has is no news, whatever rounding leaves of it.
        fresh = after > 1e-4 * before
        product = np.where(fresh, rows @ residual / np.where(fresh, after, 1.0), 0.0)
        found = []
        for term, begin, end in zip(terms, edges[:-1], edges[1:]):
            places = begin + np.nonzero(fresh[begin:end])[0]
            wanted = (*term.kind.signs, *[0] * int(end - begin))
            own, goal = product[places], product[places]
            if len(places) > 1:
                gram = rows[places] @ rows[places].T / np.outer(after[places], after[places])
                gram.flat[::len(gram) + 1] += 1e-9
                own = np.linalg.solve(gram, goal)
            wrong = any(wanted[place - begin] * value < 0.0 for place, value in zip(places, own))
            found.append(0.0 if wrong else float(goal @ own) * every)
        return found

    def _columns_at(self, term: Term, index: np.ndarray) -> np.ndarray:
        """Return a term's columns on some of the fitted rows, shape (len(index), M).

        Beside a low pass of the current they are nearly right, at a tenth of the cost: enough to
        tell one point of a grid from another.
        """
        if term.kind.sees_history:
            return self.columns(term)[index]
        return term.columns(self._picked(index), self.data.window)

    def _picked(self, index: np.ndarray) -> Samples:
        """Return the fitted samples alone."""
        held = self._pick
        if held is None or held[0] is not self.samples or len(held[1]) != len(index):
            samples = self.samples
            for term in self.terms:
                samples = term.kind.nearly_seen_by(samples, term.constants)
            self._pick = held = (self.samples, samples.take(index))
        return held[1]

    def search(self, term: Term, every: int = 1, evaluations: int = 14) -> tuple[Term, float]:
        """Return the term with its constants searched around where they are, and its gain."""
        best = self.gain(term, every)
        for name, how in term.kind.constants.items():
            if how is None or how.joint_only:
                continue
            current = term.constants[name]
            low, high, back = bracket(how, current, term.constants, self.data.scene)

            def loss(x: float, name: str = name, back: Callable[..., Any] | type = back,
                     term: Term = term) -> float:
                value = term.kind.limited(
                    name, float(back(x)), term.constants, self.data.scene)
                return -self.gain(term.with_constants(**{name: value}), every)
            found = minimize_scalar(loss, bounds=(low, high), method='bounded',
                                    options={'maxiter': evaluations, 'xatol': 1e-4 * (high - low)})
            if -found.fun > best:
                best = -found.fun
                value = term.kind.limited(
                    name, float(back(found.x)), term.constants, self.data.scene)
                term = term.with_constants(**{name: value})
        return term, best


def bracket(how: Search, value: float, constants: dict[str, Any],
            scene: Scene) -> tuple[float, float, Callable[[float], float]]:
    """Return the search interval of a constant and the map from its scale.

    Parameters
    ----------
    how : Search
    value : float
        The constant's value now.
    constants : dict
        All constants of the term.
    scene : Scene
    """
    if how.logarithmic:
        return math.log(value / how.width), math.log(value * how.width), math.exp
    half = how.width * how.unit(scene, constants)
    return value - half, value + half, float


def first_fit(data: Measured, rows: np.ndarray, offset: np.ndarray | None = None,
              most_rows: int = 8000) -> Fit:
    """Return the fit of the sigmoid alone, its steepness searched on a grid."""
    speed = data.scene.speed
    every = max(1, int(rows.sum()) // most_rows)
    thin = np.zeros_like(rows)
    thin[np.nonzero(rows)[0][::every]] = True
    best = None
    for steepness in np.geomspace(4.0 / speed, 1200.0 / speed, 12):
        fit = Fit(data, thin, float(steepness), offset=offset)
        size = float(np.sum(np.abs(fit.residual[fit.index])))
        if best is None or size < best[0]:
            best = (size, fit.steepness)
    return Fit(data, rows, best[1], offset=offset)
