# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A joint's population: mean and spread of each parameter over the units of a fleet.

Parameters can only be compared if they mean the same in every unit. Therefore one model is fitted
to all: Eq. 6 with the effects that most recordings show, with the same constants everywhere. Those
that are positive by nature are compared on a logarithmic scale, so that a factor counts the same up
and down.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
import json
import math
import re
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import Effect, EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement.block_sums import BlockSums, squared_errors
from friction_comp.refinement.effect_columns import EQ6_COLUMNS, EQ6_LINEAR, Table, Term
from friction_comp.refinement.prepare import join, prepare
from friction_comp.results import plain
from friction_comp.samples import Samples
from friction_comp.statistics import CONFIDENCE, student_quantile, student_tail

# Effects that need the rest of the arm.
_OF_THE_ARM = ('other_joints', 'rigid_body', 'carried_load_friction')
# Fewest units that tell something about their spread.
FEWEST_UNITS = 4
_TINY = 1e-300
# The error of the common model, compared like a parameter: a unit with an effect that no other has
# shows by it. No model is exact: that it describes a unit a little worse than others says nothing.
ERROR, _LARGER_ERROR = 'error of the common model', 1.5


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


@dataclass(frozen=True)
class UnitValue:
    """A unit's value of a parameter."""

    unit: str
    value: float
    interval: tuple[float, float]
    out: bool


@dataclass(frozen=True)
class ParameterSpread:
    """A parameter's mean and spread over the units that are not out.

    On a logarithmic scale, `mean` is the geometric mean and `spread` the standard deviation of the
    logarithm: about the relative one.
    """

    name: str
    unit: str  # of the parameter, not of the spread on a logarithmic scale
    scale: str  # 'logarithmic' or 'linear'
    mean: float
    spread: float  # without what errors of measurement explain
    range: tuple[float, float]  # of a further unit, 95 %
    varies: bool    # whether the spread can be told from zero
    units: list[UnitValue] = field(default_factory=list)


@dataclass(frozen=True)
class Population:
    """The units of one joint of a fleet."""

    joint: str
    unit: str  # of the recordings' current
    units: list[str]
    recordings: int
    parameters: list[ParameterSpread]
    model: FrictionModel  # with the mean coefficients of the population

    @property
    def file_name(self) -> str:
        """The name of the model file with the mean, without its ending."""
        return re.sub(r'[^\w.-]', '_', f'population_{self.joint}'.rstrip('_'))

    @property
    def out(self) -> dict[str, list[str]]:
        """The units that are out, each with the names of the parameters in which it is."""
        found: dict[str, list[str]] = {}
        for parameter in self.parameters:
            for value in parameter.units:
                if value.out:
                    found.setdefault(value.unit, []).append(parameter.name)
        return dict(sorted(found.items()))


def fleet_json(populations: Sequence[Population]) -> str:
    """Return the content of fleet.json."""
    joints = [{**{name: getattr(one, name) for name in ('joint', 'unit', 'units', 'recordings',
                                                        'out')},
               'parameters': [asdict(parameter) for parameter in one.parameters],
               'model': one.model.to_dict()} for one in populations]
    document: dict[str, Any] = {'format': 'friction_comp_fleet', 'version': 1, 'joints': joints}
    return json.dumps(plain(document, not_finite=None), indent=1, ensure_ascii=False) + '\n'


@dataclass(frozen=True)
class _Estimate:
    """The fit of the common model to one recording; with P coefficients."""

    values: np.ndarray  # (P,)
    errors: np.ndarray  # (P, P): covariance, from fits that leave out a block each
    rms: float
    rms_error: float  # standard error of the logarithm of `rms`
    freedom: float


def _estimate(common: CommonModel, sums: BlockSums) -> _Estimate:
    """Return a recording's coefficients with the covariance of the jackknife."""
    chosen, count = common.columns, len(sums.rows)
    with_derivatives = range(len(sums.signs))
    left_out = sums.fits(with_derivatives, 1.0 - np.eye(count))
    deviations = (left_out - left_out.mean(axis=0))[:, chosen]
    # Errors of the fit to all blocks: one block may hold the only slow motion.
    squares = squared_errors(sums.gram, sums.fit(with_derivatives)[None]) / np.maximum(sums.rows, 1)
    mean = float(np.average(squares, weights=sums.rows))
    spread = float(np.std(squares, ddof=1)) / math.sqrt(count) / max(mean, 1e-300)
    return _Estimate(
        values=sums.fit(with_derivatives)[chosen],
        errors=(count - 1) / count * deviations.T @ deviations, rms=math.sqrt(mean),
        # The logarithm of a root is half of that of the mean square.
        rms_error=0.5 * spread, freedom=count - 1.0)


