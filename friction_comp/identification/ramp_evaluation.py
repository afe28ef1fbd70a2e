# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates current ramps: breakaway, presliding and backlash, from the friction along them.

A part of the motor's current accelerates the joint, the rest is friction:

``f = i - a / (k_t·n/J) - c·ω``

without the viscous current c·ω of Eq. 6. In presliding, f rises with the current. A ramp's curve of
f over displacement ends with the last pause at which the joint rested (see `staircase`): there f is
the current.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

from friction_comp.identification.breakaway import (
    breakaway_records,
    BreakawayRecords,
    Held,
    SHORTEST_PAUSE,
    SlideBegin,
)
from friction_comp.identification.goal import IdentificationError
from friction_comp.identification.kinetic import local_parabolas
from friction_comp.model.measured import Presliding
from friction_comp.statistics import noise_level, rms

# Limits of the smoothing window of f, s: a rotor breaks free more slowly, the gear resonates
# faster.
_SHORTEST, _LONGEST = 0.024, 0.064
# Noise of f that remains after smoothing, as a share of the largest current.
_NOISE = 0.007
# Share of breakaway at which presliding ends.
_PRESLIDING_END = 0.95
# Beside the scatter, standard deviations of presliding: of begin and end within a count, counts,
# and of the method, a share of the distance (gears of `bench/law_table.py`, seeds 44 and 46).
_SHARE_OF_COUNT, _METHOD = 0.4, 0.09
# Stiffness is computed up to this share of breakaway. Fewest counts that the joint must move there,
# times the root of the number of ramps.
_EARLY, _COUNTS = 1.0 / 3.0, 4.0
# Least depth of a ramp's curve below its hull, as a share of breakaway, and share of the ramps in
# each direction that must exceed it, since not every ramp crosses backlash. Simulated gears without
# backlash stay below in at least one direction, but chains of Maxwell elements exceed 0.03; those
# with visible backlash have 0.05 to 0.24 in both (`bench/law_table.py --floors identification`,
# seeds 42 to 48). Where backlash is seen, a ramp has crossed some of it from a smaller depth on.
_DEPTH, _SHARE, _CROSSED = 0.04, 0.2, 0.015
_SURE = 3.0          # standard deviations of noise that a dip must exceed
_SEEN_COUNTS = 3.0   # smallest backlash that the encoder resolves
_BINS = 60           # of displacement, at most
_NEAR = 0.75         # share of the backlash from which on the tangent at the touch is computed
# A load of this share of friction has bent the contact before a ramp begins: no stiffness then.
_LOADED = 0.3
# Share of a pause at its beginning whose current is not used: the current controller settles.
_SETTLING = 0.3
# Accepted two standard errors of breakaway, as a share of it, for a gear with backlash.
_MOST_SCATTER = 0.05
# Current at which the joint goes, over that which held it, above which it gives way in between: on
# the note's drives, whose friction rises from standstill, it is at most 1.14.
_CREEPS = 1.2


@dataclass(frozen=True)
class RampFriction:
    """Friction along one ramp up to breakaway, in the ramp's direction; shapes (M,)."""

    current: np.ndarray     # friction current, smoothed, A
    position: np.ndarray    # displacement since the beginning of the ramp, smoothed, rad
    measured: np.ndarray    # the same as measured by the encoder, rad
    half: int               # half the smoothing window, samples
    noise: float            # standard deviation of the smoothed current, A

    @property
    def breakaway(self) -> float:
        """Breakaway current in A, a magnitude."""
        return float(np.max(self.current[-self.half:]))

    def presliding(self, breakaway: float, upturn: int = 0) -> float:
        """Return the displacement in rad at which friction reaches 95 % of this ramp's breakaway.

        Friction varies with position: where it is 4 % lower, 95 % of the mean would only be reached
        at the flat end. If teeth touch at the index `upturn`, the link's friction begins only after
        the backlash: it is the part above the tangent at the touch, shifted back by the backlash.
        """
        moved = np.maximum.accumulate(self.position)
        friction, crossed = self.current, moved[upturn]
        if upturn > 0:
            before, touch = np.interp((_NEAR * crossed, crossed), moved, self.current)
            slope = (touch - before) / ((1.0 - _NEAR) * crossed)
            added = np.maximum.accumulate(np.where(
                moved > crossed, self.current - touch - slope * (moved - crossed), 0.0))
            friction = friction + np.interp(moved + crossed, moved, added) - added
        k = int(np.argmax(friction >= min(_PRESLIDING_END * breakaway, self.breakaway)))
        return float(self.position[k])


