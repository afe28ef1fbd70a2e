# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Stiction that grows with the time at rest."""

from __future__ import annotations

import math
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.compiling import njit
from friction_comp.model.effects.base import Effect, geometric, segment_starts
from friction_comp.model.effects.scene import SearchRange

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Scene, Signals
    from friction_comp.samples import Samples


@njit(cache=True)
def rest_step(state: float, dt: float, dq: float, velocity: float, c: Any) -> float:
    """Return what is left of the strength gained at rest, 0..1, one sample later.

    It grows as 1 - exp(-rest/time_constant) while the speed is below a threshold, and fades over
    a distance of motion.

    Parameters
    ----------
    state : float
    dt, dq, velocity : float
        s, rad, rad/s.
    c : namedtuple
        ``velocity`` (the threshold, rad/s), ``time_constant`` (s), ``distance`` (rad).

    Returns
    -------
    float
    """
    if abs(velocity) < c.velocity:
        return 1.0 - (1.0 - state) * math.exp(-dt / c.time_constant)
    return state * math.exp(-abs(dq) / c.distance)


@njit(cache=True)
def _rest_states(time: np.ndarray, position: np.ndarray, velocity: np.ndarray, broken: np.ndarray,
                 c: Any) -> np.ndarray:
    states = np.zeros(len(position))
    for k in range(len(position)):
        if not broken[k]:
            states[k] = rest_step(states[k - 1], time[k] - time[k - 1],
                                  position[k] - position[k - 1], velocity[k], c)
    return states


class RestTime(Effect):
    """``A·tanh(v/v_t)·s``: s grows with the time at rest and fades over a distance of motion."""

    name = 'rest_time'
    numbers = (('stiction after a long rest', 'A'),)
    variable = 'history'
    constants = {'time_constant': SearchRange(1.8), 'distance': SearchRange(1.8), 'velocity': None,
                 'transition': None}
    signs = (1,)
    has_memory = True

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """Rest from fractions of a second to a minute, fading over up to a fifth of the range."""
        span = scene.highest - scene.lowest
        if not span > 0:
            return []
        return [{'time_constant': constant, 'distance': distance, 'velocity': share * scene.slowest,
                 'transition': scene.transition}
                for share in (1.0, 0.25, 0.06)
                for constant in geometric(0.3, 30.0, 5)
                for distance in geometric(2e-3 * span, 0.2 * span, 5)]

    step = staticmethod(rest_step)

    @classmethod
    def memory(cls, samples: Samples, side: Any, c: Any) -> Any:
        """Return the strength gained at rest at every sample, shape (N,)."""
        return _rest_states(samples.time, samples.position, np.asarray(samples.velocity),
                            segment_starts(samples), c)

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return one column."""
        return (x.side * x.memory,)

    @classmethod
    def insufficient_data(cls, scene: Scene) -> str:
        """Return why a joint that never rests shows nothing of it."""
        if scene.rested >= 1.0:
            return ''
        return ('The joint hardly ever rested: stiction that grows with the time at rest cannot '
                'be seen.')

    @classmethod
    def limited(cls, name: str, value: float, constants: dict[str, float], scene: Scene) -> float:
        """Limit the constants to stiction that grows at rest.

        With a time constant above the recording's duration it is linear in time; below a tenth of a
        second it is constant at rest. A distance below a resolution step or above the range cannot
        be observed.
        """
        if name == 'time_constant':
            return min(max(value, 0.1), max(5.0 * scene.duration, 0.2))
        if name == 'distance':
            lowest = max(scene.resolution, 1e-4 * scene.span)
            return min(max(value, lowest), max(0.5 * scene.span, 2.0 * lowest))
        return value

    def describe(self) -> str:
        """Return the effect in words."""
        c = self.values
        return (f'Rest time: up to {self.coefficients[0]:+.3g} A more friction after resting '
                f'(time constant {c["time_constant"]:.2g} s), lost over {c["distance"]:.2g} rad')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        c = self.values
        return (f'{self.coefficients[0]:+.4g}·tanh(v/{c["transition"]:.3g})'
                f'·(1 - exp(-t_rest/{c["time_constant"]:.3g}))·exp(-Δq/{c["distance"]:.3g})')
