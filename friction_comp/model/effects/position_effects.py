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
    ResidualView,
    RESISTS,
    SearchRange,
    Signals,
    turns_seldom,
)

_BINS_A_PERIOD, _MOST_BINS = 4, 1 << 17
# Fewest waves over the range of position, to distinguish a wave from a slope.
FEWEST_PERIODS = 1.5
# Frequencies proposed for each shape of ripple, neighbourhoods of a spectrum, and how much farther
# than ln N means the largest of noises is in one of ten cases.
_PEAKS, _NEIGHBOURHOODS, _ONE_OF_TEN = 4, 16, 2.25
# Positions of bumps proposed for each width, and the fewest rows by which one is judged.
_PLACES, _FEWEST = 2, 20
# Largest spread of a speed that is constant except for starts and reversals: motion to and fro at
# one speed has 0.25 to 0.35; production strokes, several speeds and sines have 0.46 and more.
_NEARLY_ONE_SPEED = 0.4


def above_noise(power: np.ndarray) -> np.ndarray:
    """Return which powers of a spectrum no noise has, bool, (M,), but in one of ten spectra.

    Of N powers of white noise about their mean, the largest is about ln N times it; the spectrum
    has four for each. The mean is that of the neighbourhood, by its median: what is left of a fit
    is no white noise.
    """
    parts = np.array_split(power, max(1, min(_NEIGHBOURHOODS, len(power) // 64)))
    mean = np.concatenate([np.full(len(part), np.median(part)) for part in parts]) / math.log(2.0)
    return np.asarray(power > mean * (math.log(max(0.25 * len(power), 1.0)) + _ONE_OF_TEN))


def spectrum_peaks(view: ResidualView, amplitude: np.ndarray) -> list[float]:
    """Return the spatial frequencies, rad/rad (periods per turn), that would explain most.

    The residual is modelled as amplitude · (a·cos(kq) + b·sin(kq)) with an amplitude of shape (R,).
    A period takes three rows at the slowest quarter of the speeds, and four position steps at
    least. Of a joint that turned often, only harmonics of a turn are returned.
    """
    coverage, span = view.coverage, float(np.ptp(view.position))
    slow = float(np.percentile(np.abs(view.velocity), 25))
    highest = 2.0 * math.pi / max(3.0 * slow * view.row_time, 4.0 * coverage.resolution, 1e-12)
    energy = float(amplitude @ amplitude)
    if not highest * span > 2.0 * math.pi * FEWEST_PERIODS or energy <= 0.0:
        return []
    bins = min(math.ceil(_BINS_A_PERIOD * highest * span / (2.0 * math.pi)) + 1, _MOST_BINS)
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
        if len(found) < _PEAKS and all(abs(k[row] - other) > separation for other in found):
            found.append(float(k[row]))
    return found


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

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        cosine, sine = Cogging.columns(x, c)
        return (x.sign * cosine, x.sign * sine)


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
    # At one speed, the few samples of starts and reversals look like bumps.
    shown_by = (turns_seldom, lambda coverage: coverage.speed_spread >= _NEARLY_ONE_SPEED)
    summary = 'Bump: {A:+.3g} A at {position:.4g} rad, with a width of {width:.2g} rad'
    equation = '{A:+.5g}·exp(-0.5·(|q - {position:.6g}|/{width:.5g})^{exponent:.5g})'
    factors = {'directional': '·tanh(v/{transition:.5g})'}

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
