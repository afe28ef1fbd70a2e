# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A local bump in position, as a worn or broken tooth makes."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.model.effects.base import Effect, geometric
from friction_comp.model.effects.scene import CARRIES, nearly_one_speed, RESISTS, SearchRange

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Look, Scene, Signals

# Positions proposed for each width, and the fewest rows by which one is judged.
_PLACES, _FEWEST = 2, 20


class Bump(Effect):
    """``A·s·exp(-|q - q0|^p/(2·w^p))`` with s = tanh(v/v_t), or s = 1 where `directional` is 0.

    p = 2 is a bell; a larger exponent has a flatter top.
    """

    name = 'bump'
    numbers = (('height', 'A'),)
    variable = 'position'
    most = 3
    constants = {'position': SearchRange(0.5, unit=lambda _, constants: constants['width']),
                 'width': SearchRange(1.5), 'exponent': SearchRange(2.2), 'directional': None,
                 'transition': None}

    def __init__(self, parameters: dict[str, Any]) -> None:
        super().__init__(parameters)
        self.role = RESISTS if self.values['directional'] else CARRIES

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """Widths from a hundredth to an eighth of the range, places half a width apart."""
        span = scene.highest - scene.lowest
        if not span > 0:
            return []
        points = []
        for width in geometric(0.008 * span, 0.12 * span, 5):
            places = np.arange(scene.lowest, scene.highest + 0.5 * width, width)
            points += [{'position': float(position), 'width': width, 'exponent': 2.0,
                        'directional': directional, 'transition': scene.transition}
                       for position in places for directional in (1.0, 0.0)]
        return points

    @classmethod
    def propose(cls, look: Look) -> list[dict[str, float]]:
        """Return for each width the places at which the residual stands out most.

        The mean of the residual over a window is compared with its scatter.
        """
        order = np.argsort(look.position)
        position = look.position[order]
        proposed = []
        shapes: dict[Any, list[dict[str, float]]] = {}
        for constants in cls.grid(look.scene):
            shapes.setdefault((constants['width'], constants['directional']), []).append(constants)
        for (width, directional), points in shapes.items():
            places = np.array([point['position'] for point in points])
            values = (look.residual * (look.side if directional else 1.0))[order]
            low = np.searchsorted(position, places - width)
            high = np.searchsorted(position, places + width)
            sums = np.concatenate(([0.0], np.cumsum(values)))
            count = high - low
            score = np.where(count < _FEWEST, 0.0,
                             (sums[high] - sums[low]) ** 2 / np.maximum(count, 1))
            proposed += [points[k] for k in np.argsort(score)[::-1][:_PLACES]]
        return proposed

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return one column."""
        distance = np.minimum(abs(x.position - c.position) / c.width, 1e6)
        bell = np.exp(-np.minimum(0.5 * distance ** c.exponent, 700.0))
        return (bell * x.side if c.directional else bell,)

    @classmethod
    def limited(cls, name: str, value: float, constants: dict[str, float], scene: Scene) -> float:
        """Keep it in the range, and narrower than it; sharper than this is a step up and down."""
        if name == 'exponent':
            return min(value, 40.0)
        if name == 'position':
            return min(max(value, scene.lowest), scene.highest)
        if name == 'width':
            return min(max(value, 0.002 * scene.span, scene.resolution), 0.2 * scene.span)
        return value

    @classmethod
    def insufficient_data(cls, scene: Scene) -> str:
        """Return why motion at nearly one speed shows none for certain."""
        return nearly_one_speed(scene)

    def describe(self) -> str:
        """Return the effect in words."""
        c = self.values
        kind = 'more friction' if c['directional'] else 'torque in one direction'
        return (f'Bump: {self.coefficients[0]:+.3g} A {kind} at {c["position"]:.4g} rad, '
                f'about {2.4 * c["width"]:.2g} rad wide')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        c = self.values
        side = f'·tanh(v/{c["transition"]:.3g})' if c['directional'] else ''
        return (f'{self.coefficients[0]:+.4g}·exp(-½·(|q - {c["position"]:.4g}|'
                f'/{c["width"]:.3g})^{c["exponent"]:.3g}){side}')
