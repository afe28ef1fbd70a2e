# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A joint's population: mean and spread of each parameter over the units of a fleet.

A recording's value is that of the population, plus a deviation of the unit, one of the day, and an
error of measurement. Only the last is known; the others follow from how much more units, and a
unit's recordings, differ than their errors explain. Parameters that are positive by nature are
compared on a logarithmic scale, so that a factor counts the same up and down.

Parameters can only be compared if they mean the same in every unit. Therefore one model is fitted
to all: Eq. 6 with the effects that most recordings show, with the same constants everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
    p: float  # probability of such a deviation in the population
    out: bool
    recordings: int


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
    mean_interval: tuple[float, float]
    spread: float
    spread_interval: tuple[float, float]
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
    names, index = np.unique(units_of, return_inverse=True)
    # Where zero is possible there are no factors.
    logarithmic = one.positive and bool(
        (values > 0.0).all() and np.median(values - 2.0 * errors) > 0.0)
    if logarithmic:
        values, errors = np.log(values), errors / values
    back = np.exp if logarithmic else np.asarray

    def ends(middle: float, half: float) -> tuple[float, float]:
        return float(back(middle - half)), float(back(middle + half))
    units = units_from_recordings(values, errors, index)
    spread = spread_of(units, tests)
    half, counts = float(student_quantile(freedom)) * units.error, np.bincount(index)
    mean_half = float(student_quantile(int((~spread.out).sum()) - 1)) * spread.mean_error
    return ParameterSpread(
        name=one.name, unit=one.unit.replace('A', unit, 1),
        scale='logarithmic' if logarithmic else 'linear',
        mean=float(back(spread.mean)), mean_interval=ends(spread.mean, mean_half),
        spread=spread.deviation, spread_interval=spread.interval,
        range=ends(spread.mean, spread.half_range), varies=spread.interval[0] > 0.0,
        units=[UnitValue(str(name), float(back(units.value[k])), ends(units.value[k], half[k]),
                         float(spread.p_out[k]), bool(spread.out[k]), int(counts[k]))
               for k, name in enumerate(names)])


@dataclass(frozen=True)
class Values:
    """A parameter's values, one for each of N units, with standard errors."""

    value: np.ndarray  # (N,)
    error: np.ndarray  # (N,): of measurement, from recording to recording included


@dataclass(frozen=True)
class Spread:
    """The population of a parameter, without the units that are out."""

    mean: float
    mean_error: float
    deviation: float  # standard deviation between units
    interval: tuple[float, float]  # of the deviation
    p_out: np.ndarray  # (N,): probability of such a value of a unit of the population
    out: np.ndarray  # (N,): which units are out

    @property
    def half_range(self) -> float:
        """Half the range in which 95 % of further units lie."""
        freedom = max(int((~self.out).sum()) - 2, 1)
        return float(student_quantile(freedom)) * math.hypot(self.deviation, self.mean_error)


def units_from_recordings(values: np.ndarray, errors: np.ndarray, unit: np.ndarray) -> Values:
    """Return the value of each unit from those of its recordings, all of shape (R,).

    `errors` are standard errors, and `unit` is the index of each recording's unit. How much a
    unit's recordings differ beyond their errors, for instance because of temperature, is assumed to
    be the same for all units. Where no unit has several recordings, it is part of the spread
    between units.
    """
    count, repeated = int(unit.max()) + 1, len(values) - len(np.unique(unit))

    def means(variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        weights = np.bincount(unit, 1.0 / variance, count)
        return np.bincount(unit, values / variance, count) / weights, weights

    def excess(between: float) -> float:
        variance = between + errors ** 2
        return float(np.sum((values - means(variance)[0][unit]) ** 2 / variance)) - repeated
    day = _root(excess, values) if repeated else 0.0
    middle, weights = means(day + errors ** 2)
    return Values(middle, 1.0 / np.sqrt(weights))


def spread_of(units: Values, tests: int = 1) -> Spread:
    """Return the spread over at least `FEWEST_UNITS` units, and which of them are out.

    The variance between units is that of Paule and Mandel, its interval the Q-profile (Viechtbauer
    2007). The units that are out are found by the generalised extreme Studentised deviate (Rosner
    1983): the most extreme unit is removed again and again, and all that were removed up to the
    last significant one are out, so that several cannot hide each other. With `tests` parameters,
    5 % is the probability that any unit is called out in any of them although none is.
    """
    size, every = len(units.value), np.arange(len(units.value))
    inside, removed, significant = np.ones(size, dtype=bool), [], 0
    # More than a quarter are no exceptions.
    for k in range(size // 4):
        mean, _, variance = _population(units, inside)
        index = int(np.argmax(np.where(
            inside, (units.value - mean) ** 2 / (units.error ** 2 + variance + _TINY), -1.0)))
        inside[index] = False
        removed.append(index)
        if _p_outside(units, inside, index) * (size - k) < (1.0 - CONFIDENCE) / tests:
            significant = k + 1
    out = np.isin(every, removed[:significant])
    mean, mean_error, variance = _population(units, ~out)
    p_values = np.array([_p_outside(units, ~out & (every != k), k) for k in range(size)])
    return Spread(mean=mean, mean_error=mean_error, deviation=math.sqrt(variance),
                  interval=_profile(units, ~out), p_out=p_values, out=out)


def _root(excess: Callable[[float], float], values: np.ndarray) -> float:
    """Return the variance at which a decreasing function is zero, 0 where it begins below."""
    from scipy.optimize import brentq

    high = 4.0 * float(np.var(values)) + _TINY
    if excess(0.0) <= 0.0:
        return 0.0
    while excess(high) > 0.0:
        high *= 4.0
    return float(brentq(excess, 0.0, high, xtol=1e-9 * high))


def _weighted_squares(value: np.ndarray, variance: np.ndarray) -> float:
    mean = np.sum(value / variance) / np.sum(1.0 / variance)
    return float(np.sum((value - mean) ** 2 / variance))


def _population(units: Values, chosen: np.ndarray) -> tuple[float, float, float]:
    """Return mean, its standard error, and variance between units, after Paule and Mandel."""
    value, own = units.value[chosen], units.error[chosen] ** 2
    between = _root(lambda variance: _weighted_squares(value, own + variance) - (len(value) - 1),
                    value)
    weights = 1.0 / (own + between)
    return float(weights @ value / weights.sum()), float(weights.sum() ** -0.5), between


def _profile(units: Values, chosen: np.ndarray) -> tuple[float, float]:
    """Return the interval of the standard deviation between the chosen units."""
    from scipy.special import chdtri

    value, own = units.value[chosen], units.error[chosen] ** 2

    def end(share: float) -> float:
        limit = float(chdtri(len(value) - 1, share))
        return math.sqrt(_root(
            lambda variance: _weighted_squares(value, own + variance) - limit, value))
    return end(0.5 - 0.5 * CONFIDENCE), end(0.5 + 0.5 * CONFIDENCE)


def _p_outside(units: Values, chosen: np.ndarray, index: int) -> float:
    """Return the probability of a unit's deviation from the population of the chosen others."""
    mean, error, between = _population(units, chosen)
    total = units.error[index] ** 2 + between + error ** 2 + _TINY
    return student_tail((units.value[index] - mean) / math.sqrt(total), int(chosen.sum()) - 1)