def population_of(recordings: Sequence[tuple[str, BlockSums]], common: CommonModel,
                  like: FrictionModel, unit: str, tests: int = 1) -> Population:
    """Return the population of one joint.

    `recordings` are names of units with `CommonModel.sums`, and `unit` is that of their current;
    drive, joint and differentiation are those of the model `like`. `tests` is the number of joints
    compared at the same time. Raises InputError if there are fewer than `FEWEST_UNITS` units.
    """
    units_of = [name for name, _ in recordings]
    names, index = np.unique(units_of, return_inverse=True)
    if len(names) < FEWEST_UNITS:
        raise InputError(f'{len(names)} units are too few to compare: at least {FEWEST_UNITS} are '
                         'needed')
    fits = [_estimate(common, sums) for _, sums in recordings]
    # The error's own error is that of most recordings: a bump that is met in a few blocks makes
    # these large, and would hide itself behind the scatter of the blocks.
    rms = np.array([fit.rms for fit in fits])
    values = np.array([fit.values for fit in fits])
    errors = np.sqrt([np.diag(fit.errors) for fit in fits])
    compared = [*((one, values[:, one.column], errors[:, one.column])
                  for one in common.compared()),
                (Compared(ERROR, 'A', -1, True),
                 rms, rms * float(np.median([fit.rms_error for fit in fits])))]
    # Leave out what no recording shows, such as an offset in motion to one side.
    compared = [entry for entry in compared if entry[2].all()]
    parameters = [_parameter(*entry, unit, units_of, fits[0].freedom, tests * len(compared))
                  for entry in compared]
    most = _LARGER_ERROR * parameters[-1].mean
    parameters[-1] = replace(parameters[-1], units=[
        replace(value, out=value.out and value.value > most) for value in parameters[-1].units])
    out = np.array([any(one.units[k].out for one in parameters) for k in range(len(names))])
    means = np.median(values[~out[index]], axis=0)
    for (one, _, _), parameter in zip(compared[:-1], parameters):
        means[one.column] = parameter.mean
    model = replace(common.model(means, like), notes={
        'units': int(len(names) - out.sum()), 'unit': unit})
    return Population(
        joint=like.joint, unit=unit, units=names.tolist(), recordings=len(recordings),
        parameters=parameters, model=model)


def _parameter(one: Compared, values: np.ndarray, errors: np.ndarray, unit: str,
               units_of: Sequence[str], freedom: float, tests: int) -> ParameterSpread:
    """Return the spread of a parameter from its values in all recordings, of `units_of`."""
    from scipy.special import chdtri

    names, index, count = np.unique(units_of, return_inverse=True, return_counts=True)
    # Where zero is possible there are no factors.
    logarithmic = one.positive and bool(
        (values > 0.0).all() and np.median(values - 2.0 * errors) > 0.0)
    if logarithmic:
        values, errors = np.log(values), errors / values
    own = np.bincount(index, values) / count
    # Recordings of one unit differ by no less than their errors, and alike in all units.
    repeated = len(values) - len(names)
    day = float(np.sum((values - own[index]) ** 2)) / repeated if repeated else 0.0
    error = np.sqrt(np.maximum(np.bincount(index, errors ** 2) / count, day) / count)
    out = units_out(own, error, tests)
    usual, measured = own[~out], float(np.mean(error[~out] ** 2))
    middle, variance, others = float(usual.mean()), float(usual.var(ddof=1)), len(usual) - 1
    back = np.exp if logarithmic else np.asarray

    def ends(at: float, half: float) -> tuple[float, float]:
        return float(back(at - half)), float(back(at + half))
    spread = math.sqrt(max(variance - measured, 0.0))
    half = float(student_quantile(freedom)) * error
    return ParameterSpread(
        name=one.name, unit=one.unit.replace('A', unit, 1),
        scale='logarithmic' if logarithmic else 'linear', mean=float(back(middle)), spread=spread,
        range=ends(middle, float(student_quantile(others)) * math.hypot(
            spread, math.sqrt(variance / len(usual)))),
        varies=variance * others > measured * float(chdtri(others, 0.5 - 0.5 * CONFIDENCE)),
        units=[UnitValue(str(name), float(back(own[k])), ends(own[k], half[k]), bool(out[k]))
               for k, name in enumerate(names)])


def units_out(value: np.ndarray, error: np.ndarray, tests: int = 1) -> np.ndarray:
    """Return which of N units are out, (N,), by their values with standard errors.

    The most extreme unit is removed again and again, and all that were removed up to the last
    significant one are out, so that several cannot hide each other (generalised extreme Studentised
    deviate; Rosner 1983). With `tests` parameters, 5 % is the probability that any unit is called
    out in any of them although none is. More than a quarter are no exceptions.
    """
    inside, removed, significant = np.ones(len(value), dtype=bool), [], 0
    for k in range(len(value) // 4):
        left = np.flatnonzero(inside)
        # The unit farthest from the others, beyond what its own error explains.
        index = int(left[np.argmax(np.abs(value[left] - value[left].mean()) / np.sqrt(
            value[left].var() + error[left] ** 2 + _TINY))])
        inside[index] = False
        removed.append(index)
        usual = value[inside]
        variance = usual.var(ddof=1) * (1.0 + 1.0 / len(usual)) + max(
            0.0, error[index] ** 2 - float(np.mean(error[inside] ** 2)))
        p_value = student_tail((value[index] - usual.mean()) / math.sqrt(variance + _TINY),
                               len(usual) - 1)
        if p_value * (len(value) - k) < (1.0 - CONFIDENCE) / tests:
            significant = k + 1
    return np.isin(np.arange(len(value)), removed[:significant])
