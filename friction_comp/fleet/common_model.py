# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The model that all units of a fleet share but for its coefficients.

Parameters can only be compared if they mean the same in every unit. Therefore one model is fitted
to all: Eq. 6 with the effects that most recordings show, with the same constants everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

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
# Most terms that are compared with those of all recordings to find one that most have.
_MOST_TRIED = 100
# Span of position, rad, over which two ripples count as the same frequency: one movement to and
# fro over most joints' range.
_SPAN = 2.0
# Effects that need the rest of the arm.
_OF_THE_ARM = ('other_joints', 'rigid_body')


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

    @classmethod
    def of(cls, models: Sequence[FrictionModel]) -> CommonModel:
        """Return the common model of a joint's recordings, from the model of each.

        Its effects are those of at least half of the models. The constants of an effect are those
        of the model whose constant is the median.
        """
        candidates = [[Term(type(effect), dict(effect.values)) for effect in model.effects
                       if effect.name in EFFECTS and effect.holds_on_another_day
                       and effect.name not in _OF_THE_ARM] for model in models]
        steepness = float(np.median([model.sigmoid.steepness for model in models]))
        return cls((steepness, 0.0), tuple(_shared(candidates, _SHARE * len(models))))

    @classmethod
    def from_model(cls, model: FrictionModel) -> CommonModel:
        """Return the common model of which a model is one unit, with the same effects."""
        return cls((model.sigmoid.steepness, model.sigmoid.shift), tuple(
            Term(type(effect), dict(effect.values)) for effect in model.effects))

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
        size = sum(_size(term) for term in self.terms)
        return [*range(EQ6_LINEAR), *range(EQ6_COLUMNS, EQ6_COLUMNS + size)]

    def compared(self) -> list[Compared]:
        """Return the parameters that are compared from unit to unit."""
        named = [Compared('offset', 'A', (0,)), Compared('coulomb', 'A', (1,), True),
                 Compared('viscous', 'A·s/rad', (2,), True)]
        first = EQ6_COLUMNS
        for term in self.terms:
            columns = tuple(range(first, first + _size(term)))
            label = self._label(term)
            signs = [*term.kind.signs_with(term.constants), *[0] * len(columns)]
            if 'frequency' in term.constants:
                named.append(Compared(f'{label}: amplitude', 'A', columns, True))
            elif len(columns) == 1:
                named.append(Compared(label, _names_of(term)[0][1], columns, signs[0] > 0))
            else:
                named += [Compared(f'{label}: {what}', unit, (column,), sign > 0)
                          for (what, unit), column, sign in zip(_names_of(term), columns, signs)]
            first += _size(term)
        return named

    def _label(self, term: Term) -> str:
        name = term.kind.name.replace('_', ' ')
        if term.kind.max_count == 1:
            return name
        constant = 'frequency' if 'frequency' in term.constants else 'position'
        value = term.constants.get(constant, 0.0)
        return (f'{name} of {value:.3g} waves per turn' if constant == 'frequency'
                else f'{name} at {value:.3g} rad')

    def model(self, coefficients: np.ndarray, like: FrictionModel) -> FrictionModel:
        """Return a model with coefficients, shape (len(columns),); the rest is that of another."""
        offset, coulomb, viscous = map(float, coefficients[:EQ6_LINEAR])
        steepness, shift = self.transition
        effects, first = [], EQ6_LINEAR
        for term in self.terms:
            values = [float(value) for value in coefficients[first:first + _size(term)]]
            # The effect is valid over the same ranges as in that model.
            ranges = next((effect.valid_range for effect in like.effects if term.same_effect(
                Term(type(effect), dict(effect.values)), _SPAN)), None)
            effects.append(term.kind({**term.constants, 'coefficients': values}, ranges))
            first += _size(term)
        return FrictionModel(
            like.drive, Sigmoid(offset + coulomb, offset - coulomb, steepness, shift, viscous),
            effects=effects, joint=like.joint, differentiation=dict(like.differentiation))


def _names_of(term: Term) -> list[tuple[str, str]]:
    known = list(term.kind.coefficient_names)
    return known + [(f'coefficient {k + 1}', 'A') for k in range(len(known), _size(term))]


def _size(term: Term) -> int:
    one = Samples(time=np.zeros(1), position=np.zeros(1), current=np.zeros(1),
                  velocity=np.full(1, 0.1), acceleration=np.zeros(1), load=np.zeros(1),
                  temperature=np.zeros(1))
    return term.kind.matrix(one, term.constants).shape[1]


def _shared(candidates: Sequence[Sequence[Term]], fewest: float) -> list[Term]:
    """Return the terms that at least `fewest` of the models have, the most frequent first."""
    remaining = [list(terms) for terms in candidates]
    shared: list[Term] = []

    def models_with(term: Term) -> int:
        return sum(any(term.same_effect(other, _SPAN) for other in terms) for terms in remaining)
    while every := [term for terms in remaining for term in terms]:
        tried = every[::math.ceil(len(every) / _MOST_TRIED)]
        frequent = max(tried, key=models_with)
        if models_with(frequent) < fewest:
            break
        shared.append(_median_term(
            [other for other in every if frequent.same_effect(other, _SPAN)]))
        remaining = [[other for other in terms if not frequent.same_effect(other, _SPAN)]
                     for terms in remaining]
    return shared


def _median_term(terms: Sequence[Term]) -> Term:
    """Return the term whose first searched constant is the median of those of all."""
    searched = [name for name, search in terms[0].kind.constants.items() if search is not None]
    if not searched:
        return terms[0]
    ordered = sorted(terms, key=lambda term: float(term.constants[searched[0]]))
    return ordered[len(ordered) // 2]
