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
from friction_comp.model.effects import Effect, EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.effect_columns import EQ6_COLUMNS, EQ6_LINEAR, Table, Term
from friction_comp.refinement.prepare import join, prepare
from friction_comp.samples import Samples

# Effects that need the rest of the arm.
_OF_THE_ARM = ('other_joints', 'rigid_body', 'carried_load_friction')


@dataclass(frozen=True)
class Compared:
    """A parameter that is compared from unit to unit."""

    name: str
    unit: str  # A stands for the unit of the recordings
    column: int     # among the coefficients
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

        Its effects are those of at least half of the models; ripples and bumps are in its error,
        since where they are depends on how each unit was mounted. The constants of an effect are
        those of the model whose first constant is the median.
        """
        found: dict[str, list[Effect]] = {}
        for effect in (effect for model in models for effect in model.effects):
            if effect.max_count == 1 and effect.holds_on_another_day and (
                    effect.name in EFFECTS and effect.name not in _OF_THE_ARM):
                found.setdefault(effect.name, []).append(effect)
        shared = [sorted(alike, key=lambda one: list(one.values.values())[:1])[len(alike) // 2]
                  for alike in found.values() if 2 * len(alike) >= len(models)]
        steepness = float(np.median([model.sigmoid.steepness for model in models]))
        return cls((steepness, 0.0), tuple(Term(type(one), dict(one.values)) for one in shared),
                   tuple(len(one.coefficients) for one in shared))

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
        columns = table.indices(self.terms)
        # 16 blocks of time: what repeats scatters over time; regimes would count what is missing.
        block = np.argsort(np.argsort(rows.start)) * 16 // len(rows.start)
        return BlockSums.over(np.vstack((table.columns[columns], table.target)), block,
                              table.sums.signs[columns])

    @property
    def columns(self) -> list[int]:
        """Indices of the columns of sums that are fitted, the derivatives of Eq. 6 left out."""
        return [*range(EQ6_LINEAR), *range(EQ6_COLUMNS, EQ6_COLUMNS + sum(self.sizes))]

    def _of_terms(self) -> list[tuple[Term, range]]:
        """Return the terms, each with the indices of its coefficients."""
        ends = EQ6_LINEAR + np.cumsum((0, *self.sizes))
        return [(term, range(int(begin), int(end)))
                for term, begin, end in zip(self.terms, ends, ends[1:])]

    def compared(self) -> list[Compared]:
        """Return the parameters that are compared from unit to unit."""
        named = [Compared('offset', 'A', 0), Compared('coulomb', 'A', 1, True),
                 Compared('viscous', 'A·s/rad', 2, True)]
        for term, columns in self._of_terms():
            label, names = term.kind.name.replace('_', ' '), list(term.kind.coefficient_names)
            signs = [*term.kind.signs_with(term.constants), *[0] * len(columns)]
            named += [Compared(label if len(columns) == 1 else f'{label}: {what}', unit, column,
                               sign > 0)
                      for (what, unit), column, sign in zip(names, columns, signs)]
        return named

    def model(self, coefficients: np.ndarray, like: FrictionModel) -> FrictionModel:
        """Return a model with coefficients, shape (len(columns),); the rest is that of another."""
        values = coefficients.tolist()
        offset, coulomb, viscous = values[:EQ6_LINEAR]
        # Effects are valid over the same ranges as in that model.
        ranges = {effect.name: effect.valid_range for effect in like.effects}
        effects = [term.kind({**term.constants, 'coefficients': [values[k] for k in columns]},
                             ranges.get(term.kind.name)) for term, columns in self._of_terms()]
        return FrictionModel(
            like.drive, Sigmoid(offset + coulomb, offset - coulomb, *self.transition, viscous),
            effects=effects, joint=like.joint, differentiation=dict(like.differentiation))
