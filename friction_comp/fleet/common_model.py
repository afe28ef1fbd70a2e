# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The model that all units of a fleet share but for its coefficients.

Parameters can only be compared if they mean the same in every unit. Therefore one model is fitted
to all: Eq. 6 with the effects that most recordings show, with the same constants everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.effect_columns import EQ6_COLUMNS, EQ6_LINEAR, Table, Term
from friction_comp.refinement.prepare import join, prepare
from friction_comp.samples import Samples

# Share of a joint's recordings that must show an effect.
_SHARE = 0.5
# Span of position, rad, over which two ripples count as the same frequency: one movement to and
# fro over most joints' range.
_SPAN = 2.0
# Effects that need the rest of the arm.
_OF_THE_ARM = ('other_joints', 'rigid_body', 'carried_load_friction')


@dataclass(frozen=True)
class Compared:
    """A parameter that is compared from unit to unit.

    Where several columns belong to it, it is their amplitude: where a ripple begins depends on how
    the encoder was mounted.
    """

    name: str
    unit: str  # A stands for the unit of the recordings
    columns: tuple[int, ...]
    positive: bool = False  # by nature


@dataclass(frozen=True)
class CommonModel:
    """Eq. 6 and effects with common constants, of one joint of all units."""

    transition: tuple[float, float]  # steepness, s/rad, and shift, rad/s, of Eq. 6
    terms: tuple[Term, ...]
    sizes: tuple[int, ...]      # number of coefficients of each term

    @classmethod
    def of(cls, models: Sequence[FrictionModel]) -> CommonModel:
        """Return the common model of a joint's recordings, from the model of each.

        Its effects are those of at least half of the models. The constants of an effect are those
        of the model whose constant is the median.
        """
        sizes = {Term(type(effect), dict(effect.values)): len(effect.coefficients)
                 for model in models for effect in model.effects}
        candidates = [[Term(type(effect), dict(effect.values)) for effect in model.effects
                       if effect.name in EFFECTS and effect.holds_on_another_day
                       and effect.name not in _OF_THE_ARM] for model in models]
        terms = _shared(candidates, _SHARE * len(models))
        steepness = float(np.median([model.sigmoid.steepness for model in models]))
        return cls((steepness, 0.0), tuple(terms), tuple(sizes[term] for term in terms))

    def sums(self, recorded: Sequence[Samples], like: FrictionModel, declared: bool) -> BlockSums:
        """Return the sums of a unit's recordings over blocks of time, which suffice for any fit.

        They are those of the columns of Eq. 6 and of the terms in their order, with the drive and
        the differentiation of the model `like`. `declared` tells whether the torque constant and
        the gear ratio of the drive are known. Raises InputError if the recordings cannot be used.
        """
        raw, drive = join(recorded), like.drive if declared else Drive(1.0, 1.0)
        rows, _ = prepare(raw, drive, like.differentiation or None, declared)
        for term in self.terms:
            term.kind.check_signals(rows.samples)
        table = Table(rows, *self.transition)
        if len(table.add(self.terms)) < len(self.terms):
            raise InputError('an effect is not finite in the recordings')
        return table.sums.part(table.indices(self.terms)).merged(table.block)

    @property
    def columns(self) -> list[int]:
        """Indices of the columns of sums that are fitted, the derivatives of Eq. 6 left out."""
        return [*range(EQ6_LINEAR), *range(EQ6_COLUMNS, EQ6_COLUMNS + sum(self.sizes))]

    def _of_terms(self, first: int) -> list[tuple[Term, tuple[int, ...]]]:
        """Return the terms with the indices of their columns, the first of which is `first`."""
        ends = first + np.cumsum((0, *self.sizes))
        return [(term, tuple(range(int(begin), int(end))))
                for term, begin, end in zip(self.terms, ends, ends[1:])]

    def compared(self) -> list[Compared]:
        """Return the parameters that are compared from unit to unit."""
        named = [Compared('offset', 'A', (0,)), Compared('coulomb', 'A', (1,), True),
                 Compared('viscous', 'A·s/rad', (2,), True)]
        for term, columns in self._of_terms(EQ6_COLUMNS):
            label, names = _label(term), list(term.kind.coefficient_names)
            names += [(f'coefficient {k + 1}', 'A') for k in range(len(names), len(columns))]
            signs = [*term.kind.signs_with(term.constants), *[0] * len(columns)]
            if 'frequency' in term.constants:
                named.append(Compared(f'{label}: amplitude', 'A', columns, True))
            else:
                named += [Compared(label if len(columns) == 1 else f'{label}: {what}', unit,
                                   (column,), sign > 0)
                          for (what, unit), column, sign in zip(names, columns, signs)]
        return named

    def model(self, coefficients: np.ndarray, like: FrictionModel) -> FrictionModel:
        """Return a model with coefficients, shape (len(columns),); the rest is that of another."""
        values = coefficients.tolist()
        offset, coulomb, viscous = values[:EQ6_LINEAR]
        # Effects are valid over the same ranges as in that model.
        ranges = {term: next((effect.valid_range for effect in like.effects if term.same_effect(
            Term(type(effect), dict(effect.values)), _SPAN)), None) for term in self.terms}
        effects = [term.kind({**term.constants, 'coefficients': [values[k] for k in columns]},
                             ranges[term]) for term, columns in self._of_terms(EQ6_LINEAR)]
        return FrictionModel(
            like.drive, Sigmoid(offset + coulomb, offset - coulomb, *self.transition, viscous),
            effects=effects, joint=like.joint, differentiation=dict(like.differentiation))


def _label(term: Term) -> str:
    name, constants = term.kind.name.replace('_', ' '), term.constants
    if term.kind.max_count == 1:
        return name
    if 'frequency' in constants:
        return f'{name} of {constants["frequency"]:.3g} waves per turn'
    return f'{name} at {constants.get("position", 0.0):.3g} rad'


def _shared(candidates: Sequence[Sequence[Term]], fewest: float) -> list[Term]:
    """Return the terms that at least `fewest` of the models have, the most frequent first."""
    remaining = [list(terms) for terms in candidates]
    shared: list[Term] = []

    def models_with(term: Term) -> int:
        return sum(any(term.same_effect(other, _SPAN) for other in terms) for terms in remaining)
    while every := [term for terms in remaining for term in terms]:
        # A hundred terms, evenly spread, tell which are frequent.
        frequent = max(every[::-(-len(every) // 100)], key=models_with)
        if models_with(frequent) < fewest:
            break
        alike = [term for term in every if frequent.same_effect(term, _SPAN)]
        # The constants are those of the one whose first searched constant is the median.
        searched = [name for name, search in frequent.kind.constants.items() if search is not None]
        alike.sort(key=lambda term: [float(term.constants[name]) for name in searched[:1]])
        shared.append(alike[len(alike) // 2 if searched else 0])
        remaining = [[other for other in terms if not frequent.same_effect(other, _SPAN)]
                     for terms in remaining]
    return shared