def ramp_friction(time: np.ndarray, position: np.ndarray, current: np.ndarray, sign: int,
                  resolution: float, acceleration_per_current: float,
                  viscous: float = 0.0) -> RampFriction:
    """Separate friction from the current that accelerates the joint, along one ramp.

    Time in s, position in rad and current in A, shape (N,), of a ramp in the direction `sign` that
    starts at rest and ends with the largest current that holds; `resolution` is an encoder count in
    rad.
    """
    step = float(np.median(np.diff(time)))
    even = time[0] + step * np.arange(int((time[-1] - time[0]) / step) + 1)
    moved = np.interp(even, time, sign * (position - position[0]))
    driven = np.interp(even, time, sign * current)
    count = _window(step, driven, resolution, acceleration_per_current)
    half = count // 2
    smooth_position, speed, acceleration = local_parabolas(moved, count, step)
    smooth = np.convolve(driven, np.full(count, 1.0 / count), 'valid')
    # Deceleration is left out: friction, or teeth that touch after backlash, stop the joint.
    inertia = np.maximum(acceleration, 0.0) / acceleration_per_current
    friction = smooth - inertia - viscous * speed
    end = even.size - count + 1
    return RampFriction(
        current=friction, position=smooth_position,
        measured=moved[half:half + end], half=half,
        noise=float(np.std(driven[half:half + end] - smooth) / np.sqrt(count)))


def _window(step: float, driven: np.ndarray, resolution: float, rate: float) -> int:
    """Return the smoothing window in samples, odd: the shortest that encoder and noise allow."""
    allowed = _NOISE * max(float(np.max(driven)), 1e-9)
    # Variance of a parabola's second derivative over a window T: 720·σ²·step/T⁵.
    counts = (60.0 * resolution ** 2 * step / (allowed * rate) ** 2) ** 0.2
    noise = noise_level(driven)
    width = max(counts, step * (noise / allowed) ** 2, _SHORTEST)
    return max(round(min(width, _LONGEST) / step), 5) | 1


class Crossed(NamedTuple):
    """A displacement on one ramp, rad, and whether the slide before had the ramp's direction."""

    onward: bool
    way: float


def by_side(measured: Sequence[Crossed]) -> list[float]:
    """Return the median after slides in the ramp's direction, and that after those against it.

    A side without ramps is left out.
    """
    sides = [[one.way for one in measured if one.onward is side] for side in (True, False)]
    return [float(np.median(side)) for side in sides if side]


def combined_presliding(measured: Sequence[Crossed], loose: bool = False) -> tuple[float, float]:
    """Return the presliding distance from ramps' distances, and what of it is not known, rad.

    A Maxwell-slip contact remembers the slide before: in its direction a ramp yields less than the
    presliding distance, against it more; by Masing's rule the sum is twice the distance. Contacts
    without this memory (Dahl, LuGre) yield the same both times. The mean of both is the distance in
    either case. On a `loose` gear, what a ramp against the slide yields more may be backlash, not
    memory: the distance is between that in its direction and the mean.
    """
    sides = by_side(measured)
    mean = float(np.mean(sides)) if sides else 0.0
    if not loose or len(sides) < 2:
        return mean, 0.0
    unknown = 0.5 * max(0.0, mean - sides[0])
    return sides[0] + unknown, unknown


def presliding_std(measured: Sequence[Crossed], distance: float, unknown: float,
                   resolution: float) -> float:
    """Return the standard deviation of presliding at one rest, rad, see `combined_presliding`.

    It combines the ramps' scatter, the encoder count and the method's error; what is not known is
    added, so that the sum with the distance exceeds the longest that is possible.
    """
    sides = [np.array([one.way for one in measured if one.onward is side])
             for side in (True, False)]
    # From the interquartile range, since single distances may be far off.
    scatter = [float(np.subtract(*np.quantile(side, (0.75, 0.25)))) / 1.35
               if len(side) > 2 else 0.3 * distance for side in sides if len(side)]
    return unknown + math.hypot(rms(np.array(scatter)),
                                _SHARE_OF_COUNT * resolution, _METHOD * distance)


def common_stiffness(ramps: Sequence[RampFriction], breakaway: float,
                     resolution: float) -> float | None:
    """Return the slope of friction over displacement up to a third of breakaway, A/rad.

    The ramps have the direction of the slide before them: then every contact sticks at first, while
    against it some slip at once. None if the encoder is too coarse.
    """
    products = squares = moved = 0.0
    for ramp in ramps:
        last = int(np.argmax(ramp.current > _EARLY * breakaway))
        if last < 3:
            return None
        # The position within the first count is unknown, so deviations from the mean are used.
        rise = ramp.current[:last] - np.mean(ramp.current[:last])
        products += float(np.dot(rise, ramp.position[:last]))
        squares += float(np.dot(rise, rise))
        moved += float(ramp.position[last] - ramp.position[0]) / len(ramps)
    if moved * math.sqrt(len(ramps)) < _COUNTS * resolution or not products > 0.0:
        return None
    return squares / products


