# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects that repeat over position or occur at one: cogging, friction ripple, worn teeth."""

from __future__ import annotations

from collections.abc import Iterator
import math
from typing import Any

import numpy as np

from friction_comp.model.effects.base import (
    CARRIES,
    Coverage,
    Effect,
    NEARLY_ONE_SPEED,
    ResidualView,
    RESISTS,
    SearchRange,
    Signals,
    turns_often,
)

_BINS_A_PERIOD = 4
_MOST_BINS = 1 << 17
# Fewest waves over the range of position, to distinguish a wave from a slope.
FEWEST_PERIODS = 1.5


def highest_frequency(velocity: np.ndarray, sample_time: float, resolution: float) -> float:
    """Return the highest spatial frequency in rad/rad that a recording can show.

    A period takes three samples, `sample_time` s, at the slowest quarter of the speeds, and four
    position steps of `resolution` rad (0 if there are none) at least.
    """
    slow = float(np.percentile(np.abs(velocity), 25))
    highest = 2.0 * math.pi / max(3.0 * slow * sample_time, 1e-12)
    return min(highest, 2.0 * math.pi / (4.0 * resolution)) if resolution > 0 else highest


def position_spectrum(position: np.ndarray, signal: np.ndarray, amplitude: np.ndarray,
                      highest: float, periods: float = FEWEST_PERIODS
                      ) -> tuple[np.ndarray, np.ndarray]:
    """Return spatial frequencies in rad/rad, and the sum of squares that each would explain, (M,).

    The signal, shape (N,), is modelled as amplitude · (a·cos(kq) + b·sin(kq)) for k from `periods`
    over the range of position to `highest`, rad/rad (periods per turn).
    """
    span = float(np.ptp(position))
    energy = float(amplitude @ amplitude)
    if not highest * span > 2.0 * math.pi * periods or energy <= 0.0:
        return np.empty(0), np.empty(0)
    bins = min(math.ceil(_BINS_A_PERIOD * highest * span / (2.0 * math.pi)) + 1, _MOST_BINS)
    width = span / bins
    index = np.minimum(((position - position.min()) / width).astype(np.int64), bins - 1)
    sums = np.bincount(index, amplitude * signal, minlength=bins)
    size = 1 << (4 * bins - 1).bit_length()
    k = 2.0 * math.pi * np.fft.rfftfreq(size, width)
    power = 2.0 * np.abs(np.fft.rfft(sums, size)) ** 2 / energy
    keep = (k >= 2.0 * math.pi * periods / span) & (k <= highest)
    return k[keep], power[keep]


def peaks(k: np.ndarray, power: np.ndarray, count: int, separation: float) -> list[float]:
    """Return the frequencies of the highest peaks with at least a separation between them."""
    highest: list[float] = []
    for index in np.argsort(power)[::-1][:2000]:
        if all(abs(k[index] - other) > separation for other in highest):
            highest.append(float(k[index]))
            if len(highest) == count:
                break
    return highest


# Frequencies proposed for each shape of ripple.
_PEAKS = 4
# Positions of bumps proposed for each width, and the fewest rows by which one is judged.
_PLACES, _FEWEST = 2, 20


class Cogging(Effect):
    """``(A·cos(kq) + B·sin(kq))·(|v|/v_ref)^g``, independent of the direction of motion."""

    name = 'cogging'
    variable = 'position'
    role = CARRIES
    max_count = 4
    coefficient_names = (('part with the cosine of the phase', 'A'),
                         ('part with the sine of the phase', 'A'))
    # With fewer periods over the range it is not a ripple.
    constants: dict[str, SearchRange | None] = {
        'frequency': SearchRange(
            1.0, unit=lambda coverage, _: math.pi / coverage.span,
            limits=lambda coverage, _: (2.0 * math.pi * FEWEST_PERIODS / coverage.span, math.inf)),
        'growth': None, 'speed': None, 'transition': None}
    # The amplitude holds at recorded speeds; over position the ripple repeats.
    range_margins = {'velocity': 0.25}
    _word = 'Cogging'

    @classmethod
    def grid(cls, coverage: Coverage) -> list[dict[str, float]]:
        return [{'growth': growth, 'speed': coverage.speed} for growth in (0.0, 1.0)]

    @classmethod
    def propose(cls, view: ResidualView) -> list[dict[str, float]]:
        """Return the largest peaks in the residual's spectrum; harmonics if it turned often."""
        coverage, proposed = view.coverage, []
        highest = highest_frequency(view.velocity, view.row_time, coverage.resolution)
        separation = 2.0 * math.pi / coverage.span
        for constants in cls.points(coverage):
            c = cls.Constants(frequency=0.0, **constants)
            signals = Signals(position=view.position, velocity=view.velocity, sign=view.sign)
            # At frequency zero the first column is the amplitude itself.
            k, power = position_spectrum(
                view.position, view.residual, cls.columns(signals, c)[0], highest)
            if turns_often(coverage):
                width = 0.5 * separation
                harmonic = (np.abs(k - np.round(k)) < width) & (k > 1.0 - width)
                k, power = k[harmonic], power[harmonic]
            proposed += [{'frequency': frequency, **constants}
                         for frequency in peaks(k, power, _PEAKS, separation)]
        return proposed

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        amplitude, phase = (abs(x.velocity) / c.speed) ** c.growth, c.frequency * x.position
        return (amplitude * np.cos(phase), amplitude * np.sin(phase))

    def describe(self) -> str:
        size = math.hypot(*self.coefficients)
        with_speed = (f' at {self.values["speed"]:.2g} rad/s, growing with speed'
                      if self.values['growth'] else '')
        return (f'{self._word}: {size:.3g} A{with_speed}, {self.values["frequency"]:.5g} times a '
                'turn')

    def formula(self) -> str:
        a, b = self.coefficients
        k = self.values['frequency']
        grown = (f'·(|v|/{self.values["speed"]:.5g})^{self.values["growth"]:g}'
                 if self.values['growth'] else '')
        return f'+({a:+.5g}·cos({k:.7g}·q) {b:+.5g}·sin({k:.7g}·q)){grown}'


