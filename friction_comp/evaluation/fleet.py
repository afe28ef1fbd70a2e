# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the units of a fleet by the numbers that refinement gives of their recordings.

Those that are positive by nature are compared on a logarithmic scale, so that a factor counts the
same up and down.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
import json
import math
from typing import Any

import numpy as np

from friction_comp.files import plain
from friction_comp.statistics import CONFIDENCE, student_quantile

# Fewest units that tell something about their spread.
FEWEST_UNITS = 4
NUMBERS = {'coulomb': ('Coulomb', 'A', True), 'viscous': ('viscous', 'A·s/rad', True),
           'offset': ('offset', 'A', False), 'inertia': ('inertia', 'A·s²/rad', True)}
"""What is compared, by its name in `FrictionNumbers`: title, unit with A for that of the recording,
and whether it is positive by nature."""
# Half of a 95 % interval, in standard errors.
_HALF = 1.96
_TINY = 1e-300


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
    document = {'format': 'friction_comp_fleet', 'version': 2,
                'joints': [{**asdict(one), 'out': one.out} for one in populations]}
    return json.dumps(plain(document, not_finite=None), indent=1, ensure_ascii=False) + '\n'


def populations_of(rows: Sequence[dict[str, Any]]) -> list[Population]:
    """Return the population of each joint that `FEWEST_UNITS` units have.

    A row is a recording: `joint`, `unit` of its current, `robot`, and `friction` with value and
    ends of the 95 % interval of those of `NUMBERS` that have one.
    """
    groups: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
    for row in rows:
        groups[row['joint'], row['unit']].append(row)
    enough = [(*key, own) for key, own in groups.items() if _robots(own) >= FEWEST_UNITS]
    return [Population(
        joint, unit, sorted({row['robot'] for row in own}), len(own),
        [_parameter(name, own, unit, len(enough) * len(NUMBERS)) for name in NUMBERS
         if _robots([row for row in own if name in row['friction']]) >= FEWEST_UNITS])
            for joint, unit, own in enough]


def _robots(rows: Sequence[dict[str, Any]]) -> int:
    return len({row['robot'] for row in rows})


def _parameter(name: str, rows: Sequence[dict[str, Any]], unit: str, tests: int
               ) -> ParameterSpread:
    """Return the spread of one of `NUMBERS` over the rows that have it."""
    from scipy.special import chdtri

    title, own_unit, positive = NUMBERS[name]
    rows = [row for row in rows if name in row['friction']]
    values, low, high = np.array([row['friction'][name] for row in rows], dtype=float).T
    errors = (high - low) / (2.0 * _HALF)
    robots, index, count = np.unique([row['robot'] for row in rows], return_inverse=True,
                                     return_counts=True)
    # Where zero is possible there are no factors.
    logarithmic = positive and bool(
        (values > 0.0).all() and np.median(values - 2.0 * errors) > 0.0)
    if logarithmic:
        values, errors = np.log(values), errors / values
    own = np.bincount(index, values) / count
    # Recordings of one unit differ by no less than their errors, and alike in all units.
    repeated = len(values) - len(robots)
    day = float(np.sum((values - own[index]) ** 2)) / repeated if repeated else 0.0
    error = np.sqrt(np.maximum(np.bincount(index, errors ** 2) / count, day) / count)
    out = units_out(own, error, tests)
    usual, measured = own[~out], float(np.mean(error[~out] ** 2))
    middle, variance, others = float(usual.mean()), float(usual.var(ddof=1)), len(usual) - 1
    back = np.exp if logarithmic else np.asarray

    def ends(at: float, half: float) -> tuple[float, float]:
        return float(back(at - half)), float(back(at + half))
    spread = math.sqrt(max(variance - measured, 0.0))
    return ParameterSpread(
        name=title, unit=own_unit.replace('A', unit, 1),
        scale='logarithmic' if logarithmic else 'linear', mean=float(back(middle)), spread=spread,
        range=ends(middle, float(student_quantile(others)) * math.hypot(
            spread, math.sqrt(variance / len(usual)))),
        varies=variance * others > measured * float(chdtri(others, 0.5 - 0.5 * CONFIDENCE)),
        units=[UnitValue(str(robot), float(back(own[k])), ends(own[k], _HALF * error[k]),
                         bool(out[k])) for k, robot in enumerate(robots)])


def units_out(value: np.ndarray, error: np.ndarray, tests: int = 1) -> np.ndarray:
    """Return which of N units are out, (N,), by their values with standard errors.

    The most extreme unit is removed again and again, and all that were removed up to the last
    significant one are out, so that several cannot hide each other (generalised extreme Studentised
    deviate; Rosner 1983). With `tests` parameters, 5 % is the probability that any unit is called
    out in any of them although none is. More than a quarter are no exceptions.
    """
    from scipy.special import stdtr

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
        t = abs(value[index] - usual.mean()) / math.sqrt(variance + _TINY)
        p_value = 2.0 * stdtr(len(usual) - 1, -t)
        if p_value * (len(value) - k) < (1.0 - CONFIDENCE) / tests:
            significant = k + 1
    return np.isin(np.arange(len(value)), removed[:significant])
