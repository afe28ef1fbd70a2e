# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a model file keeps of measurements beside friction: at rest, and of the recordings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
import math

import numpy as np

from friction_comp.checks import check_interval, Checked, listed, mapping, number, stated
from friction_comp.errors import InputError
from friction_comp.model.effects.base import Effect
from friction_comp.samples import Samples
from friction_comp.statistics import evenly_spread, rms

_SIZE, _POSITIVE = number(least=0.0), number(above=0.0)


@dataclass(frozen=True)
class Breakaway(Checked):
    """Breakaway currents of Eq. 9 and 10, A, signed, and the positions where measured, rad."""

    positive_mean: float = stated(_SIZE)
    negative_mean: float = stated(number(most=0.0))
    positive_std: float = stated(_SIZE, 0.0)
    negative_std: float = stated(_SIZE, 0.0)
    positive_position: float | None = stated(number(), None)
    negative_position: float | None = stated(number(), None)

    @property
    def friction(self) -> float:
        """Friction at breakaway, A: half of what lies between the directions."""
        return 0.5 * (self.positive_mean - self.negative_mean)

    @property
    def held(self) -> float:
        """What acts in one direction at breakaway, as a weight or an offset does, A."""
        return 0.5 * (self.positive_mean + self.negative_mean)

    def times(self, factor: float) -> Breakaway:
        """Return them `factor` times as large; the same if their scatter is larger than that."""
        scatter = max(self.positive_std / max(self.positive_mean, 1e-9),
                      self.negative_std / max(-self.negative_mean, 1e-9))
        if abs(factor - 1.0) <= scatter:
            return self
        return replace(self, **{
            f'{side}_{what}': factor * getattr(self, f'{side}_{what}')
            for side in ('positive', 'negative') for what in ('mean', 'std')})


@dataclass(frozen=True)
class Presliding(Checked):
    """Displacement of the gear before it slides, from current ramps."""

    # rad, from rest without load until friction is at 95 % of breakaway
    distance: float = stated(_POSITIVE)
    stiffness: float | None = stated(_POSITIVE, None)   # A/rad, up to a third of breakaway
    std: float | None = stated(_POSITIVE, None)     # standard deviation between single rests, rad
    backlash: float | None = stated(_SIZE, None)    # rad, not part of distance; 0 if there is none


# Share of its range by which a signal may be beyond it, as effects are believed there, and share of
# a motion beyond that worth a note; factor of the expected error worth one, too.
_BEYOND, _MUCH, LARGER = 0.25, 0.1, 1.5
# Share of the samples beyond each end of a range.
_TAIL = 0.01
LINE = ('offset', 'coulomb', 'viscous')
"""Parameters of the line, in A, A and A·s/rad."""
INTERVALS = (*LINE, 'inertia', 'static', 'transition')
"""Parameters that a file may have intervals of."""
# Signals that have a range, with their unit and the change that is too small to matter.
_SIGNALS = {'speed': ('rad/s', 0.0), 'acceleration': ('rad/s²', 0.0), 'position': ('rad', 0.0),
            'load': ('N·m', 0.0), 'temperature': ('°C', 2.0), 'rigid_body': ('N·m', 0.0)}
# The same of the position of another joint, with whose sine the weight varies.
_OF_OTHER = ('rad', 0.1)


def signals_read(samples: Samples, effects: Iterable[Effect]) -> dict[str, np.ndarray]:
    """Return each signal, (N,), that a sum of the sigmoid and effects depends on, but time.

    Speed and acceleration are sizes: nothing is known of either sign alone. A load, a temperature
    and positions of other joints count even if no effect depends on them: where they hardly varied,
    nothing is known of that.
    """
    names = {'speed', 'load', 'temperature'}.union(*(effect.reads() for effect in effects))
    values = {name: getattr(samples, 'velocity' if name == 'speed' else name)
              for name in _SIGNALS if name in names and samples.velocity is not None}
    # Their torque counts, where a URDF tells it.
    if samples.rigid_body is None and samples.arm is not None:
        values |= {f'position of {joint}': one for joint, one in zip(
            samples.arm.joints, samples.arm.position.T) if joint != samples.joint}
    return {name: np.abs(one) if name in ('speed', 'acceleration') else one
            for name, one in values.items() if one is not None}


# Rows that a model keeps, what they may hold, and the share of them in the other direction up to
# which motion counts as in one.
_ROWS, _ONE_WAY = 128, 0.02
SIGNALS_OF_ROWS = ('time', 'position', 'velocity', 'acceleration', 'load', 'temperature',
                   'rigid_body', 'coupling')


