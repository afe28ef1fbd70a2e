# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How much further terms would help a fit, told without fitting them: the score test (Rao 1948).

The residual of a fit is projected on each term's columns, after what the fit has already is taken
out of these. Every point of a grid is asked in every step of a search, so that its columns are kept
as long as the samples are the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from friction_comp.refinement.fit.effect_sum import Term
from friction_comp.refinement.fit.robust_regression import side_by_side

if TYPE_CHECKING:
    from friction_comp.model.effects.base import Effect
    from friction_comp.refinement.fit.effect_sum import Fit

# Columns that are worked on together: few enough to stay in the processor's cache.
_TOGETHER = 32
# A column of which less than this share is new is one that the model has, and rounding.
_FRESH = 1e-4
_RIDGE = 1e-9


class ScoreTest:
    """A fit's residual, and what its columns span, on every n-th of the fitted rows.

    Parameters
    ----------
    fit : Fit
    every : int
    """

    def __init__(self, fit: Fit, every: int) -> None:
        self.fit, self.every = fit, every
        self.index, self.root = fit.index[::every], np.sqrt(fit.weights[::every])
        matrix = side_by_side([part[::every] for part in fit.parts]) * self.root[:, None]
        norm = np.linalg.norm(matrix, axis=0) + 1e-300
        basis, _ = np.linalg.qr(matrix / norm)
        residual = fit.left[::every] * self.root
        residual = residual - basis @ (basis.T @ residual)
        self._known = np.column_stack((basis, residual))

    def gains(self, terms: Sequence[Term]) -> list[float]:
        """Return by how much each term of a kind would lower the weighted sum of squares, A²."""
        return self._gains(terms[0].kind, self.columns(terms)) if terms else []

    def gains_on_grid(self, kind: type[Effect]) -> tuple[list[Term], list[float]]:
        """Return the terms of a kind's grid and their gains; their columns are kept."""
        fit, known = self.fit, self.fit.data.known
        terms = [Term(kind, constants) for constants in kind.grid(fit.data.scene)]
        if not terms or kind.carried or (kind.sees_history and fit.reshaped):
            return terms, self.gains(terms)
        samples = fit.picked(self.every)
        key = 'grid', kind, id(samples)
        if key not in known:
            known[key] = self.columns(terms), samples
        return terms, self._gains(kind, known[key][0])

    def columns(self, terms: Sequence[Term]) -> np.ndarray:
        """Return the columns of terms of one kind, shape (T, M, L)."""
        first = self._columns_at(terms[0])
        found = np.empty((len(terms), first.shape[1], len(first)))
        found[0] = first.T
        for place, term in enumerate(terms[1:], 1):
            found[place] = self._columns_at(term).T
        return found

    def _columns_at(self, term: Term) -> np.ndarray:
        """Return a term's columns on the rows, shape (L, M).

        Beside a low pass of the current they are nearly right, at a tenth of the cost: enough to
        tell one point of a grid from another.
        """
        if term.kind.sees_history:
            return self.fit.columns(term, self.fit.samples)[self.index]
        return self.fit.loaded(term).columns(
            self.fit.picked(self.every), self.fit.data.window)

    def _gains(self, kind: type[Effect], columns: np.ndarray) -> list[float]:
        """Return the gains of terms by their columns, shape (T, M, L)."""
        together, width, size = columns.shape
        found: list[float] = []
        signs = np.zeros(width)
        signs[:len(kind.signs)] = kind.signs[:width]
        step = max(1, _TOGETHER // max(width, 1))
        for first in range(0, together if width else 0, step):
            rows = columns[first:first + step] * self.root
            # What the fit has, and the residual, of every column.
            shares = (rows.reshape(-1, size) @ self._known).reshape(len(rows), width, -1)
            had, goal = shares[..., :-1], shares[..., -1]
            gram = rows @ rows.transpose(0, 2, 1)
            before = np.einsum('tmm->tm', gram).copy()
            gram -= had @ had.transpose(0, 2, 1)
            after = np.einsum('tmm->tm', gram)
            fresh = after > _FRESH ** 2 * before
            norm = np.sqrt(np.where(fresh, after, 1.0))
            goal = np.where(fresh, goal / norm, 0.0)
            gram = np.where(fresh[:, :, None] & fresh[:, None, :],
                            gram / norm[:, :, None] / norm[:, None, :], 0.0)
            gram += np.where(fresh, _RIDGE if width > 1 else 0.0, 1.0)[:, :, None] * np.eye(width)
            own = np.linalg.solve(gram, goal[:, :, None])[:, :, 0]
            gain = np.where((signs * own < 0.0).any(axis=1), 0.0, (goal * own).sum(axis=1))
            found += (self.every * gain).tolist()
        return found or [0.0] * together
