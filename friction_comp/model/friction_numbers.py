# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The numbers of a model with their intervals and a formula, in its unit of current."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sliding_friction import inertia_of, line_of


@dataclass(frozen=True)
class FrictionNumbers:
    """Friction of a joint that slides, and what belongs to it."""

    offset: float | None  # part of Coulomb friction without motion in both directions
    coulomb: float
    viscous: float
    inertia: float | None
    transition: float
    shift: float
    intervals: dict[str, list[float]]  # 95 %, those that the model holds
    breakaway: dict[str, dict[str, float]] | None
    presliding: dict[str, float] | None  # distance and std, rad
    unit: str
    torque_per_current: float | None  # None where it is not known, as of counts
    inertia_holds: str
    formula: str


def friction_of(model: FrictionModel, unit: str, both_directions: bool = True) -> FrictionNumbers:
    """Return the numbers of a model, in its unit of current, with the intervals that it holds.

    Without motion in both directions, the offset is part of Coulomb friction.
    """
    base = model.sigmoid
    numbers: dict[str, Any] = {
        **line_of(model), 'inertia': inertia_of(model), 'transition': 2.0 / base.steepness}
    if not both_directions:
        numbers['offset'] = None
    intervals = {name: list(ends) for name, value in numbers.items()
                 if value is not None and model.recorded is not None
                 and (ends := model.recorded.interval(name, value))}
    return FrictionNumbers(
        **numbers, shift=base.shift, intervals=intervals,
        breakaway=None if model.breakaway is None else {
            side: {what: getattr(model.breakaway, f'{side}_{what}') for what in ('mean', 'std')}
            for side in ('positive', 'negative')},
        presliding=None if model.presliding is None else {
            name: value for name in ('distance', 'std')
            if (value := getattr(model.presliding, name)) is not None},
        unit=unit, torque_per_current=model.torque_per(unit),
        inertia_holds=inertia_holds(model), formula=_formula_line(numbers, model, unit))


def inertia_holds(model: FrictionModel) -> str:
    """Return what moved with the inertia of a model."""
    if any(effect.name == 'rigid_body' for effect in model.effects):
        return 'the motor, without the links of the URDF'
    return 'the motor with all links that moved'


def _formula_line(numbers: dict[str, Any], model: FrictionModel, unit: str) -> str:
    parts = [f"{numbers['coulomb']:.4g}·tanh(v/{numbers['transition']:.2g})",
             f"{numbers['viscous']:+.4g}·v"]
    if numbers['offset']:
        parts.append(f"{numbers['offset']:+.3g}")
    if numbers['inertia']:
        parts.append(f"{numbers['inertia']:+.4g}·dv/dt")
    others = dict.fromkeys(effect.name.replace('_', ' ') for effect in model.effects
                           if effect.name not in ('inertia', 'hysteresis'))
    spaced = ' '.join(parts).replace(' +', ' + ').replace(' -', ' − ')
    return f'{quantity_in(unit)} = {" + ".join([spaced, *others])}   [{unit}, v in rad/s]'


def quantity_in(unit: str) -> str:
    """Return what an effort in a unit is called: torque, current or effort."""
    return {'N·m': 'torque', 'A': 'current'}.get(unit, 'effort')
