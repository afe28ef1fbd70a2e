# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction that depends on the past: hysteresis, backlash, rest time, warm-up and drift."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from friction_comp.model.effects.base import (
    Coverage,
    Effect,
    NEITHER,
    SearchRange,
    Signals,
    too_coarse,
)
from friction_comp.model.effects.steps import backlash_step, dahl_step, rest_step

# Motors and gears warm up over minutes; below this time in s, other effects look the same.
_SHORTEST = 30.0


def _range(coverage: Coverage) -> float:
    """Return the range of position, of a radian at most: no gear yields over more than a part."""
    return min(coverage.span, 1.0)


def _shortest_reversal(coverage: Coverage, steps: float = 3.0) -> float:
    return max(1e-4 * _range(coverage), steps * coverage.resolution)


def _distance_search(width: float, largest: float, steps: float = 3.0) -> SearchRange:
    """Return the search of a distance over steps that are resolved, up to a share of the range."""
    def limits(coverage: Coverage, _: dict[str, float]) -> tuple[float, float]:
        shortest = _shortest_reversal(coverage, steps)
        return shortest, max(largest * _range(coverage), 2.0 * shortest)
    return SearchRange(width, limits=limits)


def _hardly_reversed(coverage: Coverage) -> str:
    return '' if coverage.reversals >= 3 else (
        'The joint reversed its motion fewer than three times: effects of reversals cannot be '
        'seen.')


def _hardly_rested(coverage: Coverage) -> str:
    return '' if coverage.rest_duration >= 1.0 else (
        'The joint hardly ever rested: stiction that grows with the time at rest cannot be seen.')


def _hardly_warmed(coverage: Coverage) -> str:
    return '' if coverage.temperature_span >= 2.0 else (
        'Motor temperature varied by less than 2 °C: its effect cannot be seen.')


def _too_short(coverage: Coverage) -> str:
    return '' if coverage.duration >= _SHORTEST else (
        f'The longest recording lasts {coverage.duration:.3g} s: warm-up and other drift '
        'take minutes and cannot be seen.')


class Hysteresis(Effect):
    """``A·z + B·dz/dt`` with Dahl's state z over a presliding distance.

    A is the part of Coulomb friction that reverses with the distance since the reversal; the
    sigmoid keeps the part that reverses with velocity. B is the damping of the bristles in
    the LuGre model (Canudas de Wit et al. 1995), in A·s.
    """

    name = 'hysteresis'
    coefficient_names = (('friction that reverses', 'A'), ('friction during the reversal', 'A'))
    variable = 'history'
    # Beyond these exponents, presliding reverses at once, or never.
    constants = {
        'distance': _distance_search(1.6, 0.25),
        'exponent': SearchRange(1.5, limits=lambda *_: (0.3, 3.0)), 'transition': None}
    tried = {'distance': lambda coverage: np.geomspace(
        min(max(3e-4 * _range(coverage), 3.0 * coverage.resolution), 0.02 * _range(coverage)),
        0.15 * _range(coverage), 12), 'exponent': (1.0,)}
    shown_by = (_hardly_reversed, too_coarse)
    signs = (1,)
    has_memory = True
    fed_back_in_motion = True
    summary = ('Hysteresis: {A:.3g} A of friction reverse over {distance:.3g} rad after a '
               'reversal')
    equation = '{A:+.5g}·z {B:+.5g}·dz/dt'
    state_equation = 'dz/dq = (1 - z·sgn(v))^{exponent:.5g}/{distance:.5g}'
    step = staticmethod(dahl_step)

    @staticmethod
    def start(sign: Any, c: Any) -> Any:
        # At the start of a segment in motion, the reversal is complete.
        return sign

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        remaining = np.maximum(1.0 - x.memory * np.sign(x.velocity), 0.0)
        return (x.memory, x.velocity * remaining ** c.exponent / c.distance)

    def dahl_friction(self) -> tuple[float, float]:
        """Return Dahl's friction, and the distance with an exponent of 1 for the same half rise."""
        p = self.values['exponent']
        reach = math.log(2.0) if abs(p - 1.0) < 1e-6 else (0.5 ** (1.0 - p) - 1.0) / (p - 1.0)
        return self.coefficients[0], reach / math.log(2.0) * self.values['distance']


class Backlash(Effect):
    """``A·z``, with z = 0 across a gap after each reversal, then rising to ±1 over a distance.

    What rubs lies behind a backlash: it is pushed from one side or from the other, elastically, and
    slides where it is pushed with A. The sigmoid keeps the friction before the backlash.
    """

    name = 'backlash'
    form_of = Hysteresis
    coefficient_names = (('friction behind the backlash', 'A'),)
    variable = 'history'
    # The joint must cross both at each reversal.
    constants = {
        'gap': _distance_search(1.6, 0.4), 'distance': _distance_search(2.5, 0.25),
        'transition': None}
    shown_by = Hysteresis.shown_by
    signs = (1,)
    has_memory = True
    fed_back_in_motion = True
    summary = ('Backlash: {A:.3g} A of friction are absent over {gap:.3g} rad after a reversal, '
               'and return over {distance:.3g} rad')
    equation = '{A:+.5g}·b'
    state_equation = ('b = sgn(u)·max(0, |u| - {gap:.5g}/2)/{distance:.5g}, where u moves with q '
                      'up to |b| = 1')
    step = staticmethod(backlash_step)

    @classmethod
    def grid(cls, coverage: Coverage) -> list[dict[str, float]]:
        span, shortest = coverage.span, _shortest_reversal(coverage)
        return [{'gap': gap, 'distance': max(share * gap, shortest)}
                for gap in np.geomspace(min(10.0 * shortest, 0.02 * span), 0.25 * span, 6).tolist()
                for share in (0.1, 0.7)]

    @staticmethod
    def start(sign: Any, c: Any) -> Any:
        return sign * (0.5 * c.gap + c.distance)

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        pushed = np.maximum(np.abs(x.memory) - 0.5 * c.gap, 0.0) / c.distance
        return (np.sign(x.memory) * pushed,)

    def dahl_friction(self) -> tuple[float, float]:
        return self.coefficients[0], self.values['distance'] + 0.5 * self.values['gap']


