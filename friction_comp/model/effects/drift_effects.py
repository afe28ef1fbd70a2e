# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction that changes with the motor's temperature or, where it is unknown, with time."""

from __future__ import annotations

from typing import Any

import numpy as np

from friction_comp.model.effects.base import Effect, geometric
from friction_comp.model.effects.scene import NEITHER, Scene, SearchRange, Signals

# Motors and gears warm up over minutes; below this time in s, other effects look the same.
_SHORTEST = 30.0


class Temperature(Effect):
    """``(A·s + B·v + C·s²)·(T - T0)``, s = tanh(v/v_t): friction changes with temperature.

    A is Coulomb and B viscous friction; C is for directions that change differently.
    """

    name = 'temperature'
    numbers = (('Coulomb friction per kelvin', 'A/K'),
               ('viscous friction per kelvin', 'A·s/(rad·K)'),
               ('offset per kelvin', 'A/K'))
    variable = 'temperature'
    needs = ('temperature',)
    # Friction falls almost linearly over tens of kelvin, so it is extrapolated to twice the range
    # seen.
    held = {'temperature': 1.0}
    constants = {'reference_temperature': None, 'transition': None}
    words = ('Temperature: per kelvin Coulomb friction changes by {A:+.3g} A and viscous friction '
             'by {B:+.3g} A per rad/s')
    equation = ('({A:+.4g}·s {B:+.4g}·v {C:+.4g}·s²)·(T - {reference_temperature:.3g}), '
                's = tanh(v/{transition:.3g})')

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """The reference is a convention: the median temperature of the recordings."""
        return [{'reference_temperature': scene.temperature, 'transition': scene.transition}]

    @classmethod
    def insufficient_data(cls, scene: Scene) -> str:
        if scene.temperature_span >= 2.0:
            return ''
        return 'Motor temperature varied by less than 2 °C: its effect cannot be seen.'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        difference = x.temperature - c.reference_temperature
        return (x.side * difference, x.velocity * difference, x.side * x.side * difference)


class OffsetDrift(Effect):
    """``A·exp(-t/τ)``: a current that drifts whatever the direction, t as in `WarmUp`."""

    name = 'offset_drift'
    numbers: tuple[tuple[str, str], ...] = (('offset at the start', 'A'),)
    variable = 'time'
    role = NEITHER
    holds_on_another_day = False
    not_fed_back = ('a drifting offset of the current sensor is no torque; fed back it could push '
                    'an untouched joint')
    # Slower than this is a straight line in time; faster, a matter of a few movements.
    constants: dict[str, SearchRange | None] = {'time_constant': SearchRange(
        1.7, limits=lambda scene, _: (0.02 * scene.duration, 5.0 * scene.duration))}
    words = 'Offset drift: {A:+.3g} A at the start, fading with {time_constant:.3g} s'
    equation = '{A:+.4g}·exp(-t/{time_constant:.4g})'

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """Time constants from a thirtieth of the recording to five times its length."""
        return [{'time_constant': value}
                for value in geometric(scene.duration / 30.0, 5.0 * scene.duration, 9)]

    @classmethod
    def insufficient_data(cls, scene: Scene) -> str:
        if scene.duration >= _SHORTEST:
            return ''
        return (f'The longest recording lasts {scene.duration:.3g} s: warm-up and other drift take '
                'minutes and cannot be seen.')

    @classmethod
    def holds_offset(cls, scene: Scene) -> bool:
        """A constant says where the drift leads to."""
        return True

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (np.exp(-np.maximum(x.time, 0.0) / c.time_constant),)


class WarmUp(OffsetDrift):
    """``(A·s + B·v + C·s²)·exp(-t/τ)``, s = tanh(v/v_t), t from the start of each recording.

    The last term is there because friction that differs between the directions (Eq. 6 has two
    plateaus) also changes differently.
    """

    name = 'warm_up'
    numbers = (('Coulomb friction at the start', 'A'),
               ('viscous friction at the start', 'A·s/rad'),
               ('offset at the start', 'A'))
    role = Effect.role
    not_fed_back = ('how warm the motor is when the compensator starts is not known; fed back it '
                    'would over-compensate a drive that is warm already')
    constants = {**OffsetDrift.constants, 'transition': None}
    words = ('Warm-up: {A:+.3g} A of Coulomb and {B:+.3g} A per rad/s of viscous friction at the '
             'start, fading with {time_constant:.3g} s')
    equation = ('({A:+.4g}·s {B:+.4g}·v {C:+.4g}·s²)·exp(-t/{time_constant:.4g}), '
                's = tanh(v/{transition:.3g})')

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        return [{**constants, 'transition': scene.transition} for constants in super().grid(scene)]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        fade = np.exp(-np.maximum(x.time, 0.0) / c.time_constant)
        return (x.side * fade, x.velocity * fade, x.side * x.side * fade)
