# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What cycles of constant velocity and current ramps show.

**Cycles**: mean currents and drift. Speeds rise while they are driven, so that time and speed would
be mistaken for each other on a drive that warms up: some speeds are driven once more at the end.

**Ramps** pause on stairs of 1 % of the current. In presliding, a joint whose current stays constant
comes to rest; one that slides goes on, or becomes faster: for friction that falls or rises with
speed, for every kind of presliding, and for a rotor that slides through backlash. Breakaway is the
largest current that holds. Friction along a ramp is ``f = i - a / (k_t·n/J) - c·ω``, without the
viscous current c·ω of Eq. 6; its curve over displacement ends with the last pause at which the
joint rested.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from friction_comp.identification.goal import FEWEST, IdentificationError, SETTLING
from friction_comp.model.model_file import Breakaway, Presliding
from friction_comp.statistics import noise_level, rms

MAX_SCATTER = 0.15
"""Standard deviation above which a current does not measure friction, a share of it."""
SHORTEST_PAUSE, LONGEST_PAUSE = 0.15, 2.4
"""Times on a stair, s: doubled from the shortest on until the joint rests, or slides."""


# Cycles.

@dataclass(frozen=True)
class KineticPoint:
    """One entry of the look-up table."""

    speed: float                 # ω_c as requested, rad/s, signed
    current: float               # weighted mean, A
    standard_deviation: float    # of the measured current over the phase, A
    actual_speed: float          # mean velocity over the phase, rad/s
    unsteadiness: float          # largest deviation from a straight line, as a share of its length
    position: float = 0.0        # mean over the phase, rad


@dataclass(frozen=True)
class Cycle:
    """One cycle of Eq. 3; points are those of the positive and of the negative direction."""

    begin: float                            # s
    duration: float                         # s
    points: tuple[KineticPoint, ...]        # of the measured current
    commanded: tuple[KineticPoint, ...]     # of the commanded current
    samples: np.ndarray                     # s, rad and A, shape (N, 3)
    gain: float = 1.0                       # factor of the controller's bandwidth

    @classmethod
    def measured(cls, begin: float, duration: float, speed: float, samples: np.ndarray,
                 commands: np.ndarray, gain: float = 1.0) -> Cycle:
        """Return the cycle that begins at a time in s, with means of its currents.

        With the weights s²·(1 - s)² of a phase's share s, a controller that still settles hardly
        matters, and friction that varies over position averages out. Raises IdentificationError if
        a phase has too few samples.
        """
        points, commanded = (
            tuple(_mean_of(sign * speed, phase) for sign, phase in zip(
                (1.0, -1.0), phases_of(rows, begin, duration)))
            for rows in (samples, np.column_stack((samples[:, :2], commands))))
        return cls(begin, duration, points, commanded, samples, gain)

    @property
    def speed(self) -> float:
        """Speed in rad/s, a magnitude."""
        return abs(self.points[0].speed)

    @property
    def friction(self) -> float:
        """Friction at this speed, half the difference of both directions, A."""
        return max(0.5 * (self.points[0].current - self.points[1].current), 1e-9)

    @property
    def time(self) -> float:
        """Time of the middle of the cycle, s."""
        return self.begin + 0.5 * self.duration

    @property
    def scatter(self) -> float:
        """Largest standard deviation of the current, a share of friction."""
        return max(point.standard_deviation for point in self.points) / self.friction

    @property
    def error(self) -> float:
        """Standard error of the mean current, a share of friction."""
        # With the weights, as if 0.7 of the samples counted alike.
        return max(point.standard_deviation / math.sqrt(max(0.7 * len(phase), 1.0))
                   for point, phase in zip(self.points, self.phases())) / self.friction

    @property
    def middle(self) -> float:
        """Middle of the range driven, rad."""
        position = self.samples[:, 1]
        return 0.5 * float(np.min(position) + np.max(position))

    def phases(self) -> list[np.ndarray]:
        """Return the samples of both phases at constant velocity, each of shape (N, 3)."""
        return phases_of(self.samples, self.begin, self.duration)


def phases_of(samples: np.ndarray, begin: float, duration: float) -> list[np.ndarray]:
    """Return rows of s, rad and A of a cycle's two phases at constant velocity, as far as known.

    Without the time in which the controller settles, or 60 % of each.
    """
    since, skipped = samples[:, 0] - begin, min(SETTLING, 0.18 * duration)
    return [samples[(since >= first * duration + skipped) & (since <= last * duration)
                    & np.isfinite(samples[:, 2])] for first, last in ((0.1, 0.4), (0.6, 0.9))]


