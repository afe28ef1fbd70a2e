# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The effects: friction over velocity, torques and their load, position, and friction of the past.

At positions, effects repeat or occur once: cogging, friction ripple, worn teeth.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

import numpy as np

from friction_comp.model.effect import (
    CARRIES,
    Coverage,
    Effect,
    LOADS,
    NEITHER,
    ResidualView,
    RESISTS,
    SearchRange,
    Signals,
    too_coarse,
    turns_seldom,
)
from friction_comp.model.steps import backlash_step, dahl_step, rest_step


def _speed_varied(coverage: Coverage) -> bool:
    return coverage.speed >= 1.5 * coverage.slow


class Stribeck(Effect):
    """``A·tanh(v/v_t)·exp(-(|v|/v_s)^p)``, the second term of the note's Eq. 2 for p = 1."""

    name = 'stribeck'
    fades_in_sliding = True
    units = ('A',)
    variable = 'velocity'
    # Near the top speed it would be curved viscous friction; near standstill it cannot be seen.
    constants = {'velocity': SearchRange(1.6, limits=lambda coverage, _: (
        0.5 * coverage.slowest, 0.7 * coverage.speed)), 'exponent': None, 'transition': None}
    tried = {'velocity': lambda coverage: np.geomspace(min(0.3 * coverage.speed, max(
        1.5 * coverage.transition, 1.5 * coverage.slowest, 0.003 * coverage.speed)),
        0.7 * coverage.speed, 9), 'exponent': (1.0, 2.0)}
    shown_by = (_speed_varied,)
    summary = ('Stribeck: near standstill friction differs by {A:+.3g} A, fading at about '
               '{velocity:.3g} rad/s')
    equation = '{A:+.5g}·tanh(v/{transition:.5g})·exp(-(|v|/{velocity:.5g})^{exponent:.5g})'
    columns = staticmethod(lambda x, c: (
        x.sign * np.exp(-np.minimum((abs(x.velocity) / c.velocity) ** c.exponent, 700.0)),))


class ViscousShape(Effect):
    """``A·tanh(v/v_t)·(u^p - 6p/((p+1)(p+2))·u)``, u = |v|/v_ref: friction is curved over speed.

    The straight line nearest to u^p up to v_ref is subtracted: otherwise power and linear term
    would partly cancel, and the linear term could be many times too steep. Beyond the recorded
    speeds the effect is constant, and friction continues linearly.
    """

    name = 'viscous_shape'
    units = ('A',)
    variable = 'velocity'
    range_margins = {'velocity': 0.25}
    # Below a fifth it resembles Coulomb friction, near 1 viscous friction; above 3.5, a few fast
    # samples determine it.
    constants = {'exponent': SearchRange(1.3, limits=lambda _, constants: (
        (0.2, 0.85) if constants['exponent'] < 1.0 else (1.2, 3.5))),
        'reference': None, 'transition': None}
    tried = {'exponent': (0.3, 0.45, 0.6, 0.75, 1.4, 1.7, 2.0, 2.5, 3.0),
             'reference': lambda coverage: (coverage.speed,)}
    shown_by = (_speed_varied,)
    summary = 'Viscous shape: friction is curved over speed (power {exponent:.3g})'
    equation = ('{A:+.5g}·tanh(v/{transition:.5g})·((|v|/{reference:.5g})^{exponent:.5g} - '
                '{slope:.5g}·|v|/{reference:.5g})')

    @staticmethod
    def _slope(exponent: float) -> float:
        return 6.0 * exponent / ((exponent + 1.0) * (exponent + 2.0))

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        speed = abs(x.velocity) / c.reference
        return (x.sign * (speed ** c.exponent - ViscousShape._slope(c.exponent) * speed),)

    @classmethod
    def signs_with(cls, constants: dict[str, float]) -> tuple[int, ...]:
        # A root that is subtracted is Stribeck friction, and endlessly steep at standstill.
        return (1,) if constants['exponent'] < 1.0 else (0,)

    def symbols(self) -> dict[str, Any]:
        return {**super().symbols(), 'slope': self._slope(self.values['exponent'])}