class FrictionRipple(Cogging):
    """``(A·cos(kq) + B·sin(kq))·tanh(v/v_t)·(|v|/v_ref)^g``: changes sign with the direction."""

    name = 'friction_ripple'
    role = RESISTS
    _word = 'Friction ripple'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        amplitude = x.sign * (abs(x.velocity) / c.speed) ** c.growth
        phase = c.frequency * x.position
        return (amplitude * np.cos(phase), amplitude * np.sin(phase))

    def formula(self) -> str:
        return f'{super().formula()}·tanh(v/{self.values["transition"]:.5g})'


class Bump(Effect):
    """``A·s·exp(-|q - q0|^p/(2·w^p))`` with s = tanh(v/v_t), or s = 1 where `directional` is 0.

    A local bump, as of a worn or broken tooth: p = 2 gives a bell, larger p a flatter top.
    """

    name = 'bump'
    coefficient_names = (('height', 'A'),)
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

    def __init__(self, parameters: dict[str, Any],
                 valid_range: dict[str, Any] | None = None) -> None:
        super().__init__(parameters, valid_range)
        self.role = RESISTS if self.values['directional'] else CARRIES

    @classmethod
    def grid(cls, coverage: Coverage) -> list[dict[str, float]]:
        return [{'position': position, 'width': width, 'exponent': 2.0, 'directional': directional}
                for width, places in cls._places(coverage) for position in places.tolist()
                for directional in (1.0, 0.0)]

    @staticmethod
    def _places(coverage: Coverage) -> Iterator[tuple[float, np.ndarray]]:
        """Yield the widths of the grid, and the positions for each."""
        for width in np.geomspace(0.008 * coverage.span, 0.12 * coverage.span, 5).tolist():
            # About the middle, so that both directions of position count alike.
            each_way = math.ceil(0.5 * coverage.span / width)
            yield width, 0.5 * (coverage.lowest + coverage.highest) + width * np.arange(
                -each_way, each_way + 1)

    @classmethod
    def propose(cls, view: ResidualView) -> list[dict[str, float]]:
        """Return for each width where the mean of the residual stands out most from its scatter."""
        order = np.argsort(view.position)
        position, proposed = view.position[order], []
        # Sums over positions up to each, by whether the bump changes sign with the direction.
        totals = {directional: np.concatenate(([0.0], np.cumsum(values[order])))
                  for directional, values in ((1.0, view.residual * view.sign),
                                              (0.0, view.residual))}
        for width, places in cls._places(view.coverage):
            low = np.searchsorted(position, places - width)
            high = np.searchsorted(position, places + width)
            count = high - low
            for directional, sums in totals.items():
                score = np.where(count < _FEWEST, 0.0,
                                 (sums[high] - sums[low]) ** 2 / np.maximum(count, 1))
                proposed += [{'position': float(places[k]), 'width': width, 'exponent': 2.0,
                              'directional': directional, 'transition': view.coverage.transition}
                             for k in np.argsort(score)[::-1][:_PLACES]]
        return proposed

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        distance = np.minimum(abs(x.position - c.position) / c.width, 1e6)
        bell = np.exp(-np.minimum(0.5 * distance ** c.exponent, 700.0))
        return (bell * x.sign if c.directional else bell,)

    @classmethod
    def insufficient_data(cls, coverage: Coverage) -> str:
        if turns_often(coverage) or coverage.speed_spread >= NEARLY_ONE_SPEED:
            return turns_often(coverage)
        return (f'Speed was near {coverage.median_speed:.3g} rad/s most of the time: the few '
                'samples of starts and reversals determine the dependence on speed, and bumps '
                'cannot be distinguished from effects of starts and reversals.')

    def describe(self) -> str:
        c = self.values
        kind = 'more friction' if c['directional'] else 'torque in one direction'
        return (f'Bump: {self.coefficients[0]:+.3g} A {kind} at {c["position"]:.4g} rad, '
                f'about {2.4 * c["width"]:.2g} rad wide')

    def formula(self) -> str:
        c = self.values
        sign = f'·tanh(v/{c["transition"]:.5g})' if c['directional'] else ''
        return (f'{self.coefficients[0]:+.5g}·exp(-0.5·(|q {-c["position"]:+.6g}|'
                f'/{c["width"]:.5g})^{c["exponent"]:.5g}){sign}')
