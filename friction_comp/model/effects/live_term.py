# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates an effect for the compensator, one sample at a time."""

from __future__ import annotations

import math

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.definitions import Signals

SHARPEST_LIVE = 0.01
"""Smallest velocity in rad/s over which a term that is fed back changes sign. A recording may show
a thousandth, but then every encoder count would switch the whole term."""


class LiveTerm:
    """An effect as the compensator evaluates it, one sample at a time, in order of time."""

    def __init__(self, effect: Effect) -> None:
        effect = effect.fed_back()
        values = dict(effect.values)
        self._transition = None
        if 'transition' in values:
            self._transition = values['transition'] = max(values['transition'], SHARPEST_LIVE)
        self._effect, self._constants = effect, effect.Constants(**values)
        self.needs, self.has_memory = effect.needs, effect.has_memory
        self.reset()

    def reset(self) -> None:
        """Forget the motion."""
        self._state: float | None = None
        self._time = self._position = 0.0

    def update(self, time: float, position: float, velocity: float,
               temperature: float | None = None, load: float | None = None,
               rigid_body: float | None = None, coupling: float | None = None) -> float:
        """Return the current in A for this sample; units as in `Signals`, arm at rest."""
        sign = math.tanh(velocity / self._transition) if self._transition else 0.0
        state = self._remember(time, position, velocity)
        # By position, in the order of the fields: arguments by name take twice as long.
        value = self._evaluate(Signals(0.0, position, velocity, 0.0, load, temperature, sign, state,
                                       rigid_body, coupling))
        if self._effect.fed_back_in_motion:
            value *= abs(math.tanh(velocity / SHARPEST_LIVE))
        return value

    def both_sides(self, time: float, position: float, speed: float,
                   temperature: float | None = None, load: float | None = None,
                   rigid_body: float | None = None, coupling: float | None = None
                   ) -> tuple[float, float]:
        """Return the current in A in the positive and in the negative direction; see `update`.

        As after sliding far enough to complete the reversal, which the caller models.
        """
        state = self._remember(time, position, speed)
        values = []
        for sign in (1.0, -1.0):
            turned = float(self._effect.start(sign, self._constants))
            values.append(self._evaluate(Signals(
                0.0, position, sign * abs(speed), 0.0, load, temperature, sign,
                turned if turned != 0.0 else state, rigid_body, coupling)))
        return values[0], values[1]

    def _evaluate(self, x: Signals) -> float:
        for name, (low, high) in self._effect.valid_range.items():
            value = getattr(x, name)
            # Rarely, since replacing takes longer than evaluating an effect.
            if value is not None and not low <= value <= high:
                x = x._replace(**{name: min(max(value, low), high)})
        total = 0.0
        for gain, column in zip(self._effect.coefficients,
                                self._effect.columns(x, self._constants)):
            total += gain * column
        return float(total)

    def _remember(self, time: float, position: float, velocity: float) -> float:
        if not self.has_memory:
            return 0.0
        if self._state is None:
            self._state = float(self._effect.start(0.0, self._constants))
        else:
            self._state = self._effect.step(
                self._state, max(0.0, time - self._time), position - self._position, velocity,
                self._constants)
        self._time, self._position = time, position
        return self._state
