# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Robust fit of a sum of effects: coefficients by Huber's estimator, constants by search."""

from __future__ import annotations

from collections.abc import Sequence
import copy
from dataclasses import dataclass, field, replace
import math
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.huber import huber_weights
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement.fit.robust_regression import LeastSquares, robust_scale, side_by_side
from friction_comp.refinement.fit.view import View, view_of

if TYPE_CHECKING:
    from friction_comp.model.effects.base import Effect
    from friction_comp.refinement.prepare.fit_data import Measured
    from friction_comp.samples import Samples

# Weights that change by less than this have settled.
_SETTLED = 1e-3
TRIAL = 3
"""Rounds of new weights for a fit on trial."""


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

    A search asks for columns far more often on the fitted rows than on all others: `parts` and
    `left` are those of the fitted rows, `whole` and `residual` are worked out where they are asked
    for.

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
        self._residual: np.ndarray | None = None
        self._raw: dict[Any, tuple[Term | None, Samples, np.ndarray]] = {}
        self._view: tuple[Samples, int, View] | None = None
        self.refresh()

    def copy(self) -> Fit:
        """Return a copy whose terms and coefficients may change."""
        twin = copy.copy(self)
        twin.terms, twin.parts, twin._whole = list(self.terms), list(self.parts), list(self._whole)
        return twin

    def moved(self, data: Measured, rows: np.ndarray) -> Fit:
        """Return a fit with the same terms and constants on other rows, solved."""
        twin = self.copy()
        twin.data, twin.rows, twin.index = data, rows, np.nonzero(rows)[0]
        twin._view = None
        twin.refresh()
        return twin

    def own_coefficients(self) -> list[np.ndarray]:
        """Return the coefficients in A of the base and of each term."""
        found, begin = [], 0
        for part in self.parts:
            end = begin + part.shape[1]
            found.append(self.coefficients[begin:end])
            begin = end
        return found

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
        self.parts: list[np.ndarray] = [np.empty(0)] * (len(self.terms) + 1)
        self._whole: list[Any] = [None] * len(self.parts)
        own = {(self.steepness, self.shift), *map(id, self.terms)}
        self._raw = {key: held for key, held in self._raw.items() if key in own}
        for place in range(-1, len(self.terms)):
            self.evaluate(place)

    @property
    def reshaped(self) -> bool:
        """Whether a term changes the current of all others."""
        return any(term.kind.reshapes for term in self.terms)

    def evaluate(self, place: int) -> None:
        """Compute the columns of a term again, or those of the sigmoid where `place` is -1."""
        term, view = self.terms[place] if place >= 0 else None, self.view()
        if view.samples is self.samples or (term and term.kind.sees_history):
            whole = self.columns(term, self.samples)
            self._whole[place + 1] = whole
            self.parts[place + 1] = whole.T.take(self.index, axis=1).T
            return
        self._whole[place + 1] = None
        own = self.columns(term, view.samples)
        self.parts[place + 1] = own if view.keep is None else own.T.take(view.keep, axis=1).T

    def put(self, place: int, term: Term) -> None:
        """Exchange a term, not solved yet; its columns are computed again if it is another."""
        if term is not self.terms[place]:
            self.terms[place] = term
            self.evaluate(place)

    def columns(self, term: Term | None, samples: Samples) -> np.ndarray:
        """Return a term's columns, or the sigmoid's, as the recording holds them."""
        lags = [other for other in self.terms if other.kind.reshapes]
        if not lags:
            return self._asked(term, samples)
        # A low pass of another length is one of the same columns.
        key = id(term) if term else (self.steepness, self.shift)
        if key not in self._raw or self._raw[key][1] is not samples:
            self._raw = {**self._raw, key: (term, samples, self._asked(term, samples))}
        columns = self._raw[key][2]
        for other in lags:
            columns = other.kind.recorded_as(columns, samples, other.constants)
        return columns

    def _asked(self, term: Term | None, samples: Samples) -> np.ndarray:
        """Return a term's columns, or the sigmoid's, as the motion asks for them."""
        if term is not None:
            return term.columns(samples, self.data.window)
        columns = base_columns(samples, self.steepness, self.shift)
        if not self.data.scene.both_directions:
            # From motion in one direction a constant cannot be told from Coulomb friction, and
            # the two together would bend into any shape: friction is taken to be odd.
            columns[:, 0] = 0.0
        return columns

    def view(self) -> View:
        """Return the fitted samples, and those beside them that their currents depend on."""
        reach = max((term.kind.reach(term.constants, self.samples) for term in self.terms),
                    default=0)
        held = self._view
        if held is None or held[0] is not self.samples or held[1] != reach:
            self._view = held = (self.samples, reach, view_of(self.samples, self.index, reach))
        return held[2]

    @property
    def whole(self) -> list[np.ndarray]:
        """All columns on all samples, each of shape (N, M)."""
        for place, columns in enumerate(self._whole):
            if columns is None:
                term = self.terms[place - 1] if place else None
                self._whole[place] = self.columns(term, self.samples)
        return list(self._whole)

    def forget(self) -> None:
        """Drop what can be worked out again: of the many fits of a search most are read once."""
        self._whole, self._residual, self._raw = [None] * len(self.parts), None, {}

    def scale_columns(self, place: int, factors: np.ndarray) -> None:
        """Multiply the columns of a term, or of the sigmoid where `place` is -1, not solved yet."""
        self._whole = self.whole
        for parts in (self.parts, self._whole):
            parts[place + 1] = parts[place + 1] * factors

    @property
    def residual(self) -> np.ndarray:
        """What is left of the current on all samples, A, shape (N,)."""
        if self._residual is None:
            self._residual = self.target - sum((part @ own for part, own in zip(
                self.whole, self.own_coefficients())), np.zeros(len(self.target)))
        return self._residual

    @property
    def target(self) -> np.ndarray:
        """Current in A to explain, shape (N,)."""
        current = self.data.target
        return current if self.offset is None else current - self.offset

    def solve(self, rounds: int = 6) -> None:
        """Find the coefficients by iteratively reweighted least squares.

        The weights begin at one: with those of the fit it comes from, what another start would
        explain counts little already, and a fit stays in a valley that leads nowhere.
        """
        goal = self.target[self.index]
        equations = LeastSquares(side_by_side(self.parts), goal)
        weights, signs = np.ones(len(goal)), self.signs
        begins = np.cumsum([part.shape[1] for part in self.parts])
        loaded = [place for place, term in enumerate(self.terms) if term.kind.carried]
        for number in range(rounds):
            for place in loaded if number else ():
                self.put(place, self.loaded(self.terms[place]))
                equations.exchange(begins[place], self.parts[place + 1])
            self.coefficients = equations.solved(weights, signs)
            residual = equations.left(self.coefficients)
            self.scale = robust_scale(residual)
            before, weights = weights, huber_weights(residual, self.scale)
            if number and not loaded and np.max(np.abs(weights - before)) < _SETTLED:
                break
        self.weights, self.left = weights, residual
        self._residual = None

    def with_term(self, term: Term) -> Fit:
        """Return a copy with one more term, solved."""
        twin = self.copy()
        # Many are made of one: what they share is worked out once.
        twin._whole = self.whole
        if term.kind.reshapes:
            twin.terms.append(term)
            twin.refresh()
            return twin
        term = self.loaded(term.turned(self.transition))
        twin.terms.append(term)
        twin.parts.append(np.empty(0))
        twin._whole.append(None)
        twin.evaluate(len(twin.terms) - 1)
        twin.solve()
        return twin

    def without(self, place: int) -> Fit:
        """Return a copy that lacks one term, solved."""
        twin = self.copy()
        gone = twin.terms.pop(place)
        if gone.kind.reshapes:
            twin.refresh()
            return twin
        del twin.parts[place + 1], twin._whole[place + 1]
        twin.solve()
        return twin

    def reordered(self, places: Sequence[int]) -> Fit:
        """Return a copy with its terms in another order."""
        twin = self.copy()
        twin.terms = [self.terms[place] for place in places]
        twin.parts = [self.parts[0], *(self.parts[place + 1] for place in places)]
        twin._whole = [self._whole[0], *(self._whole[place + 1] for place in places)]
        own = self.own_coefficients()
        twin.coefficients = np.concatenate([own[0], *(own[place + 1] for place in places)])
        return twin

    def picked(self, every: int) -> Samples:
        """Return every n-th of the fitted samples, as their currents nearly see them.

        Fits that nearly see the same have the same ones.
        """
        lags = [(term.kind, term.kind.nearly(term.constants, self.samples))
                for term in self.terms if term.kind.reshapes]
        key = 'picked', id(self.index), every, *(tuple(own.values()) for _, own in lags)
        known = self.data.known
        if key not in known:
            samples = self.data.samples
            for kind, constants in lags:
                samples = kind.nearly_seen_by(samples, constants)
            # The rows are kept as well, or others might get their place.
            known[key] = samples.take(self.index[::every]), self.index
        return known[key][0]


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
        size = float(np.sum(np.abs(fit.left)))
        if best is None or size < best[0]:
            best = (size, fit.steepness)
    return Fit(data, rows, best[1], offset=offset)
