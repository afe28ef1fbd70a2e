# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Ripple over position: cogging, and friction that changes with every tooth."""

from __future__ import annotations

import math
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.scene import CARRIES, SearchRange, Signals
from friction_comp.model.effects.spectrum import (
    FEWEST_PERIODS,
    highest_frequency,
    peaks,
    position_spectrum,
)

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Look, Scene

# Frequencies proposed for each shape.
_PEAKS = 4


class _Ripple(Effect):
    variable = 'position'
    most = 4
    numbers = (('part with the cosine of the phase', 'A'), ('part with the sine of the phase', 'A'))
    constants = {
        'frequency': SearchRange(1.0, unit=lambda scene, _: math.pi / max(scene.span, 1e-12)),
        'growth': None, 'speed': None, 'transition': None}
    # Its amplitude at the speeds that were seen; over position it repeats.
    held = {'velocity': 0.25}
    _word = ''

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """With or without growth with the speed; the frequency comes from a spectrum."""
        return [{'growth': growth, 'speed': scene.speed, 'transition': scene.transition}
                for growth in (0.0, 1.0)]

    @classmethod
    def propose(cls, look: Look) -> list[dict[str, float]]:
        """Return the frequencies at which the residual swings most over position."""
        scene, proposed = look.scene, []
        highest = highest_frequency(look.velocity, look.row_time, scene.resolution)
        separation = 2.0 * math.pi / max(scene.span, 1e-9)
        for constants in cls.grid(scene):
            c = cls.Constants(frequency=0.0, **constants)
            signals = Signals(position=look.position, velocity=look.velocity, side=look.side)
            # At frequency zero the first column is the amplitude itself.
            k, power = position_spectrum(
                look.position, look.residual, cls.columns(signals, c)[0], highest)
            proposed += [{'frequency': frequency, **constants}
                      for frequency in peaks(k, power, _PEAKS, separation)]
        return proposed

    @classmethod
    def limited(cls, name: str, value: float, constants: dict[str, float], scene: Scene) -> float:
        """With fewer periods over the range it is no ripple."""
        if name == 'frequency':
            return max(value, 2.0 * math.pi * FEWEST_PERIODS / max(scene.span, 1e-9))
        return value

    def describe(self) -> str:
        """Return the effect in words."""
        size = math.hypot(*self.coefficients)
        with_speed = (f' at {self.values["speed"]:.2g} rad/s, growing with speed'
                      if self.values['growth'] else '')
        return (f'{self._word}: {size:.3g} A{with_speed}, {self.values["frequency"]:.5g} times a '
                'turn')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        a, b = self.coefficients
        k = self.values['frequency']
        grown = (f'·(|v|/{self.values["speed"]:.3g})^{self.values["growth"]:g}'
                 if self.values['growth'] else '')
        return f'({a:+.4g}·cos({k:.6g}·q) {b:+.4g}·sin({k:.6g}·q)){grown}{self._suffix()}'

    def _suffix(self) -> str:
        return ''


class Cogging(_Ripple):
    """``(A·cos(kq) + B·sin(kq))·(|v|/v_ref)^g``, independent of the direction of motion."""

    name = 'cogging'
    role = CARRIES
    _word = 'Cogging'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return cos and sin over position, times |v|^growth."""
        amplitude, phase = (abs(x.velocity) / c.speed) ** c.growth, c.frequency * x.position
        return (amplitude * np.cos(phase), amplitude * np.sin(phase))


class FrictionRipple(_Ripple):
    """``(A·cos(kq) + B·sin(kq))·tanh(v/v_t)·(|v|/v_ref)^g``: changes sign with the direction."""

    name = 'friction_ripple'
    _word = 'Friction ripple'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return cos and sin over position, times |v|^growth and the sign of friction."""
        amplitude = x.side * (abs(x.velocity) / c.speed) ** c.growth
        phase = c.frequency * x.position
        return (amplitude * np.cos(phase), amplitude * np.sin(phase))

    def _suffix(self) -> str:
        return f'·tanh(v/{self.values["transition"]:.3g})'
