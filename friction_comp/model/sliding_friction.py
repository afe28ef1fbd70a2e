# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The numbers that people ask of a model: Coulomb and viscous friction, offset, inertia.

Coulomb friction is what remains of friction at any speed of a joint that slides, viscous friction
what grows with the speed: a straight line through the model's friction over the speeds of the
recording, with the sign change of Eq. 6 taken as sudden. For Eq. 6 alone these are its own
parameters. Effects that fade in sliding (Stribeck) are friction near standstill, and belong to
neither. A hysteresis, whose friction the sigmoid lacks, belongs to Coulomb friction.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
import math

import numpy as np

from friction_comp.checks import check_number
from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.definitions import RESISTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import LINE
from friction_comp.samples import Samples

# rad/s, if a model does not tell the speeds at which it was measured.
_TOP_SPEED = 1.0
# Speeds of the line, and points over the range of position.
_SPEEDS, _POINTS = 12, 720
# A transition so short, rad/s, that every speed of the line is beyond it.
_SUDDEN = 1e-9


@dataclass(frozen=True)
class Sliding:
    """Sweeps at constant speeds over a range of position, in both directions."""

    speeds: tuple[float, ...]               # rad/s
    limits: tuple[float, float] = (-math.pi, math.pi)   # rad

    @classmethod
    def of(cls, model: FrictionModel, top_speed: float | None = None) -> Sliding:
        """Return sweeps at the speeds of a model: of its recording, or up to its top speed."""
        limits = model.position_limits or cls.limits
        if model.recorded is not None and model.recorded.speeds and top_speed is None:
            return cls(model.recorded.speeds, limits)
        top_speed = top_speed or model.largest_speed(_TOP_SPEED)
        check_number(top_speed, 'the top speed', above=0.0)
        return cls(tuple((np.arange(1, _SPEEDS + 1) * top_speed / _SPEEDS).tolist()), limits)

    def samples(self) -> tuple[Samples, np.ndarray]:
        """Return the sweeps, and which samples are past a first tenth, where presliding is over."""
        low, high = self.limits
        path = np.linspace(low, high, _POINTS)
        zero, parts = np.zeros(_POINTS), []
        for speed in self.speeds:
            for sign in (1.0, -1.0):
                parts.append(Samples(
                    time=(path - low) / speed, position=path if sign > 0 else path[::-1],
                    current=zero, velocity=np.full(_POINTS, sign * speed), acceleration=zero))
        return (Samples.concatenate(parts),
                np.tile(np.arange(_POINTS) >= _POINTS // 10, len(parts)))

    def lines(self, effects: Iterable[Effect]) -> list[np.ndarray]:
        """Return offset, Coulomb and viscous friction of each coefficient of some effects.

        Each array has the shape (3, M) of `LINE` and the effect's M coefficients; zero where
        `is_sliding_friction` is not.
        """
        effects = list(effects)
        zero = [np.zeros((len(LINE), len(effect.coefficients))) for effect in effects]
        counts = [is_sliding_friction(effect) for effect in effects]
        if not any(counts):
            return zero
        motion, late = self.samples()
        speed = np.asarray(motion.velocity)[late]
        base = np.column_stack((np.ones(len(speed)), np.sign(speed), speed))
        solve = np.linalg.pinv(base)
        return [np.column_stack([
            solve @ one.current(motion)[late] for one in _by_coefficient(sudden(effect))])
            if own else none for effect, own, none in zip(effects, counts, zero)]


def is_sliding_friction(effect: Effect) -> bool:
    """Return whether an effect is friction of a joint that slides, warm and without load."""
    return (effect.role == RESISTS and not effect.fades_in_sliding
            and effect.holds_on_another_day and not effect.needs)


def _by_coefficient(effect: Effect) -> list[Effect]:
    units = np.eye(len(effect.coefficients)).tolist()
    return [type(effect)({**effect.values, 'coefficients': unit}, effect.valid_range)
            for unit in units]


def sudden(effect: Effect) -> Effect:
    """Return the effect with a sudden sign change of friction."""
    if 'transition' not in effect.values:
        return effect
    return type(effect)({**effect.parameters, 'transition': _SUDDEN}, effect.valid_range)


def line_of(model: FrictionModel, top_speed: float | None = None) -> dict[str, float]:
    """Return offset (A), Coulomb (A) and viscous friction (A·s/rad) of a sliding joint."""
    line = np.array(model.sigmoid.line)
    for effect, own in zip(model.effects, Sliding.of(model, top_speed).lines(model.effects)):
        line += own @ np.asarray(effect.coefficients)
    return dict(zip(LINE, line.tolist()))


def inertia_of(model: FrictionModel) -> float | None:
    """Return the coefficient of the acceleration, A·s²/rad; None if it was not found."""
    own = [effect.coefficients[0] for effect in model.effects if effect.name == 'inertia']
    if own:
        return float(sum(own))
    simulated = model.simulation.get('inertia')
    return None if simulated is None else float(simulated) / model.drive.torque_per_current


def near_standstill(model: FrictionModel, coulomb: float) -> float | None:
    """Return Coulomb with Stribeck friction, A; None if the model has no Stribeck friction."""
    heights = [effect.coefficients[0] for effect in model.effects if effect.name == 'stribeck']
    return coulomb + sum(heights) if heights else None