class DirectionAsymmetry(Effect):
    """``A·h + B·|v|``: half the difference between the positive and the negative direction.

    If `offset` is 1, h is 1: a constant current, also at rest. If it is 0, h = tanh²(v/v_t):
    Coulomb friction that differs between the directions. Eq. 6 can represent A itself; refinement
    uses this effect instead if it is worth naming.
    """

    name = 'direction_asymmetry'
    units = ('A', 'A·s/rad')
    variable = 'direction'
    constants = {'offset': None, 'transition': None}
    # At rest, breakaway has its own two values.
    live = {'offset': 0.0}
    tried = {'offset': (1.0,)}
    shown_by = (lambda coverage: coverage.both_directions,)
    summary = ('Direction: half of what the positive direction needs more than the negative one is '
               '{A:+.3g} A {B:+.3g} A per rad/s')
    equation = '{A:+.5g}{shape} {B:+.5g}·|v|'
    columns = staticmethod(lambda x, c: (1.0 if c.offset else x.sign ** 2, abs(x.velocity)))

    def symbols(self) -> dict[str, Any]:
        sign = f'·tanh(v/{self.values["transition"]:.5g})^2'
        return {**super().symbols(), 'shape': sign * (not self.values['offset'])}


class Gravity(Effect):
    """``A·cos(q) + B·sin(q)``, independent of the direction of motion."""

    name = 'gravity'
    units = ('A', 'A')
    variable = 'position'
    role = CARRIES
    in_first_model = weight = True
    loads = ('cosine', 'sine')
    # Over a part of a turn gravity is largely a constant.
    offset_within = 2.0
    range_margins = {'position': np.inf}
    # Over less, and on a linear axis, what a weight holds is part of offset and spring.
    shown_by = (lambda coverage: not coverage.linear and coverage.span >= 0.5,)
    summary = ('Gravity-like: {size:.3g} A once a turn, largest at a joint angle of {angle:.0f} '
               'degrees')
    equation = '{A:+.5g}·cos(q) {B:+.5g}·sin(q)'
    columns = staticmethod(lambda x, c: (np.cos(x.position), np.sin(x.position)))


class Spring(Effect):
    """``A·(q - q0)``, independent of the direction of motion, as of a spring or a cable."""

    name = 'spring'
    units = ('A/rad',)
    variable = 'position'
    role = CARRIES
    in_first_model = True
    offset_within = np.inf
    range_margins = {'position': 0.25}
    constants = {'position': None}
    # One is enough: the offset of Eq. 6 accounts for any other rest position.
    tried = {'position': lambda coverage: (0.5 * (coverage.lowest + coverage.highest),)}
    shown_by = (turns_seldom,)
    summary = 'Spring-like: {A:+.3g} A per rad'
    equation = '{A:+.5g}·(q - {position:.5g})'
    columns = staticmethod(lambda x, c: (x.position - c.position,))

    @classmethod
    def load_share(cls, coefficients: Sequence[float], constants: dict[str, float]
                   ) -> dict[str, float]:
        return {'slope': coefficients[0], 'offset': -coefficients[0] * constants['position']}

    def doubt(self) -> str:
        return '' if self.coefficients[0] >= 0.0 else (
            f'The spring of {self.coefficients[0]:.3g} A per rad pushes away from its middle, as '
            'no spring does: it stands for a weight or for other links, and only in positions like '
            'the recorded ones.')


class Inertia(Effect):
    """``J/(k_t·n)·dv/dt``: inertia of motor, gear and limb."""

    name = 'inertia'
    units = ('A·s²/rad',)
    variable = 'acceleration'
    role = CARRIES
    needs = ('acceleration',)
    signs = (1,)
    in_first_model = True
    loads = ('inertia',)
    not_fed_back = (
        'acceleration from the encoder is too late and too noisy: fed back it would lower the '
        'apparent inertia and can destabilise the joint')
    summary = 'Inertia: {A:.4g} A per rad/s²'
    equation = '{A:+.5g}·dv/dt'
    columns = staticmethod(lambda x, c: (x.acceleration,))


