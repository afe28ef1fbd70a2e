# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The torque that a planned motion needs: a model without what a plan does not tell.

A plan has no load, no temperature and no time since the drive was cold: effects of these are left
out. An effect with memory (hysteresis) has the value that it reaches in steady sliding.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.effects.definitions import Signals
from friction_comp.model.sliding_friction import torque_per_unit, unit_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from friction_comp.model.effects import Effect
    from friction_comp.model.friction_model import FrictionModel

_PLANNED = {'acceleration', 'rigid_body', 'coupling'}


def of_plan(model: FrictionModel) -> tuple[FrictionModel, list[str]]:
    """Return a model with the effects that a plan determines, and the names of the others."""
    kept: list[Effect] = []
    others: list[Effect] = []
    for effect in model.effects:
        known = set(effect.needs) <= _PLANNED and effect.holds_on_another_day
        (kept if known else others).append(effect)
    return replace(model, effects=kept), [effect.name for effect in others]


def feed_forward_torque(model: FrictionModel, position: ArrayLike, velocity: ArrayLike,
                        acceleration: ArrayLike = 0.0) -> Any:
    """Return what `FrictionModel.feed_forward` does."""
    gain = torque_per_unit(model, unit_of(model))
    if gain is None:
        raise InputError(f'the unit of the model is {unit_of(model)}: without torque constant and '
                         'gear ratio it gives no torque')
    for effect in model.effects:
        if {'rigid_body', 'coupling'} & set(effect.needs):
            raise InputError(f"effect '{effect.name}' needs the motion of the whole arm: predict "
                             'takes its plan')
    q, v, a = (np.asarray(values, dtype=float) for values in (position, velocity, acceleration))
    if not np.isfinite(q + v + a).all():
        raise InputError('position, velocity and acceleration must be finite')
    current = model.sigmoid(v)
    for effect in of_plan(model)[0].effects:
        current = current + _current(effect, q, v, a)
    torque = gain * current + 0.0 * (q + a)
    return torque if np.ndim(torque) else float(torque)


def _current(effect: Effect, position: Any, velocity: Any, acceleration: Any) -> Any:
    """Return the current of an effect in states that do not follow each other, A."""
    ends = effect.valid_range
    position, velocity, acceleration = (
        np.clip(values, *ends[name]) if name in ends else values
        for name, values in (('position', position), ('velocity', velocity),
                             ('acceleration', acceleration)))
    constants = effect.Constants(**effect.values)
    transition = effect.values.get('transition')
    sign = np.tanh(velocity / transition) if transition else 0.0 * velocity
    memory = effect.start(sign, constants) if effect.has_memory else 0.0
    columns = effect.columns(Signals(0.0, position, velocity, acceleration, sign=sign,
                                     memory=memory), constants)
    return sum(one * column for one, column in zip(effect.coefficients, columns, strict=True))