def _upturn(ramp: RampFriction, resolution: float) -> tuple[float, int]:
    """Return the largest depth of a curve below its hull, a share of its peak, and its index."""
    width = max(resolution, float(np.max(ramp.measured)) / _BINS)
    bins = np.maximum.accumulate(np.maximum(0, np.rint(ramp.measured / width).astype(int)))
    count = np.bincount(bins)
    # The position within the first count is unknown, so it is not used.
    x = np.flatnonzero(count)[1:]
    if len(x) < 4:
        return 0.0, 0
    y = np.bincount(bins, ramp.current)[x] / count[x]
    top = int(np.argmax(y))     # Beyond it, the joint slides.
    corners = [0]
    for k in range(1, top + 1):
        while len(corners) > 1:
            i, j = corners[-2:]
            if (y[j] - y[i]) * (x[k] - x[j]) > (y[k] - y[j]) * (x[j] - x[i]):
                break
            corners.pop()
        corners.append(k)
    below = np.interp(x[:top + 1], x[corners], y[corners]) - y[:top + 1]
    # Samples within the smoothing window have the same noise.
    windows = np.maximum(1.0, count[x[:top + 1]] / (2 * ramp.half + 1))
    below -= _SURE * ramp.noise / np.sqrt(windows)
    return float(np.max(below) / y[top]), int(np.searchsorted(bins, x[np.argmax(below)]))


def find_backlash(ramps: Sequence[RampFriction], directions: Sequence[int],
                  onward: Sequence[bool], resolution: float) -> tuple[float, list[int]]:
    """Return the backlash of a gear, rad, and each ramp's index at which teeth touch; 0 if none.

    Friction of a gear's contacts is a concave function of displacement, since every contact that
    begins to slide leaves fewer that still stick (Dahl, LuGre, Bouc-Wen and Maxwell slip alike).
    While teeth are apart, only the motor's own friction acts; where they touch, that of the link is
    added and the curve bends upwards. A dip below its concave hull indicates backlash; its lowest
    point is where teeth touch.

    `onward` tells which ramps follow a slide in their own direction. A slide leaves the link
    somewhere between the teeth: the next ramp crosses what is left ahead, one against it what is
    left behind. The backlash is the sum of both.
    """
    depths = [_upturn(ramp, resolution) for ramp in ramps]
    shares = [np.mean([depth > _DEPTH for (depth, _), other in zip(depths, directions)
                       if other == sign]) for sign in set(directions)]
    upturns = [at if depth > _CROSSED else 0 for depth, at in depths]
    # Smoothing shows an impact half a window before it happens.
    backlash = sum(by_side([
        Crossed(same, ramp.position[min(at + ramp.half, len(ramp.position) - 1)]
                if at > 0 else 0.0) for same, ramp, at in zip(onward, ramps, upturns)]))
    # A contact that is stiffer on one side also curves upwards, but in one direction only.
    if len(shares) < 2 or min(shares) < _SHARE or backlash < _SEEN_COUNTS * resolution:
        return 0.0, [0] * len(ramps)
    return backlash, upturns


class Ramp(NamedTuple):
    """One current ramp on which the joint broke away: `samples` are rows of `Sample`.

    `before` is the direction of the last slide before it, 0 if not known; `held` is the last pause
    at which the joint came to rest, `pauses` are the times in s at which each began.
    """

    direction: int
    before: int
    samples: np.ndarray
    held: Held
    pauses: Sequence[float] = ()


@dataclass
class RampEvaluation:
    """Result of a drive's ramps."""

    records: BreakawayRecords
    presliding: Presliding | None   # None if the encoder is too coarse
    warnings: list[str]
    backlash: float | None          # rad; None if none was found