class RigidBody(Effect):
    """``k·τ(q, dq/dt, d²q/dt²)``: weight and inertia of all links, from a URDF.

    k is the joint's current per torque of the arm. Only the weight is fed back.
    """

    name = 'rigid_body'
    units = ('A/(N·m)',)
    variable = 'other joints'
    role = CARRIES
    needs = ('rigid_body',)
    signs = (1,)
    in_first_model = weight = True
    summary = ('Weight and inertia of the whole arm: {A:.4g} A per N·m of torque that its links '
               'need at the joint')
    equation = '{A:+.5g}·τ_links'
    columns = staticmethod(lambda x, c: (x.rigid_body,))


class OtherJoints(Effect):
    """The current due to the motion of other joints, found without a URDF."""

    name = 'other_joints'
    variable = 'other joints'
    role = CARRIES
    needs = ('coupling',)
    signs = (1,)
    weight = True
    range_margins = {'coupling': 0.25}
    summary = ('Other joints: weight and inertia that act on this joint through them, as a sum of '
               'terms found in the recording, times {A:.4g}')
    equation = '{A:+.5g}·i_other_joints'
    columns = staticmethod(lambda x, c: (x.coupling,))


class LoadTorque(Effect):
    """``A·τ_b``: the current that the measured torque saves the motor; by mechanics -1/(k_t·n)."""

    name = 'load_torque'
    is_load = True
    units = ('A/(N·m)',)
    variable = 'load'
    role = NEITHER
    in_first_model = True
    needs = ('load',)
    not_fed_back = (
        'feeding the measured interaction torque back is admittance control, which this '
        'compensator is not: the torque sensor is for evaluation only')
    summary = 'Load: {A:+.4g} A per N·m of measured back-driving torque'
    equation = '{A:+.5g}·τ_b'
    columns = staticmethod(lambda x, c: (x.load,))


class LoadFriction(Effect):
    """``A·tanh(v/v_t)·|τ_b|^p``: friction that grows with the measured load on the teeth."""

    name = 'load_friction'
    units = ('A',)
    variable = 'load'
    needs = ('load',)
    signs = (1,)
    range_margins = {'load': 0.25}
    # With a lower power it would be Coulomb friction.
    constants = {'exponent': SearchRange(1.6, limits=lambda *_: (0.3, 3.0)), 'transition': None}
    tried = {'exponent': (1.0, 2.0)}
    summary = ('Load-dependent friction: {A:+.4g} A at 1 N·m of load, growing with its power '
               '{exponent:.3g}')
    equation = '{A:+.5g}·tanh(v/{transition:.5g})·|τ_b|^{exponent:.5g}'
    columns = staticmethod(lambda x, c: (x.sign * abs(x.load) ** c.exponent,))


class CarriedLoadFriction(LoadFriction):
    """``A·tanh(v/v_t)·|τ|^p``: as `LoadFriction`, with the links' torque by the model as load."""

    name = 'carried_load_friction'
    needs = ('rigid_body',)
    range_margins = {}
    constants = {'exponent': SearchRange(1.6, limits=lambda *_: (0.5, 3.0)), 'transition': None}
    summary = LoadFriction.summary.replace('of load', 'that the links need at the joint')
    equation = LoadFriction.equation.replace('τ_b', 'τ_links')
    columns = staticmethod(lambda x, c: (x.sign * abs(x.rigid_body) ** c.exponent,))


