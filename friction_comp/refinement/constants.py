# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Adjusts the constants of chosen effects between the points of their grids."""

from __future__ import annotations

from collections.abc import Container, Sequence
import math
from typing import NamedTuple

import numpy as np

from friction_comp.model.effects.scene import SearchRange
from friction_comp.refinement.effect_columns import Key, Table, Term

_STEP = 1e-3
_RIDGE = 1e-6
# Constants that define an effect; the others only say how it fades.
_DEFINING = ('time_constant', 'width', 'distance')


class FreeConstant(NamedTuple):
    """A constant to adjust: the index of its term, its name, and its search range."""

    term: int
    name: str
    search: SearchRange

    def stepped(self, term: Term, step: float, table: Table) -> float:
        """Return the constant after a step in units of its search range, within its limits."""
        value, scene = term.constants[self.name], table.rows.scene
        if self.search.unit is None:
            value *= self.search.width ** step
        else:
            value += 0.5 * self.search.width * self.search.unit(scene, term.constants) * step
        return term.kind.limited(self.name, float(value), term.constants, scene)

    def unit(self, term: Term, table: Table) -> float:
        """Return the change of the constant for a step of one, in the constant's unit."""
        if self.search.unit is None:
            return term.constants[self.name] * math.log(self.search.width)
        return 0.5 * self.search.width * self.search.unit(table.rows.scene, term.constants)


def at_limit(term: Term, table: Table) -> bool:
    """Return whether a defining constant is at its limit, where the effect becomes another one.

    A warm-up slower than the recording is a drift; a bump as wide as the range is a spring.
    """
    return any(constant.stepped(term, side * _STEP, table) == term.constants[constant.name]
               for constant in free_constants([term]) if constant.name in _DEFINING
               for side in (1.0, -1.0))


def free_constants(terms: Sequence[Term], only: Container[Key] | None = None) -> list[FreeConstant]:
    """Return the constants of terms that have a search range."""
    return [FreeConstant(index, name, search) for index, term in enumerate(terms)
            if term.group is None and (only is None or term.key in only)
            for name, search in term.kind.constants.items() if search is not None]


def slopes(table: Table, keys: Sequence[Key], free: Sequence[FreeConstant]) -> np.ndarray:
    """Return the derivatives of a fit's prediction by each constant's step, shape (Q, R)."""
    coefficients = table.coefficients(keys)
    rows = []
    for constant in free:
        key = keys[constant.term]
        term, columns = table.terms[key], table.columns_of(key)
        changed = term.with_constants(**{constant.name: constant.stepped(term, _STEP, table)})
        gain = np.array([coefficients[column] for column in columns])
        new = table.rows.averaged(changed.columns(table.rows)).T
        rows.append(gain @ (new - table.columns[columns]) / _STEP)
    return np.array(rows).reshape(len(free), table.columns.shape[1])


def adjust_constants(table: Table, keys: Sequence[Key], rounds: int = 3,
                     only: Container[Key] | None = None) -> list[Key]:
    """Adjust the constants of terms together, by the Gauss-Newton method, and return the terms.

    Each round solves for the coefficients and for small changes of the constants (of `only` some
    terms) at once, and halves the step until the error decreases. Terms that depend on the load of
    others get the loads of the new fit.
    """
    keys = _with_current_loads(table, list(keys))
    for _ in range(rounds):
        terms = [table.terms[key] for key in keys]
        free = free_constants(terms, only)
        if not free:
            break
        residual = table.residual(keys, derivatives=False)
        design = np.vstack((table.columns[table.indices(keys)], slopes(table, keys, free)))
        norm = np.sqrt(np.einsum('ij,ij->i', design, design)) + 1e-300
        scaled = design / norm[:, None]
        gram = scaled @ scaled.T
        gram[np.diag_indices(len(gram))] += _RIDGE
        step = np.linalg.solve(gram, scaled @ residual) / norm
        step = np.clip(step[-len(free):], -1.0, 1.0)
        initial = float(residual @ residual)
        for share in (1.0, 0.5, 0.25):
            changed = list(terms)
            for constant, size in zip(free, share * step):
                term = changed[constant.term]
                changed[constant.term] = term.with_constants(
                    **{constant.name: constant.stepped(term, float(size), table)})
            distinct = len({term.key for term in changed}) == len(changed)
            if distinct and (error := table.error_with(changed)) < initial:
                break
        else:
            return keys
        trial = table.add(changed)
        only = only and [*trial]
        keys = _with_current_loads(table, trial)
        if error > (1.0 - 1e-3) * initial:
            break
    return keys


def _with_current_loads(table: Table, keys: list[Key]) -> list[Key]:
    """Return terms with the loads that follow from the coefficients of the other terms."""
    for index, key in enumerate(keys):
        term = table.terms[key]
        if term.kind.uses_inner_load:
            constants = term.kind.with_loads(term.constants, table.loads(keys))
            added = table.add([Term(term.kind, constants)])
            keys[index] = added[0] if added else key
    return keys