def evaluate_ramps(ramps: Sequence[Ramp], resolution: float, acceleration_per_current: float,
                   viscous: float) -> RampEvaluation:
    """Evaluate the ramps of a drive: breakaway is the largest current that held the joint.

    `resolution` is in rad per count, `acceleration_per_current` (k_t·n/J) in rad/s² per A,
    `viscous` (of Eq. 6) in A·s/rad. Raises IdentificationError if breakaway scatters because of
    backlash.
    """
    directions = [ramp.direction for ramp in ramps]
    records = breakaway_records([
        SlideBegin(ramp.held.end, held_current(ramp), ramp.held.position) for ramp in ramps],
        directions)
    curves = []
    for ramp in ramps:
        held = np.isfinite(ramp.samples[:, 2]) & (ramp.samples[:, 0] <= ramp.held.end)
        time, position, current = ramp.samples[held].T
        curves.append(ramp_friction(time, position, current, ramp.direction, resolution,
                                    acceleration_per_current, viscous))
    onward = [ramp.before == ramp.direction for ramp in ramps]
    backlash, upturns = find_backlash(curves, directions, onward, resolution)
    warnings = [_backlash_message(backlash, records)] if backlash > 0.0 else []
    ratio = float(np.median([_current_gone(ramp) / abs(held_current(ramp)) for ramp in ramps]))
    if ratio > _CREEPS:
        warnings.append(
            'the joint gives way slowly from its breakaway current on, and goes only at '
            f'{ratio:.2f} times that: if it creeps, as a gear does that is shaken, breakaway '
            'friction may be as much higher; if friction rises with the speed, it is right')
    found = _presliding(ramps, curves, records, upturns, resolution, backlash or None)
    return RampEvaluation(records, found, warnings, backlash or None)


def held_current(ramp: Ramp) -> float:
    """Return the mean measured current of a ramp's last stair that held, A, signed."""
    begin = ramp.held.begin + _SETTLING * (ramp.held.end - ramp.held.begin)
    time, _, current = ramp.samples.T
    measured = current[(time >= begin) & (time <= ramp.held.end) & np.isfinite(current)]
    if not measured.size:
        raise IdentificationError('the measured current is not finite')
    return float(np.mean(measured))


def _current_gone(ramp: Ramp) -> float:
    """Return the current on the ramp's last stair, A; at least that of the one that held."""
    time, _, current = ramp.samples.T
    last = max([ramp.held.begin, *ramp.pauses])
    measured = current[(time >= last) & (time <= last + SHORTEST_PAUSE) & np.isfinite(current)]
    return abs(float(np.mean(measured))) if measured.size else abs(held_current(ramp))


def _backlash_message(backlash: float, records: BreakawayRecords) -> str:
    for side, sign in (('positive', 1), ('negative', -1)):
        levels = np.abs(records.currents(sign))
        if len(levels) > 1 and 2.0 * np.std(levels, ddof=1) > (
                _MOST_SCATTER * math.sqrt(len(levels)) * np.mean(levels)):
            raise IdentificationError(
                f'backlash of {backlash:.2g} rad: breakaway in the {side} direction scatters by '
                f'{100.0 * np.std(levels, ddof=1) / np.mean(levels):.0f} %; request more '
                'breakaway_cycles or a less steep ramp_slope')
    return (f'backlash of {backlash:.2g} rad, with what a soft link winds up by; presliding is '
            'given without it, as far as they can be told apart, and stiffness is not given')


def _hardly_crept(ramps: Sequence[Ramp], measured: Sequence[Crossed]) -> list[Crossed]:
    """Return the displacements of the ramps with few pauses, during which a joint may creep.

    Pauses count until the joint has moved as far as the displacement. Of the ramps onward from a
    slide, and of those back from one, half are kept: those with at most the median number.
    """
    pauses = []
    for ramp, one in zip(ramps, measured):
        time, position, _ = ramp.samples.T
        moved = ramp.direction * (np.interp(ramp.pauses, time, position) - position[0])
        pauses.append(np.sum(moved < one.way))
    most = {onward: np.median([count for one, count in zip(measured, pauses)
                               if one.onward == onward])
            for onward in {one.onward for one in measured}}
    return [one for one, count in zip(measured, pauses) if count <= most[one.onward]]


def _presliding(ramps: Sequence[Ramp], peaks: Sequence[RampFriction],
                records: BreakawayRecords, upturns: Sequence[int], resolution: float,
                backlash: float | None) -> Presliding | None:
    levels, directions = np.abs(records.current), records.direction.tolist()
    sides = [np.mean(levels[records.direction == sign]) for sign in set(directions)]
    loaded = max(sides) - min(sides) > _LOADED * (max(sides) + min(sides))
    onward = [ramp.before == ramp.direction for ramp in ramps]
    measured = _hardly_crept(ramps, [
        Crossed(same, peak.presliding(level, upturn))
        for same, peak, level, upturn in zip(onward, peaks, levels, upturns)])
    distance, unknown = combined_presliding(measured, backlash is not None)
    # Less than two counts cannot be resolved.
    if distance <= 2.0 * resolution:
        return None
    return Presliding(
        distance,
        # Of teeth that are apart, it would be that of the motor's side alone.
        common_stiffness([peak for same, peak in zip(onward, peaks) if same],
                         float(np.mean(levels)), resolution) if not loaded and not backlash
        else None,
        presliding_std(measured, distance, unknown, resolution), backlash)