class InnerLoadFriction(Effect):
    """``A·tanh(v/v_t)·|L|^p``, fading with speed where `fading` is 1: load-dependent friction.

    L is the current of the other effects of the model that carry a load: gravity, springs, inertia.
    The constants repeat that load, so that the effect can be evaluated alone; a fit keeps them
    equal to those of the model. p = 1 and 2 are the linear and the quadratic load dependence, and
    ``fading`` the Stribeck one, exp(-|v|/v_s), of Duclusaud et al. 2025 (BAM, models M3 to M6).
    Live, the load is that at rest, since accelerations are too late.
    """

    name = 'inner_load_friction'
    units = ('A per A',)
    variable = 'load'
    max_count = 2
    signs = (1,)
    # Without fading, its speed is not searched.
    constants = {**dict.fromkeys(LOADS), 'with_inertia': None, 'exponent': None, 'fading': None,
                 'velocity': SearchRange(1.6, limits=lambda coverage, constants: (
                     (coverage.slowest, 2.0 * coverage.speed) if constants['fading'] else
                     (constants['velocity'], constants['velocity']))), 'transition': None}
    summary = ('Load-dependent friction: {A:.3g} A of friction for 1 A (to the power {exponent:g}) '
               'of the load that gravity or a spring makes')
    equation = ('{A:+.5g}·tanh(v/{transition:.5g})·|{cosine:+.5g}·cos(q) {sine:+.5g}·sin(q) '
                '{slope:+.5g}·q {offset:+.5g} {of_inertia:+.5g}·dv/dt|^{exponent:g}')
    factors = {'fading': '·exp(-|v|/{velocity:.5g})'}

    @classmethod
    def grid(cls, coverage: Coverage) -> list[dict[str, float]]:
        fading = np.geomspace(0.05 * coverage.speed, coverage.speed, 4).tolist()
        shapes = [(1.0, 0.0, coverage.speed), (2.0, 0.0, coverage.speed),
                  *((1.0, 1.0, value) for value in fading)]
        return [{**dict.fromkeys(LOADS, 0.0), 'with_inertia': with_inertia, 'exponent': exponent,
                 'fading': fading, 'velocity': velocity}
                for exponent, fading, velocity in shapes for with_inertia in (0.0, 1.0)]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        load = (c.cosine * np.cos(x.position) + c.sine * np.sin(x.position)
                + c.slope * x.position + c.offset + c.with_inertia * c.inertia * x.acceleration)
        fade = np.exp(-c.fading * np.minimum(abs(x.velocity) / c.velocity, 700.0))
        return (x.sign * abs(load) ** c.exponent * fade,)

    def symbols(self) -> dict[str, Any]:
        return {**super().symbols(),
                'of_inertia': self.values['with_inertia'] * self.values['inertia']}


# Fewest waves over the range of position, to distinguish a wave from a slope.
FEWEST_PERIODS = 1.5


