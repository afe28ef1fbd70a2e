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
# Constants that make an effect what it is; others only say how it fades.
_DEFINING = ('time_constant', 'width', 'distance')


class Knob(NamedTuple):
    """A constant that is adjusted: of which term, its name, and how it is searched."""

    term: int
    name: str
    how: SearchRange

    def moved(self, term: Term, step: float, table: Table) -> float:
        """Return the constant after so many of its units, kept where it makes sense."""
        value, scene = term.constants[self.name], table.rows.scene
        if self.how.unit is None:
            value *= self.how.width ** step
        else:
            value += 0.5 * self.how.width * self.how.unit(scene, term.constants) * step
        return term.kind.limited(self.name, float(value), term.constants, scene)

    def unit(self, term: Term, table: Table) -> float:
        """Return the constant's change for a step of one, in its own unit."""
        if self.how.unit is None:
            return term.constants[self.name] * math.log(self.how.width)
        return 0.5 * self.how.width * self.how.unit(table.rows.scene, term.constants)


def at_limit(term: Term, table: Table) -> bool:
    """Return whether a constant is where the effect would turn into another one.

    A warm-up slower than the recording is a drift, a bump as wide as the range a spring.
    """
    return any(knob.moved(term, side * _STEP, table) == term.constants[knob.name]
               for knob in knobs_of([term]) if knob.name in _DEFINING for side in (1.0, -1.0))


def knobs_of(terms: Sequence[Term], only: Container[Key] | None = None) -> list[Knob]:
    """Return the constants of terms that are searched."""
    return [Knob(index, name, how) for index, term in enumerate(terms)
            if term.group is None and (only is None or term.key in only)
            for name, how in term.kind.constants.items() if how is not None]


def slopes(table: Table, keys: Sequence[Key], knobs: Sequence[Knob]) -> np.ndarray:
    """Return how a fit's prediction changes with each knob, per step, shape (Q, R)."""
    coefficients = table.coefficients(keys)
    rows = []
    for knob in knobs:
        key = keys[knob.term]
        term, places = table.terms[key], table.columns_of(key)
        changed = term.with_constants(**{knob.name: knob.moved(term, _STEP, table)})
        gain = np.array([coefficients[column] for column in places])
        new = table.rows.averaged(changed.columns(table.rows)).T
        rows.append(gain @ (new - table.columns[places]) / _STEP)
    return np.array(rows).reshape(len(knobs), table.columns.shape[1])


def adjusted(table: Table, keys: Sequence[Key], rounds: int = 3,
             only: Container[Key] | None = None) -> list[Key]:
    """Return terms with their constants adjusted together, by the Gauss-Newton method.

    Each round solves for the coefficients and for small changes of the constants at once, and
    halves the step until it helps. Terms that hold the load of others are given what these carry
    now.

    Parameters
    ----------
    table : Table
    keys : sequence of Key
    rounds : int
        At most so many.
    only : container of Key, optional
        Terms whose constants may change; all when omitted.
    """
    keys = _loaded(table, list(keys))
    for _ in range(rounds):
        terms = [table.terms[key] for key in keys]
        knobs = knobs_of(terms, only)
        if not knobs:
            break
        left = table.residual(keys, derivatives=False)
        design = np.vstack((table.columns[table.indices(keys)], slopes(table, keys, knobs)))
        norm = np.sqrt(np.einsum('ij,ij->i', design, design)) + 1e-300
        scaled = design / norm[:, None]
        gram = scaled @ scaled.T
        gram[np.diag_indices(len(gram))] += _RIDGE
        step = np.linalg.solve(gram, scaled @ left) / norm
        step = np.clip(step[-len(knobs):], -1.0, 1.0)
        now, better = float(left @ left), None
        for share in (1.0, 0.5, 0.25):
            changed = list(terms)
            for knob, size in zip(knobs, share * step):
                term = changed[knob.term]
                changed[knob.term] = term.with_constants(
                    **{knob.name: knob.moved(term, float(size), table)})
            if len({term.key for term in changed}) < len(changed):
                continue
            error = table.error_with(changed)
            if error < now:
                better = error
                break
        if better is None:
            break
        trial = table.add(changed)
        only = only and [*trial]
        keys = _loaded(table, trial)
        if better > (1.0 - 1e-3) * now:
            break
    return keys


def _loaded(table: Table, keys: list[Key]) -> list[Key]:
    """Return terms with the loads in them that the other terms carry now."""
    for index, key in enumerate(keys):
        term = table.terms[key]
        if term.kind.uses_inner_load:
            constants = term.kind.with_loads(term.constants, table.loads(keys))
            added = table.add([Term(term.kind, constants)])
            keys[index] = added[0] if added else key
    return keys
