# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Adjusts the constants of chosen effects between the points of their grids."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import replace
import math

import numpy as np

from friction_comp.model.effects import Scene
from friction_comp.refinement.effect_columns import Table, Term

_STEP = 1e-3
_RIDGE = 1e-6
# Constants that define an effect; the others only say how it fades.
_DEFINING = ('time_constant', 'width', 'distance')


def unit_of(term: Term, name: str, scene: Scene) -> float:
    """Return the change of a constant for a step of one through its search range."""
    search, value = term.kind.constants[name], float(term.constants[name])
    assert search is not None
    if search.unit is None:
        return value * math.log(search.width)
    return 0.5 * search.width * search.unit(scene, term.constants)


def stepped(term: Term, name: str, step: float, scene: Scene) -> Term:
    """Return a term with a constant after a step through its search range, within its limits."""
    search, value = term.kind.constants[name], term.constants[name]
    assert search is not None
    if search.unit is None:
        value *= search.width ** step
    else:
        value += unit_of(term, name, scene) * step
    value = term.kind.limited(name, float(value), term.constants, scene)
    return replace(term, constants={**term.constants, name: value})


def free_constants(terms: Sequence[Term], only: Container[Term] | None = None
                   ) -> list[tuple[int, str]]:
    """Return the constants of terms that have a search range: index of the term, and name."""
    return [(index, name) for index, term in enumerate(terms)
            if term.group is None and (only is None or term in only)
            for name, search in term.kind.constants.items() if search is not None]


def at_limit(term: Term, scene: Scene) -> bool:
    """Return whether a defining constant is at its limit, where the effect becomes another one.

    A warm-up slower than the recording is a drift; a bump as wide as the range is a spring.
    """
    return any(stepped(term, name, step, scene) == term
               for _, name in free_constants([term]) if name in _DEFINING
               for step in (_STEP, -_STEP))


def slopes(table: Table, terms: Sequence[Term], free: Sequence[tuple[int, str]]) -> np.ndarray:
    """Return the derivatives of a fit's prediction by each constant's step, shape (Q, R)."""
    coefficients, rows = table.coefficients(terms), []
    for index, name in free:
        columns = table.columns_of[terms[index]]
        changed = stepped(terms[index], name, _STEP, table.rows.scene)
        gain = np.array([coefficients[column] for column in columns])
        new = table.rows.averaged(changed.columns(table.rows)).T
        rows.append(gain @ (new - table.columns[columns]) / _STEP)
    return np.array(rows).reshape(len(free), table.columns.shape[1])


def adjust_constants(table: Table, terms: Sequence[Term], rounds: int = 3,
                     only: Container[Term] | None = None) -> list[Term]:
    """Adjust the constants of terms together, by the Gauss-Newton method, and return the terms.

    Each round solves for the coefficients and for small changes of the constants (of `only` some
    terms) at once, and halves the step until the error decreases. Terms that depend on the load of
    others get the loads of the new fit.
    """
    terms = _with_current_loads(table, list(terms))
    for _ in range(rounds):
        free = free_constants(terms, only)
        if not free:
            break
        residual = table.residual(terms, derivatives=False)
        design = np.vstack((table.columns[table.indices(terms)], slopes(table, terms, free)))
        norm = np.sqrt(np.einsum('ij,ij->i', design, design)) + 1e-300
        scaled = design / norm[:, None]
        gram = scaled @ scaled.T
        gram[np.diag_indices(len(gram))] += _RIDGE
        step = np.linalg.solve(gram, scaled @ residual) / norm
        step = np.clip(step[-len(free):], -1.0, 1.0)
        initial = float(residual @ residual)
        for share in (1.0, 0.5, 0.25):
            changed = list(terms)
            for (index, name), size in zip(free, share * step):
                changed[index] = stepped(changed[index], name, float(size), table.rows.scene)
            distinct = len(set(changed)) == len(changed)
            if distinct and (error := table.error_with(changed)) < initial:
                break
        else:
            return terms
        trial = table.add(changed)
        only = only and [*trial]
        terms = _with_current_loads(table, trial)
        if error > (1.0 - 1e-3) * initial:
            break
    return terms


def _with_current_loads(table: Table, terms: list[Term]) -> list[Term]:
    """Return terms with the loads that follow from the coefficients of the other terms."""
    for index, term in enumerate(terms):
        if term.kind.uses_inner_load:
            constants = term.kind.with_loads(term.constants, table.loads(terms))
            added = table.add([Term(term.kind, constants)])
            terms[index] = added[0] if added else term
    return terms
