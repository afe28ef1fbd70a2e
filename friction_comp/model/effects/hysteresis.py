# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Presliding hysteresis: friction that takes some distance to turn round (Dahl, LuGre)."""

from __future__ import annotations

import math
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.compiling import njit
from friction_comp.model.effects.base import Effect, geometric, segment_starts
from friction_comp.model.effects.scene import SearchRange, too_coarse

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Scene, Signals
    from friction_comp.samples import Samples


@njit(cache=True)
def dahl_step(state: float, dt: float, dq: float, velocity: float, c: Any) -> float:
    """Return Dahl's state z after a step of position, solved exactly.

    dz/dq = (1 - z·sgn(dq))^p / distance (Dahl 1968): p = 1 reverses exponentially, p < 1
    within a finite distance, p > 1 more slowly.

    Parameters
    ----------
    state : float
        z in -1..1.
    dt, dq, velocity : float
        s, rad, rad/s; only the step of position counts.
    c : namedtuple
        ``distance`` in rad, ``exponent`` p.

    Returns
    -------
    float
    """
    if dq == 0.0:
        return state
    side = 1.0 if dq > 0.0 else -1.0
    left = 1.0 - side * state
    if left <= 0.0:
        return side
    travel = abs(dq) / c.distance
    if abs(c.exponent - 1.0) < 1e-6:
        left *= math.exp(-travel)
    else:
        power = left ** (1.0 - c.exponent) - (1.0 - c.exponent) * travel
        left = power ** (1.0 / (1.0 - c.exponent)) if power > 0.0 else 0.0
    return side * (1.0 - left)


@njit(cache=True)
def _dahl_states(position: np.ndarray, broken: np.ndarray, start: np.ndarray,
                 c: Any) -> np.ndarray:
    states = np.empty(len(position))
    for k in range(len(position)):
        states[k] = start[k] if broken[k] else dahl_step(
            states[k - 1], 0.0, position[k] - position[k - 1], 0.0, c)
    return states


class Hysteresis(Effect):
    """``A·z + B·dz/dt`` with Dahl's state z over a presliding distance.

    A is the part of Coulomb friction that reverses with the distance since the reversal; the
    sigmoid keeps the part that reverses with velocity. B is the damping of the bristles in
    the LuGre model (Canudas de Wit et al. 1995), in A·s.
    """

    name = 'hysteresis'
    numbers = (('friction that turns round', 'A'), ('friction while it turns round', 'A'))
    variable = 'history'
    constants = {'distance': SearchRange(1.6), 'exponent': SearchRange(1.5), 'transition': None}
    signs = (1,)
    has_memory = True
    fades_at_rest = True

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """Distances from a few steps of position to an eighth of the range."""
        span = scene.highest - scene.lowest
        if not span > 0:
            return []
        lowest = max(3e-4 * span, 3.0 * scene.resolution)
        return [{'distance': value, 'exponent': 1.0, 'transition': scene.transition}
                for value in geometric(min(lowest, 0.02 * span), 0.15 * span, 12)]

    step = staticmethod(dahl_step)

    @staticmethod
    def start(side: Any, c: Any) -> Any:
        """A stretch that begins in motion has slid far enough before."""
        return side

    @classmethod
    def memory(cls, samples: Samples, side: Any, c: Any) -> Any:
        """Return Dahl's state at every sample, shape (N,)."""
        position = np.ascontiguousarray(samples.position, dtype=float)
        return _dahl_states(position, segment_starts(samples), side, c)

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return two columns: the state, and its change with time in 1/s."""
        left = np.maximum(1.0 - x.memory * np.sign(x.velocity), 0.0) ** c.exponent
        return (x.memory, x.velocity * left / c.distance)

    @classmethod
    def limited(cls, name: str, value: float, constants: dict[str, float], scene: Scene) -> float:
        """Keep it presliding: reversing over resolved steps, and well within the range.

        Beyond these exponents it reverses at once, or never.
        """
        if name == 'exponent':
            return min(max(value, 0.3), 3.0)
        if name == 'distance':
            lowest = max(1e-4 * scene.span, 3.0 * scene.resolution)
            return min(max(value, lowest), max(0.25 * scene.span, 2.0 * lowest))
        return value

    @classmethod
    def insufficient_data(cls, scene: Scene) -> str:
        """Return why few reversals or coarse positions show nothing of it."""
        if scene.reversals < 3:
            return (f'The direction of motion changed {scene.reversals:.0f} times: what happens '
                    'at reversals cannot be seen.')
        return too_coarse(scene)

    def turning(self) -> tuple[float, float]:
        """Return Dahl's friction, and the distance at which an exponent of 1 is half turned."""
        p = self.values['exponent']
        reach = math.log(2.0) if abs(p - 1.0) < 1e-6 else (0.5 ** (1.0 - p) - 1.0) / (p - 1.0)
        return self.coefficients[0], reach / math.log(2.0) * self.values['distance']

    def describe(self) -> str:
        """Return the effect in words."""
        return (f'Hysteresis: {self.coefficients[0]:.3g} A of friction turn round over '
                f'{self.values["distance"]:.3g} rad after a reversal')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        c = self.values
        return (f'{self.coefficients[0]:+.4g}·z {self.coefficients[1]:+.4g}·dz/dt, '
                f'dz/dq = (1 - z·sgn(v))^{c["exponent"]:.3g}/{c["distance"]:.3g}')
