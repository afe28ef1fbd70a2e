# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The torque that a planned motion needs: a model without what a plan does not tell.

A plan has no load, no temperature and no time since the drive was cold: effects of these are left
out. An effect with memory (hysteresis) has the value that it reaches in steady sliding.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.definitions import Signals
from friction_comp.model.sigmoid import Sigmoid

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_PLANNED = {'acceleration', 'rigid_body', 'coupling'}


def of_plan(effects: Iterable[Effect]) -> tuple[list[Effect], list[str]]:
    """Return the effects that a plan determines, and the names of the others."""
    kept: list[Effect] = []
    others: list[str] = []
    for effect in effects:
        if set(effect.needs) <= _PLANNED and effect.holds_on_another_day:
            kept.append(effect)
        else:
            others.append(effect.name)
    return kept, others


def planned_current(sigmoid: Sigmoid, effects: Sequence[Effect], position: ArrayLike,
                    velocity: ArrayLike, acceleration: ArrayLike) -> Any:
    """Return what `FrictionModel.feed_forward` does, in the unit of the model's current."""
    for effect in effects:
        if {'rigid_body', 'coupling'} & set(effect.needs):
            raise InputError(f"effect '{effect.name}' needs the motion of the whole arm: predict "
                             'takes its plan')
    q, v, a = (np.asarray(values, dtype=float) for values in (position, velocity, acceleration))
    if not np.isfinite(q + v + a).all():
        raise InputError('position, velocity and acceleration must be finite')
    current = sigmoid(v) + 0.0 * (q + a)
    for effect in of_plan(effects)[0]:
        current = current + _current(effect, q, v, a)
    return current if np.ndim(current) else float(current)


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