class RestTime(Effect):
    """``A·tanh(v/v_t)·s``: s grows with the time at rest and fades over a distance of motion."""

    name = 'rest_time'
    fades_in_sliding = True
    coefficient_names = (('stiction after a long rest', 'A'),)
    variable = 'history'
    # With a time constant above the duration it is linear in time; below 0.1 s constant at rest.
    constants = {
        'time_constant': SearchRange(1.8, limits=lambda coverage, _: (
            0.1, max(5.0 * coverage.duration, 0.2))),
        'distance': _distance_search(1.8, 0.5, 1.0), 'velocity': None, 'transition': None}
    tried = {
        'velocity': lambda coverage: tuple(x * coverage.slowest for x in (1.0, 0.25, 0.06)),
        'time_constant': np.geomspace(0.3, 30.0, 5),
        'distance': lambda coverage: np.geomspace(2e-3 * coverage.span, 0.2 * coverage.span, 5)}
    shown_by = (_hardly_rested,)
    signs = (1,)
    has_memory = True
    summary = ('Rest time: up to {A:+.3g} A more friction after resting (time constant '
               '{time_constant:.2g} s), lost over {distance:.2g} rad')
    equation = '{A:+.5g}·tanh(v/{transition:.5g})·r'
    state_equation = ('r grows at rest to 1 - exp(-t/{time_constant:.5g}) and fades in motion with '
                      'exp(-|Δq|/{distance:.5g})')
    step = staticmethod(rest_step)

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (x.sign * x.memory,)


def _changed_friction(x: Signals, change: Any) -> tuple[Any, ...]:
    """Return columns of Coulomb and viscous friction that change, and of unequal directions."""
    return (x.sign * change, x.velocity * change, x.sign * x.sign * change)


# The factor of such columns.
_CHANGED = ('+({A:+.5g}·tanh(v/{transition:.5g}) {B:+.5g}·v '
            '{C:+.5g}·tanh(v/{transition:.5g})^2)')


class Temperature(Effect):
    """``(A·s + B·v + C·s²)·(T - T0)``, s = tanh(v/v_t): friction changes with temperature.

    A is Coulomb and B viscous friction; C is for directions that change differently.
    """

    name = 'temperature'
    coefficient_names = (('Coulomb friction per kelvin', 'A/K'),
                         ('viscous friction per kelvin', 'A·s/(rad·K)'),
                         ('offset per kelvin', 'A/K'))
    variable = 'temperature'
    needs = ('temperature',)
    # Friction falls almost linearly over tens of kelvin.
    range_margins = {'temperature': 1.0}
    constants = {'reference_temperature': None, 'transition': None}
    tried = {'reference_temperature': lambda coverage: (coverage.temperature,)}
    shown_by = (_hardly_warmed,)
    summary = ('Temperature: per kelvin Coulomb friction changes by {A:+.3g} A and viscous '
               'friction by {B:+.3g} A per rad/s')
    equation = _CHANGED + '·(T - {reference_temperature:.5g})'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return _changed_friction(x, x.temperature - c.reference_temperature)


class OffsetDrift(Effect):
    """``A·exp(-t/τ)``: a drifting current independent of the direction, t as in `WarmUp`."""

    name = 'offset_drift'
    coefficient_names: tuple[tuple[str, str], ...] = (('offset at the start', 'A'),)
    variable = 'time'
    role = NEITHER
    holds_on_another_day = False
    not_fed_back = ('a drifting offset of the current sensor is no torque; fed back it could push '
                    'an untouched joint')
    # Slower, it is a straight line in time; faster, it covers only a few movements.
    constants: dict[str, SearchRange | None] = {'time_constant': SearchRange(
        1.7, limits=lambda coverage, _: (0.02 * coverage.duration, 5.0 * coverage.duration))}
    tried = {'time_constant': lambda coverage: np.geomspace(
        coverage.duration / 30.0, 5.0 * coverage.duration, 9)}
    shown_by = (_too_short,)
    summary = 'Offset drift: {A:+.3g} A at the start, fading with {time_constant:.3g} s'
    equation = '{A:+.5g}·exp(-t/{time_constant:.5g})'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (np.exp(-np.maximum(x.time, 0.0) / c.time_constant),)


class WarmUp(OffsetDrift):
    """``(A·s + B·v + C·s²)·exp(-t/τ)``, s = tanh(v/v_t), t from the start of each recording.

    C is for directions whose friction (Eq. 6 has two plateaus) changes differently.
    """

    name = 'warm_up'
    coefficient_names = (('Coulomb friction at the start', 'A'),
                         ('viscous friction at the start', 'A·s/rad'),
                         ('offset at the start', 'A'))
    role = Effect.role
    not_fed_back = ('the temperature of the motor when the compensator starts is not known; fed '
                    'back it would over-compensate a drive that is already warm')
    constants = {**OffsetDrift.constants, 'transition': None}
    summary = ('Warm-up: {A:+.3g} A of Coulomb and {B:+.3g} A per rad/s of viscous friction at the '
               'start, fading with {time_constant:.3g} s')
    equation = _CHANGED + '·exp(-t/{time_constant:.5g})'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return _changed_friction(x, *OffsetDrift.columns(x, c))