@dataclass(frozen=True)
class Recorded(Checked):
    """What a model file keeps of the recordings it was fitted to."""

    # Quantiles of the speed in motion, rad/s, the lowest first.
    speeds: tuple[float, ...] = stated(listed(_POSITIVE), ())
    # 95 % intervals by parameter, in the model's unit of current, of `LINE`, inertia, transition,
    # and Coulomb with Stribeck friction (static).
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict, metadata={
        'read': mapping(check_interval, INTERVALS)})
    # Lowest and highest value in motion, of each of `signals_read`.
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict, metadata={
        'read': mapping(check_interval)})
    error: float | None = stated(_SIZE, None)   # to expect in motion of another recording, RMS, A
    load: float = stated(number(), 0.0)         # mean measured load in motion, N·m
    # The longest of the recordings, s: `error` is at this rate.
    sample_time: float | None = stated(_SIZE, None)
    # Some states of the recorded motion, evenly spread: `position`, `velocity` and what else the
    # effects read, by the names of `Samples`, each (R,); see `friction_numbers.states_of`.
    rows: dict[str, tuple[float, ...]] = field(default_factory=dict, metadata={
        'read': mapping(listed(number()), SIGNALS_OF_ROWS)})

    def __post_init__(self) -> None:
        super().__post_init__()
        rows = self.rows
        if rows and (not {'position', 'velocity'} <= rows.keys() or not rows['position']
                     or len(set(map(len, rows.values()))) > 1):
            raise InputError(
                'recorded.rows must have position and velocity, and all as many values')

    def with_ranges(self, samples: Samples, effects: Iterable[Effect]) -> Recorded:
        """Return it with ranges and rows of samples in motion, which effects were fitted to."""
        effects = list(effects)
        ranges = {}
        for name, values in signals_read(samples, effects).items():
            low, high = np.quantile(values, (_TAIL, 1.0 - _TAIL))
            ranges[name] = (0.0 if name in ('speed', 'acceleration') else float(low), float(high))
        every = np.arange(_ROWS)
        index = np.unique((every + evenly_spread(every)) * len(samples) // _ROWS).astype(int)
        names = {'position', 'velocity', *(name for effect in effects for name in effect.reads()),
                 *(['time'] if any(not one.holds_on_another_day for one in effects) else [])}
        rows = {name: tuple(float(f'{value:.6g}') for value in values[index])
                for name in SIGNALS_OF_ROWS if samples.velocity is not None and name in names
                and (values := getattr(samples, name)) is not None}
        return replace(self, ranges=ranges, rows=rows, load=(
            0.0 if samples.load is None else float(np.mean(samples.load))))

    def beyond(self, samples: Samples, effects: Iterable[Effect], linear: bool = False,
               torque_per_current: float = 1.0) -> list[str]:
        """Return a note on each signal of which much of a motion is beyond the recorded range.

        Like other effects, friction is believed for a quarter of the range beyond it, and a load
        for the error to expect. Of an angle, a turn is all there is.
        """
        notes = []
        for name, values in signals_read(samples, effects).items():
            low, high = self.ranges.get(name, (-math.inf, math.inf))
            unit, least = _SIGNALS.get(name, _OF_OTHER)
            if name == 'load':
                least = (self.error or 0.0) * torque_per_current
            more = max(_BEYOND * (high - low), least)
            share = float(np.mean((values < low - more) | (values > high + more)))
            whole_turn = name.startswith('position') and not linear and high - low >= 2.0 * math.pi
            if share >= _MUCH and not whole_turn:
                notes.append(
                    f'{100.0 * share:.0f} % of this motion is more than a quarter beyond the '
                    f'{name.replace("rigid_body", "torque of the links")} that the model was '
                    f'fitted to, {low:.3g} to {high:.3g} {unit}: it is extrapolated, and the error '
                    'may be larger than the report expects')
        return notes

    def error_at(self, speed: np.ndarray) -> float:
        """Return the RMS error to expect of motion at some speeds, (N,), rad/s, in A.

        Where the slope of friction is uncertain, the error grows away from the recorded speeds.
        """
        low, high = self.intervals.get('viscous', (0.0, 0.0))
        away = rms(speed - np.median(self.speeds)) if self.speeds else 0.0
        return math.hypot(self.error or 0.0, 0.5 * (high - low) * away)

    def interval(self, name: str, value: float) -> tuple[float, float] | None:
        """Return a parameter's interval; None if it does not hold the value, as after a change."""
        low, high = self.intervals.get(name, (math.nan, math.nan))
        return (low, high) if low <= value <= high else None

    @property
    def in_both_directions(self) -> bool:
        """Whether a part of the rows is in each direction of motion."""
        forwards = np.mean(np.array(self.rows.get('velocity', (-1.0, 1.0))) > 0.0)
        return bool(_ONE_WAY < forwards < 1.0 - _ONE_WAY)
