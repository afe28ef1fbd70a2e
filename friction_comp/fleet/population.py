# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A joint's population: mean and spread of each parameter over the units of a fleet.

Parameters that are positive by nature are compared on a logarithmic scale, so that a factor counts
the same up and down.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
import json
import math
import re
from typing import Any

import numpy as np

from friction_comp.errors import InputError
from friction_comp.files import plain
from friction_comp.fleet.common_model import CommonModel, Compared
from friction_comp.fleet.spread import FEWEST_UNITS, spread_of, units_from_recordings
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.statistics import student_quantile

# The error of the common model, compared like a parameter: a unit with an effect that no other has
# shows by it. No model is exact: that it describes a unit a little worse than others says nothing.
ERROR, _LARGER_ERROR = 'error of the common model', 1.5


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
    squares = sums.errors_of_fit(with_derivatives) / np.maximum(sums.rows, 1)
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
    compared = [*((one, *_values(fits, common, one.columns)) for one in common.compared()),
                (Compared(ERROR, 'A', (), True),
                 rms, rms * float(np.median([fit.rms_error for fit in fits])))]
    # Leave out what no recording shows, such as an offset in motion to one side.
    compared = [entry for entry in compared if entry[2].all()]
    parameters = [_parameter(one, unit, values, errors, units_of, fits[0].freedom,
                             tests * len(compared)) for one, values, errors in compared]
    most = _LARGER_ERROR * parameters[-1].mean
    parameters[-1] = replace(parameters[-1], units=[
        replace(value, out=value.out and value.value > most) for value in parameters[-1].units])
    out = np.array([any(one.units[k].out for one in parameters) for k in range(len(names))])
    # Where a ripple begins differs from unit to unit: of several columns, any phase will do.
    means = np.median([fit.values for fit, k in zip(fits, index) if not out[k]], axis=0)
    for (one, _, _), parameter in zip(compared, parameters):
        if len(one.columns) == 1:
            means[common.columns.index(one.columns[0])] = parameter.mean
    model = replace(common.model(means, like), notes={
        'units': int(len(names) - out.sum()), 'unit': unit, 'range_of_units': {
            parameter.name: list(parameter.range) for parameter in parameters}})
    return Population(
        joint=like.joint, unit=unit, units=names.tolist(), recordings=len(recordings),
        parameters=parameters, model=model)


def _values(fits: Sequence[_Estimate], common: CommonModel, columns: tuple[int, ...]
            ) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficient of a column in each recording, of several the length of the vector.

    With it its standard error, of a vector that along it.
    """
    where = [common.columns.index(column) for column in columns]
    part = np.array([fit.values[where] for fit in fits])
    size = part[:, 0] if len(where) == 1 else np.sqrt(np.sum(part ** 2, axis=1))
    along = part / np.maximum(np.abs(size), 1e-300)[:, None]
    inner = np.ix_(where, where)
    errors = np.array([a @ fit.errors[inner] @ a for a, fit in zip(along, fits)])
    return size, np.sqrt(np.maximum(errors, 0.0))


def _parameter(one: Compared, unit: str, values: np.ndarray, errors: np.ndarray,
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
    units = units_from_recordings(values, errors, index, freedom)
    spread = spread_of(units, tests)
    half, counts = student_quantile(units.freedom) * units.error, np.bincount(index)
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