def _mean_of(speed: float, phase: np.ndarray) -> KineticPoint:
    if len(phase) < FEWEST:
        raise IdentificationError(f'speed {speed:g} rad/s: {len(phase)} samples of the '
                                  'constant-velocity phase are too few to average')
    time, x, i = phase.T
    t = time - np.mean(time)
    share = (t - t[0]) / (t[-1] - t[0])
    # Samples may come unevenly: each stands for the time around it.
    weight = (share * (1.0 - share)) ** 2 * np.gradient(t)
    weight /= np.sum(weight)
    slope, middle = np.polyfit(t, x, 1)
    distance = max(abs(slope) * (t[-1] - t[0]), 1e-12)
    return KineticPoint(
        speed=speed, current=float(weight @ i), standard_deviation=float(np.std(i)),
        actual_speed=float(weight @ np.gradient(x, t)), position=float(weight @ x),
        unsteadiness=float(np.max(np.abs(x - slope * t - middle)) / distance))


def position_slopes(cycles: Sequence[Cycle]) -> tuple[float, float]:
    """Return by how much the current rises over position, A/rad, forwards and backwards.

    The controller settles at the beginning of a phase, so that its mean belongs to the far side
    forwards and to the near side backwards, the more the faster the joint is: a spring would be
    taken for viscous friction. `cycles` begin with the slowest; only the slower half is used, in
    which the controller has settled.
    """
    products, squares = np.zeros(2), np.full(2, 1e-12)
    for cycle in cycles[:max(1, len(cycles) // 2)]:
        for side, (_, position, current) in enumerate(phase.T for phase in cycle.phases()):
            away = position - np.mean(position)
            products[side] += float(away @ current)
            squares[side] += float(away @ away)
    forward, backward = products / squares
    return float(forward), float(backward)


def levelled(cycles: Sequence[Cycle], slopes: Sequence[float]) -> list[Cycle]:
    """Return cycles with the currents of the points as in the middle of the range.

    `slopes` over position, A/rad, are those of `position_slopes`.
    """
    def level(cycle: Cycle, points: Sequence[KineticPoint]) -> tuple[KineticPoint, ...]:
        return tuple(replace(point, current=point.current - slope * (point.position - cycle.middle))
                     for point, slope in zip(points, slopes))
    return [replace(cycle, points=level(cycle, cycle.points),
                    commanded=level(cycle, cycle.commanded)) for cycle in cycles]


def pairs(first: Sequence[Cycle], again: Sequence[Cycle]) -> list[tuple[Cycle, Cycle]]:
    """Return cycles that held the same speed twice, by the time of the first."""
    def alike(one: Cycle, other: Cycle) -> bool:
        # One that was slower or faster measured other friction.
        return other.scatter <= max(MAX_SCATTER, 1.5 * one.scatter) and all(
            abs(b.actual_speed / a.actual_speed - 1.0) <= 0.02
            for a, b in zip(one.points, other.points))
    return [(one, other) for one in first for other in again
            if one.speed == other.speed and alike(one, other)]


def changes(both: Sequence[tuple[Cycle, Cycle]]) -> list[list[float]]:
    """Return by how much the current changed in both directions from one cycle to the other, A."""
    return [[later.current - one.current for one, later in zip(a.points, b.points)]
            for a, b in both]


def without_drift(first: Sequence[Cycle], again: Sequence[Cycle]
                  ) -> tuple[list[KineticPoint], dict[float, float]]:
    """Return the look-up table, and the drift at each speed in rad/s, a share of its friction.

    The drift is empty if it is small, or noise, at all speeds: the table is then what was measured
    first. Otherwise it is what would have been measured the second time: at speeds that were not
    driven again, the change is interpolated over the times at which speeds were driven first.
    """
    both = pairs(first, again)
    moved = changes(both)
    shares = {a.speed: max(forward, -backward, key=abs) / a.friction
              for (a, _), (forward, backward) in zip(both, moved)}
    if not any(abs(shares[a.speed]) > max(0.03, 3.0 * math.hypot(a.error, b.error))
               for a, b in both):
        return [point for cycle in first for point in cycle.points], {}
    times = [a.time for a, _ in both]
    return [replace(point, current=point.current + float(np.interp(cycle.time, times, side)))
            for cycle in first for point, side in zip(cycle.points, zip(*moved))], shares


# Ramps.

class Held(NamedTuple):
    """A pause during which the joint came to rest."""

    begin: float    # s
    end: float
    position: float     # rad


class Ramp(NamedTuple):
    """One current ramp on which the joint broke away."""

    direction: int
    before: int     # direction of the last slide before it, 0 if not known
    samples: np.ndarray     # rows of s, rad and A
    held: Held      # the last pause at which the joint came to rest
    pauses: Sequence[float] = ()    # when each began, s

    def current(self, begin: float, end: float) -> float:
        """Return the mean measured current between two times in s, A, signed."""
        time, _, current = self.samples.T
        measured = current[(time >= begin) & (time <= end) & np.isfinite(current)]
        if not measured.size:
            raise IdentificationError('the measured current is not finite')
        return float(np.mean(measured))

    @property
    def breakaway(self) -> float:
        """The mean measured current of the last stair that held, A, signed."""
        # At its beginning, the current controller settles.
        begin, end, _ = self.held
        return self.current(begin + 0.3 * (end - begin), end)


def first_stair(held: Sequence[float]) -> float:
    """Return the current in A of a ramp's first stair, after those that held, A.

    It is near breakaway: what a joint creeps under stairs is no part of its presliding distance.
    """
    # A single one does not tell how much they differ.
    return 0.95 * min(held) if len(held) > 1 else 0.9 * held[0]


def risen(share: float, from_rest: bool) -> float:
    """Return the share by which a current has risen after a share of the time, level at the end.

    From rest, it begins with its mean slope: what damps the contact would else seem to stiffen it.
    """
    slope = 1.0 if from_rest else 0.0
    return share * (slope + share * (3.0 - 2.0 * slope - share * (2.0 - slope)))


def rests(time: Sequence[float], position: Sequence[float], sign: int, resolution: float) -> bool:
    """Return whether a joint has come to rest, or nearly so, during a pause of times in s.

    Positions are in rad, `sign` is the ramp's direction, `resolution` an encoder count in rad. The
    means of thirds are compared, which resolve less than a count.
    """
    share = (np.asarray(time) - time[0]) / (time[-1] - time[0])
    x = sign * (np.asarray(position) - position[0])
    thirds = [x[(share >= k / 3.0) & (share <= (k + 1) / 3.0)] for k in range(3)]
    first, second, third = (float(np.mean(part)) for part in thirds)
    noise = 3.0 * noise_level(x - np.interp(share, (1 / 6, 0.5, 5 / 6), (
        first, second, third))) * math.sqrt(2.0 / len(thirds[-1]))
    # A contact may creep at a steady rate, of 0.3 mrad/s, from far below breakaway on.
    creep = 1e-4 * (time[-1] - time[0])
    return third - second <= max(0.5 * resolution, noise, 0.5 * (second - first), creep)


def breakaway_of(ramps: Sequence[Ramp]) -> Breakaway:
    """Return means, standard deviations and mean positions of ramps (Eq. 9 and 10)."""
    values: dict[str, float] = {}
    for name, sign in (('positive', 1), ('negative', -1)):
        own = np.array([(ramp.breakaway, ramp.held.position)
                        for ramp in ramps if ramp.direction == sign])
        values |= dict(zip((f'{name}_mean', f'{name}_position'), own.mean(axis=0).tolist()))
        values[f'{name}_std'] = _scatter(own[:, 0])
    return Breakaway(**values)


def _scatter(currents: np.ndarray) -> float:
    return float(np.std(currents, ddof=1)) if len(currents) > 1 else 0.0


@dataclass(frozen=True)
class RampFriction:
    """Friction along one ramp up to breakaway, in the ramp's direction; shapes (M,)."""

    current: np.ndarray     # friction current, smoothed, A
    position: np.ndarray    # displacement since the beginning of the ramp, smoothed, rad
    measured: np.ndarray    # the same as measured by the encoder, rad
    half: int               # half the smoothing window, samples
    noise: float            # standard deviation of the smoothed current, A
    grain: float            # rad that the position resolves

    @classmethod
    def of(cls, ramp: Ramp, resolution: float, acceleration_per_current: float,
           viscous: float = 0.0) -> RampFriction:
        """Separate friction from the current that accelerates the joint (k_t·n/J, rad/s² per A).

        `resolution` is an encoder count in rad, `viscous` (of Eq. 6) in A·s/rad.
        """
        known = np.isfinite(ramp.samples[:, 2]) & (ramp.samples[:, 0] <= ramp.held.end)
        time, position, current = ramp.samples[known].T
        step = float(np.median(np.diff(time)))
        even = time[0] + step * np.arange(int((time[-1] - time[0]) / step) + 1)
        moved = np.interp(even, time, ramp.direction * (position - position[0]))
        driven = np.interp(even, time, ramp.direction * current)
        # The shortest window that encoder and noise allow, for noise of 0.7 % of the current: a
        # rotor breaks free more slowly than 24 ms, the gear resonates faster than 64 ms. Variance
        # of a parabola's second derivative over a window T: 720·σ²·step/T⁵.
        allowed = 0.007 * max(float(np.max(driven)), 1e-9)
        counts = (60.0 * resolution ** 2 * step / (allowed * acceleration_per_current) ** 2) ** 0.2
        width = max(counts, step * (noise_level(driven) / allowed) ** 2, 0.024)
        count = max(round(min(width, 0.064) / step), 5) | 1
        inner = slice(count // 2, even.size - count // 2)
        smooth_position, speed, acceleration = (
            savgol_filter(moved, count, 2, deriv=order, delta=step)[inner] for order in range(3))
        smooth = np.convolve(driven, np.full(count, 1.0 / count), 'valid')
        # Deceleration is left out: friction, or teeth that touch after backlash, stop the joint.
        inertia = np.maximum(acceleration, 0.0) / acceleration_per_current
        return cls(
            current=smooth - inertia - viscous * speed, position=smooth_position,
            measured=moved[inner], half=count // 2,
            noise=float(np.std(driven[inner] - smooth) / np.sqrt(count)),
            grain=max(resolution, 3.0 * noise_level(moved)))

    def presliding(self, breakaway: float, upturn: int = 0) -> float:
        """Return the displacement in rad at which friction reaches 95 % of this ramp's breakaway.

        If teeth touch at the index `upturn`, the link's friction is the part above the tangent at
        the touch, shifted back by the backlash.
        """
        moved = np.maximum.accumulate(self.position)
        friction, crossed = self.current, moved[upturn]
        if upturn > 0:
            before, touch = np.interp((0.75 * crossed, crossed), moved, self.current)
            slope = 4.0 * (touch - before) / crossed
            added = np.maximum.accumulate(np.where(
                moved > crossed, self.current - touch - slope * (moved - crossed), 0.0))
            friction = friction + np.interp(moved + crossed, moved, added) - added
        top = float(np.max(self.current[-self.half:]))
        return float(self.position[np.argmax(friction >= min(0.95 * breakaway, top))])

    def upturn(self) -> tuple[float, int]:
        """Return the largest depth of the curve below its hull, a share of its peak, its index."""
        width = max(self.grain, float(np.max(self.measured)) / 60.0)
        bins = np.maximum.accumulate(np.maximum(0, np.rint(self.measured / width).astype(int)))
        count = np.bincount(bins)
        # The position within the first count is unknown, so it is not used.
        x = np.flatnonzero(count)[1:]
        if len(x) < 4:
            return 0.0, 0
        y = np.bincount(bins, self.current)[x] / count[x]
        top = int(np.argmax(y))     # Beyond it, the joint slides.
        corners = [0]
        for k in range(1, top + 1):
            while len(corners) > 1 and (y[corners[-1]] - y[corners[-2]]) * (x[k] - x[corners[-1]]
                    ) <= (y[k] - y[corners[-1]]) * (x[corners[-1]] - x[corners[-2]]):
                corners.pop()
            corners.append(k)
        below = np.interp(x[:top + 1], x[corners], y[corners]) - y[:top + 1]
        # Samples within the smoothing window have the same noise.
        windows = np.maximum(1.0, count[x[:top + 1]] / (2 * self.half + 1))
        below -= 3.0 * self.noise / np.sqrt(windows)
        return float(np.max(below) / y[top]), int(np.searchsorted(bins, x[np.argmax(below)]))


def _medians(ways: np.ndarray, onward: np.ndarray) -> list[float]:
    """Return the medians after slides in the ramp's direction and against it, as far as known."""
    return [float(np.median(ways[side])) for side in (onward, ~onward) if side.any()]


def combined_presliding(ways: np.ndarray, onward: np.ndarray, resolution: float,
                        loose: bool = False) -> tuple[float, float]:
    """Return the presliding distance from those of ramps, rad, (M,), and its standard deviation.

    `onward` tells which ramps follow a slide in their own direction. A Maxwell-slip contact yields
    less in the direction of the slide before, and more against it: by Masing's rule the sum is
    twice the distance, as of contacts without memory. On a `loose` gear, what a ramp against the
    slide yields more may be backlash: the distance is between that in its direction and the mean,
    and so much less sure. The deviation is that of a single rest.
    """
    sides = _medians(ways, onward)
    distance, unknown = float(np.mean(sides)), 0.0
    if loose and len(sides) > 1:
        unknown = 0.5 * max(0.0, distance - sides[0])
        distance = sides[0] + unknown
    # From the interquartile range, since single distances may be far off.
    scatter = [float(np.subtract(*np.quantile(ways[side], (0.75, 0.25)))) / 1.35
               if np.sum(side) > 2 else 0.3 * distance
               for side in (onward, ~onward) if side.any()]
    return distance, unknown + math.hypot(
        rms(np.array(scatter)), 0.4 * resolution, 0.09 * distance)


def find_backlash(curves: Sequence[RampFriction], directions: np.ndarray, onward: np.ndarray,
                  resolution: float) -> tuple[float, list[int]]:
    """Return the backlash of a gear, rad, and each ramp's index at which teeth touch; 0 if none.

    Friction of contacts is a concave function of displacement, since every one that begins to slide
    leaves fewer that stick. Where teeth touch, friction of the link is added and the curve bends
    upwards: the lowest point of a dip below its concave hull. A slide leaves the link somewhere
    between the teeth: a ramp `onward` crosses what is left ahead, one against it what is behind.
    """
    depths, places = np.array([curve.upturn() for curve in curves]).T
    upturns = np.where(depths > 0.015, places, 0).astype(int).tolist()
    # Gears without backlash stay below 0.04 in at least one direction; chains of Maxwell elements
    # exceed 0.03; those with visible backlash have 0.05 to 0.24 in both, but not on every ramp.
    shares = [np.mean(depths[directions == sign] > 0.04) for sign in (1, -1)
              if np.any(directions == sign)]
    # Smoothing shows an impact half a window before it happens.
    crossed = np.array([curve.position[min(at + curve.half, len(curve.position) - 1)] * (at > 0)
                        for curve, at in zip(curves, upturns)])
    backlash = sum(_medians(crossed, onward))
    # A contact that is stiffer on one side also curves upwards, but in one direction only.
    if len(shares) < 2 or min(shares) < 0.2 or backlash < 3.0 * resolution:
        return 0.0, [0] * len(curves)
    return backlash, upturns


class RampEvaluation(NamedTuple):
    """Result of a drive's ramps."""

    breakaways: np.ndarray          # every single one, A, signed, in order of time
    presliding: Presliding | None   # None if the encoder is too coarse
    warnings: list[str]
    backlash: float | None          # rad; None if none was found


def evaluate_ramps(ramps: Sequence[Ramp], resolution: float, acceleration_per_current: float,
                   viscous: float) -> RampEvaluation:
    """Evaluate the ramps of a drive; units are those of `RampFriction.of`.

    Raises IdentificationError if breakaway scatters because of backlash.
    """
    directions = np.array([ramp.direction for ramp in ramps])
    onward = np.array([ramp.before == ramp.direction for ramp in ramps])
    held = np.array([ramp.breakaway for ramp in ramps])
    curves = [RampFriction.of(ramp, resolution, acceleration_per_current, viscous)
              for ramp in ramps]
    backlash, upturns = find_backlash(curves, directions, onward, resolution)
    warnings = []
    if backlash > 0.0:
        for own in (np.abs(held[directions == sign]) for sign in (1, -1)):
            scatter = _scatter(own) / float(np.mean(own))
            if 2.0 * scatter > 0.05 * math.sqrt(len(own)):
                raise IdentificationError(
                    f'backlash of {backlash:.2g} rad: breakaway scatters by {scatter:.0%}; request '
                    'more breakaway_cycles or a less steep ramp_slope')
        warnings.append(f'backlash of {backlash:.2g} rad, with what a soft link winds up by; '
                        'presliding is given without it')
    last = [max([ramp.held.begin, *ramp.pauses]) for ramp in ramps]
    gone = float(np.median([ramp.current(begin, begin + SHORTEST_PAUSE) / level
                            for ramp, level, begin in zip(ramps, held, last)]))
    # On the note's drives, whose friction rises from standstill, it is at most 1.14.
    if gone > 1.2:
        warnings.append(
            'the joint gives way slowly from its breakaway current on, and goes only at '
            f'{gone:.2f} times that: if it creeps, as a gear does that is shaken, breakaway may be '
            'as much higher; if friction rises with the speed, it is right')
    ways = np.array([curve.presliding(level, at)
                     for curve, level, at in zip(curves, np.abs(held), upturns)])
    distance, deviation = combined_presliding(ways, onward, resolution, backlash > 0.0)
    # Less than two counts cannot be resolved.
    presliding = None if distance <= 2.0 * resolution else Presliding(
        distance, deviation, backlash or None)
    return RampEvaluation(held, presliding, warnings, backlash or None)
