# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction, or an offset, that drifts with the time since the recording began."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.model.effects.base import Effect, geometric
from friction_comp.model.effects.scene import NEITHER, SearchRange

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Scene, Signals

# Motors and gears warm up over minutes; below this time in s, other effects look the same.
SHORTEST = 30.0


class _Drift(Effect):
    variable = 'time'
    holds_on_another_day = False

    @classmethod
    def limited(cls, name: str, value: float, constants: dict[str, float], scene: Scene) -> float:
        """Slower than this is a straight line in time; faster, a matter of a few movements."""
        if name == 'time_constant':
            return min(max(value, 0.02 * scene.duration), 5.0 * scene.duration)
        return value

    @classmethod
    def insufficient_data(cls, scene: Scene) -> str:
        """Return why a short recording shows nothing of it."""
        if scene.duration >= SHORTEST:
            return ''
        return (f'The longest recording lasts {scene.duration:.3g} s: warm-up and other drift take '
                'minutes and cannot be seen.')

    @classmethod
    def holds_offset(cls, scene: Scene) -> bool:
        """A constant says where the drift leads to."""
        return True


class WarmUp(_Drift):
    """``(A·s + B·v + C·s²)·exp(-t/τ)``, s = tanh(v/v_t), t from the start of each recording.

    The last term is there because friction that differs between the directions (Eq. 6 has two
    plateaus) also changes differently.
    """

    name = 'warm_up'
    numbers = (('Coulomb friction at the start', 'A'),
               ('viscous friction at the start', 'A·s/rad'),
               ('offset at the start', 'A'))
    not_fed_back = ('how warm the motor is when the compensator starts is not known; fed back it '
                    'would over-compensate a drive that is warm already')
    constants = {'time_constant': SearchRange(1.7), 'transition': None}

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """Time constants from a thirtieth of the recording to five times its length."""
        return [{'time_constant': value, 'transition': scene.transition}
                for value in geometric(scene.duration / 30.0, 5.0 * scene.duration, 9)]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return three columns."""
        fade = np.exp(-np.maximum(x.time, 0.0) / c.time_constant)
        return (x.side * fade, x.velocity * fade, x.side * x.side * fade)

    def describe(self) -> str:
        """Return the effect in words."""
        a, b, _ = self.coefficients
        return (f'Warm-up: {a:+.3g} A of Coulomb and {b:+.3g} A per rad/s of viscous friction at '
                f'the start, fading with {self.values["time_constant"]:.3g} s')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        a, b, even = self.coefficients
        c = self.values
        return (f'({a:+.4g}·s {b:+.4g}·v {even:+.4g}·s²)'
                f'·exp(-t/{c["time_constant"]:.4g}), s = tanh(v/{c["transition"]:.3g})')


class OffsetDrift(_Drift):
    """``A·exp(-t/τ)``: a current that drifts whatever the direction, t as in `WarmUp`."""

    name = 'offset_drift'
    numbers = (('offset at the start', 'A'),)
    role = NEITHER
    not_fed_back = ('a drifting offset of the current sensor is no torque; fed back it could push '
                    'an untouched joint')
    constants = {'time_constant': SearchRange(1.7)}

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """Time constants as in `WarmUp`."""
        return [{'time_constant': value}
                for value in geometric(scene.duration / 30.0, 5.0 * scene.duration, 9)]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return one column."""
        return (np.exp(-np.maximum(x.time, 0.0) / c.time_constant),)

    def describe(self) -> str:
        """Return the effect in words."""
        return (f'Offset drift: {self.coefficients[0]:+.3g} A at the start, fading with '
                f'{self.values["time_constant"]:.3g} s')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        return f'{self.coefficients[0]:+.4g}·exp(-t/{self.values["time_constant"]:.4g})'