def above_noise(power: np.ndarray) -> np.ndarray:
    """Return which powers of a spectrum no noise has, bool, (M,), but in one of ten spectra.

    Of N powers of white noise about their mean, the largest is about ln N times it, and 2.25 more
    in one of ten cases; the spectrum has four for each. The mean is that of the neighbourhood, one
    of 16, by its median: what is left of a fit is no white noise.
    """
    parts = np.array_split(power, max(1, min(16, len(power) // 64)))
    mean = np.concatenate([np.full(len(part), np.median(part)) for part in parts]) / math.log(2.0)
    return np.asarray(power > mean * (math.log(max(0.25 * len(power), 1.0)) + 2.25))


def spectrum_peaks(view: ResidualView, amplitude: np.ndarray) -> list[float]:
    """Return the spatial frequencies, rad/rad (periods per turn), that would explain most.

    The residual is modelled as amplitude · (a·cos(kq) + b·sin(kq)) with an amplitude of shape (R,).
    A period takes three samples at the slowest quarter of the speeds, and four position steps at
    least. Of a joint that turned often, only harmonics of a turn are returned.
    """
    coverage, span = view.coverage, float(np.ptp(view.position))
    slow = float(np.percentile(np.abs(view.velocity), 25))
    highest = 2.0 * math.pi / max(3.0 * slow * view.sample_time, 4.0 * coverage.resolution, 1e-12)
    energy = float(amplitude @ amplitude)
    if not highest * span > 2.0 * math.pi * FEWEST_PERIODS or energy <= 0.0:
        return []
    bins = min(math.ceil(4 * highest * span / (2.0 * math.pi)) + 1, 1 << 17)
    width = span / bins
    index = np.minimum(((view.position - view.position.min()) / width).astype(np.int64), bins - 1)
    sums = np.bincount(index, amplitude * view.residual, minlength=bins)
    size = 1 << (4 * bins - 1).bit_length()
    k = 2.0 * math.pi * np.fft.rfftfreq(size, width)
    keep = (k >= 2.0 * math.pi * FEWEST_PERIODS / span) & (k <= highest)
    separation = 2.0 * math.pi / coverage.span
    power = np.abs(np.fft.rfft(sums, size)) ** 2
    keep[keep] = above_noise(power[keep])
    if not turns_seldom(coverage):
        near = 0.5 * separation
        keep &= (np.abs(k - np.round(k)) < near) & (k > 1.0 - near)
    k, power = k[keep], power[keep]
    found: list[float] = []
    for row in np.argsort(power)[::-1][:2000]:
        if len(found) < 4 and all(abs(k[row] - other) > separation for other in found):
            found.append(float(k[row]))
    return found


class Cogging(Effect):
    """``(A·cos(kq) + B·sin(kq))·(|v|/v_ref)^g``, independent of the direction of motion."""

    name = 'cogging'
    variable = 'position'
    role = CARRIES
    max_count = 4
    units = ('A', 'A')
    # With fewer periods over the range it is not a ripple.
    constants: dict[str, SearchRange | None] = {
        'frequency': SearchRange(
            1.0, unit=lambda coverage, _: math.pi / coverage.span,
            limits=lambda coverage, _: (2.0 * math.pi * FEWEST_PERIODS / coverage.span, math.inf)),
        'growth': None, 'speed': None, 'transition': None}
    tried = {'growth': (0.0, 1.0), 'speed': lambda coverage: (coverage.speed,)}
    # The amplitude holds at recorded speeds; over position the ripple repeats.
    range_margins = {'velocity': 0.25}
    summary = 'Cogging: {size:.3g} A at {speed:.2g} rad/s, {frequency:.5g} times a turn'
    equation = '+({A:+.5g}·cos({frequency:.7g}·q) {B:+.5g}·sin({frequency:.7g}·q))'
    factors = {'growth': '·(|v|/{speed:.5g})^{growth:g}'}

    @classmethod
    def propose(cls, view: ResidualView) -> list[dict[str, float]]:
        proposed = []
        for constants in cls.points(view.coverage):
            signals = Signals(position=view.position, velocity=view.velocity, sign=view.sign)
            # At frequency zero the first column is the amplitude itself.
            amplitude, _ = cls.columns(signals, cls.Constants(frequency=0.0, **constants))
            proposed += [{'frequency': frequency, **constants}
                         for frequency in spectrum_peaks(view, amplitude)]
        return proposed

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        amplitude, phase = (abs(x.velocity) / c.speed) ** c.growth, c.frequency * x.position
        return (amplitude * np.cos(phase), amplitude * np.sin(phase))


class FrictionRipple(Cogging):
    """``(A·cos(kq) + B·sin(kq))·tanh(v/v_t)·(|v|/v_ref)^g``: changes sign with the direction."""

    name = 'friction_ripple'
    role = RESISTS
    summary = Cogging.summary.replace('Cogging', 'Friction ripple')
    equation = Cogging.equation + '·tanh(v/{transition:.5g})'
    columns = staticmethod(lambda x, c: tuple(x.sign * one for one in Cogging.columns(x, c)))


class Bump(Effect):
    """``A·s·exp(-|q - q0|^p/(2·w^p))`` with s = tanh(v/v_t), or s = 1 where `directional` is 0.

    A local bump, as of a worn or broken tooth: p = 2 gives a bell, larger p a flatter top.
    """

    name = 'bump'
    units = ('A',)
    variable = 'position'
    max_count = 3
    # Within the range, and narrower; a larger exponent is a step, which no motor is given.
    constants = {
        'position': SearchRange(0.5, unit=lambda _, constants: constants['width'],
                                limits=lambda coverage, _: (coverage.lowest, coverage.highest)),
        'width': SearchRange(1.5, limits=lambda coverage, _: (
            max(0.002 * coverage.span, coverage.resolution), 0.2 * coverage.span)),
        'exponent': SearchRange(2.2, limits=lambda *_: (1.0, 10.0)),
        'directional': None, 'transition': None}
    tried = {'position': lambda coverage: (0.5 * (coverage.lowest + coverage.highest),),
             'width': lambda coverage: np.geomspace(0.008 * coverage.span, 0.12 * coverage.span, 5),
             'exponent': (2.0,), 'directional': (1.0, 0.0)}
    # At one speed to and fro, whose spread is 0.25 to 0.35, the few samples of starts and reversals
    # look like bumps; production strokes, several speeds and sines have 0.46 and more.
    shown_by = (turns_seldom, lambda coverage: coverage.speed_spread >= 0.4)
    summary = 'Bump: {A:+.3g} A at {position:.4g} rad, with a width of {width:.2g} rad'
    equation = '{A:+.5g}·exp(-0.5·(|q - {position:.6g}|/{width:.5g})^{exponent:.5g})'
    factors = {'directional': '·tanh(v/{transition:.5g})'}

    def __init__(self, parameters: dict[str, Any],
                 valid_range: dict[str, Any] | None = None) -> None:
        super().__init__(parameters, valid_range)
        self.role = RESISTS if self.values['directional'] else CARRIES

    @classmethod
    def propose(cls, view: ResidualView) -> list[dict[str, float]]:
        """Return for each width where the mean of the residual stands out most from its scatter."""
        order, proposed = np.argsort(view.position), []
        position, span = view.position[order], view.coverage.span
        for constants in cls.points(view.coverage):
            width, values = constants['width'], view.residual * (
                view.sign if constants['directional'] else 1.0)
            # About the middle, so that both directions of position count alike.
            each_way = math.ceil(0.5 * span / width)
            places = constants['position'] + width * np.arange(-each_way, each_way + 1)
            low, high = (np.searchsorted(position, places + way) for way in (-width, width))
            count, sums = high - low, np.concatenate(([0.0], np.cumsum(values[order])))
            score = np.where(count < 20, 0.0,
                             (sums[high] - sums[low]) ** 2 / np.maximum(count, 1))
            proposed += [{**constants, 'position': float(places[k])}
                         for k in np.argsort(score)[::-1][:2]]
        return proposed

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        distance = np.minimum(abs(x.position - c.position) / c.width, 1e6)
        bell = np.exp(-np.minimum(0.5 * distance ** c.exponent, 700.0))
        return (bell * x.sign if c.directional else bell,)


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


class Hysteresis(Effect):
    """``A·z + B·dz/dt`` with Dahl's state z over a presliding distance.

    A is the part of Coulomb friction that reverses with the distance since the reversal; the
    sigmoid keeps the part that reverses with velocity. B is the damping of the bristles in
    the LuGre model (Canudas de Wit et al. 1995), in A·s.
    """

    name = 'hysteresis'
    units = ('A', 'A')
    variable = 'history'
    # Beyond these exponents, presliding reverses at once, or never.
    constants = {
        'distance': _distance_search(1.6, 0.25),
        'exponent': SearchRange(1.5, limits=lambda *_: (0.3, 3.0)), 'transition': None}
    tried = {'distance': lambda coverage: np.geomspace(
        min(max(3e-4 * _range(coverage), 3.0 * coverage.resolution), 0.02 * _range(coverage)),
        0.15 * _range(coverage), 12), 'exponent': (1.0,)}
    shown_by = (lambda coverage: coverage.reversals >= 3 and not too_coarse(coverage),)
    signs = (1,)
    fed_back_in_motion = True
    summary = ('Hysteresis: {A:.3g} A of friction reverse over {distance:.3g} rad after a '
               'reversal')
    equation = '{A:+.5g}·z {B:+.5g}·dz/dt'
    state_equation = 'dz/dq = (1 - z·sgn(v))^{exponent:.5g}/{distance:.5g}'
    step = staticmethod(dahl_step)
    # At the start of a segment in motion, the reversal is complete.
    start = staticmethod(lambda sign, c: sign)

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
    units = ('A',)
    variable = 'history'
    # The joint must cross both at each reversal.
    constants = {
        'gap': _distance_search(1.6, 0.4), 'distance': _distance_search(2.5, 0.25),
        'transition': None}
    shown_by = Hysteresis.shown_by
    signs = (1,)
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
    start = staticmethod(lambda sign, c: sign * (0.5 * c.gap + c.distance))

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
    units = ('A',)
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
    shown_by = (lambda coverage: coverage.rest_duration >= 1.0,)
    signs = (1,)
    summary = ('Rest time: up to {A:+.3g} A more friction after resting (time constant '
               '{time_constant:.2g} s), lost over {distance:.2g} rad')
    equation = '{A:+.5g}·tanh(v/{transition:.5g})·r'
    state_equation = ('r grows at rest to 1 - exp(-t/{time_constant:.5g}) and fades in motion with '
                      'exp(-|Δq|/{distance:.5g})')
    step = staticmethod(rest_step)
    columns = staticmethod(lambda x, c: (x.sign * x.memory,))


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
    units = ('A/K', 'A·s/(rad·K)', 'A/K')
    variable = 'temperature'
    needs = ('temperature',)
    # Friction falls almost linearly over tens of kelvin.
    range_margins = {'temperature': 1.0}
    constants = {'reference_temperature': None, 'transition': None}
    tried = {'reference_temperature': lambda coverage: (coverage.temperature,)}
    shown_by = (lambda coverage: coverage.temperature_span >= 2.0,)
    summary = ('Temperature: per kelvin Coulomb friction changes by {A:+.3g} A and viscous '
               'friction by {B:+.3g} A per rad/s')
    equation = _CHANGED + '·(T - {reference_temperature:.5g})'
    columns = staticmethod(lambda x, c: _changed_friction(
        x, x.temperature - c.reference_temperature))


class OffsetDrift(Effect):
    """``A·exp(-t/τ)``: a drifting current independent of the direction, t as in `WarmUp`."""

    name = 'offset_drift'
    units: tuple[str, ...] = ('A',)
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
    # Motors and gears warm up over minutes; in less than half of one, other effects look the same.
    shown_by = (lambda coverage: coverage.duration >= 30.0,)
    summary = 'Offset drift: {A:+.3g} A at the start, fading with {time_constant:.3g} s'
    equation = '{A:+.5g}·exp(-t/{time_constant:.5g})'
    columns = staticmethod(lambda x, c: (np.exp(-np.maximum(x.time, 0.0) / c.time_constant),))


class WarmUp(OffsetDrift):
    """``(A·s + B·v + C·s²)·exp(-t/τ)``, s = tanh(v/v_t), t from the start of each recording.

    C is for directions whose friction (Eq. 6 has two plateaus) changes differently.
    """

    name = 'warm_up'
    units = ('A', 'A·s/rad', 'A')
    role = Effect.role
    not_fed_back = ('the temperature of the motor when the compensator starts is not known; fed '
                    'back it would over-compensate a drive that is already warm')
    constants = {**OffsetDrift.constants, 'transition': None}
    summary = ('Warm-up: {A:+.3g} A of Coulomb and {B:+.3g} A per rad/s of viscous friction at the '
               'start, fading with {time_constant:.3g} s')
    equation = _CHANGED + '·exp(-t/{time_constant:.5g})'
    columns = staticmethod(lambda x, c: _changed_friction(x, *OffsetDrift.columns(x, c)))


EFFECTS: dict[str, type[Effect]] = {kind.name: kind for kind in (
    Stribeck, ViscousShape, DirectionAsymmetry, Gravity, Spring, Cogging, FrictionRipple, Bump,
    Inertia, RigidBody, OtherJoints, LoadTorque, LoadFriction, CarriedLoadFriction,
    InnerLoadFriction, Temperature, WarmUp, OffsetDrift, Hysteresis, Backlash, RestTime)}
"""Every effect by its name, in the order in which refinement tries them."""


def register(effect: type[Effect]) -> type[Effect]:
    """Make an effect known to refinement, model files and the compensator; a class decorator."""
    EFFECTS[effect.name] = effect
    return effect
