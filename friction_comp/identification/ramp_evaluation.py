# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Current ramps of an identification, and the breakaway currents and presliding they show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, stdtrit

from friction_comp.identification.breakaway import (
    breakaway_records,
    BreakawayRecords,
    slide_begin,
    SlideBegin,
)
from friction_comp.identification.goal import IdentificationError
from friction_comp.identification.presliding import (
    combined_presliding,
    common_stiffness,
    crossed_backlash,
    presliding_std,
    ramp_friction,
    RampFriction,
)
from friction_comp.model.friction_model import Presliding

STOP_TIME = 0.16
"""s that a ramp with stops waits at each."""

# The joint is still moving at a stop if, in the last third of it, it moves at this share of the
# speed of the second third, by this many counts and by this share of the distance since the ramp
# began. A joint on its presliding comes to rest.
_SPEED_SHARE, _COUNTS, _WAY_SHARE = 0.5, 2.0, 0.08
_MOST_LOST = 0.1   # share of ramps without a breakaway that is accepted
# Two standard errors of breakaway, as a share of it, that are accepted for a gear with backlash.
_MOST_LOOSE = 0.05


class Ramp(NamedTuple):
    """One current ramp: `samples` are rows of `Sample`.

    `before` is the direction in which the joint slid last before it, 0 where that is not known;
    `stops` the currents in A at which it waited.
    """

    direction: int
    before: int
    samples: np.ndarray
    stops: tuple[float, ...] = ()


@dataclass
class RampEvaluation:
    """What a drive's ramps say."""

    records: BreakawayRecords
    presliding: Presliding | None   # None where the encoder is too coarse to tell
    warnings: list[str]
    backlash: float | None          # rad; None where none shows


def evaluate_ramps(ramps: Sequence[Ramp], stopping: Sequence[Ramp], slope: float,
                   resolution: float, acceleration_per_current: float,
                   viscous: float) -> RampEvaluation:
    """Evaluate the ramps of a drive, without and with stops, all of a gradient `slope` in A/s.

    Breakaway is the peak of what friction takes (`ramp_friction`). Where friction of a joint that
    slides grows with speed from standstill on, it has no peak, and breakaway is where the slide
    begins (`slide_begin`). One ramp cannot tell that from presliding; a ramp with stops can: at a
    stop presliding comes to rest, a slide does not.

    Parameters are in rad a count, rad/s² per A (k_t·n/J) and A·s/rad (of Eq. 6). Raises
    IdentificationError if too many ramps show no breakaway, or backlash makes it scatter.
    """
    def friction_of(ramp: Ramp) -> RampFriction | None:
        return ramp_friction(*_measured(ramp), ramp.direction, resolution,
                             acceleration_per_current, viscous)

    both = [(ramp, slide_begin(*_measured(ramp), ramp.direction, resolution), friction_of(ramp))
            for ramp in ramps]
    known = [(ramp, begin, peak) for ramp, begin, peak in both if begin and peak]
    count, lost = len(ramps), len(ramps) - len(known)
    if lost > _MOST_LOST * count:
        raise IdentificationError(
            f'{lost} of {count} ramps show no clear breakaway: the joint creeps; '
            'ask for a steeper ramp_slope')
    warnings = [f'{lost} of {count} ramps show no clear breakaway'] if lost else []
    kept, peaks = [ramp for ramp, _, _ in known], [peak for _, _, peak in known]
    directions = [ramp.direction for ramp in kept]
    begins = [begin for _, begin, _ in known]
    tops = [SlideBegin(peak.time[peak.peak], ramp.direction * peak.breakaway,
                       ramp.samples[0, 1] + ramp.direction * peak.position[peak.peak])
            for ramp, peak in zip(kept, peaks)]
    records = breakaway_records(tops, directions)
    moved = [(moving_level(ramp, slope, resolution), friction_of(ramp)) for ramp in stopping]
    shares = [level / peak.breakaway for level, peak in moved if level and peak]
    # Share of the peak friction that a joint holds at rest, from its stops and from where slides
    # begin.
    slides = breakaway_records(begins, directions)
    begun = float(np.mean(np.abs(slides.current)) / np.mean(np.abs(records.current)))
    if shares and _lower_bound(shares) <= 0.5 * (1.0 + begun):
        records = slides
    backlash, upturns = crossed_backlash(peaks, directions, resolution)
    if backlash > 0.0:
        warnings.append(_backlash_message(backlash, records))
    return RampEvaluation(records, _presliding(kept, peaks, records, upturns, resolution,
                                               backlash or None),
                          warnings, backlash or None)


def _measured(ramp: Ramp) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, position and current of the samples whose current was measured."""
    time, position, current = ramp.samples[np.isfinite(ramp.samples[:, 2])].T
    return time, position, current


def _lower_bound(shares: Sequence[float]) -> float:
    """Return the mean less its uncertainty (Student's t, at the level of one standard error).

    A breakaway current that is too low is the safer error. One ramp has no uncertainty.
    """
    count = len(shares)
    if count < 2:
        return float(shares[0])
    reach = stdtrit(count - 1, ndtr(1.0)) * np.std(shares, ddof=1) / math.sqrt(count)
    return float(np.mean(shares) - reach)


def _backlash_message(backlash: float, records: BreakawayRecords) -> str:
    """Return what to say of backlash; refuse a breakaway current that it makes unsure."""
    for side, sign in (('positive', 1), ('negative', -1)):
        levels = np.abs(records.currents(sign))
        if len(levels) > 1 and 2.0 * np.std(levels, ddof=1) > (
                _MOST_LOOSE * math.sqrt(len(levels)) * np.mean(levels)):
            raise IdentificationError(
                f'backlash of {backlash:.2g} rad: breakaway in the {side} direction scatters by '
                f'{100.0 * np.std(levels, ddof=1) / np.mean(levels):.0f} %; ask for more '
                'breakaway_cycles or a less steep ramp_slope')
    return f'backlash of {backlash:.2g} rad; presliding is given without it'


def _presliding(ramps: Sequence[Ramp], peaks: Sequence[RampFriction], records: BreakawayRecords,
                upturns: Sequence[int], resolution: float,
                backlash: float | None) -> Presliding | None:
    levels = np.abs(records.current)
    onward = [ramp.before == ramp.direction for ramp in ramps]
    ways = [(same, peak.presliding(level, upturn))
            for same, peak, level, upturn in zip(onward, peaks, levels, upturns)]
    distance = combined_presliding(ways)
    # Less than two counts cannot be resolved.
    if distance <= 2.0 * resolution:
        return None
    return Presliding(
        distance,
        common_stiffness([peak for same, peak in zip(onward, peaks) if same],
                         float(np.mean(levels)), resolution),
        presliding_std(ways, distance, resolution), backlash)


def time_of_ramp(elapsed: float, slope: float, stops: Sequence[float]) -> float:
    """Return the time on the ramp of Eq. 8 in s, after waiting at each of the stops, A."""
    late = 0.0
    for level in stops:
        reached = level / slope + late
        if elapsed <= reached:
            break
        if elapsed <= reached + STOP_TIME:
            return level / slope
        late += STOP_TIME
    return elapsed - late


def moving_level(ramp: Ramp, slope: float, resolution: float) -> float | None:
    """Return the current in A at which the joint keeps moving although the current is held.

    The first stop from which on it never comes to rest; None where it does at the last.
    """
    time, position = ramp.samples[:, 0] - ramp.samples[0, 0], ramp.samples[:, 1]
    way = ramp.direction * (position - position[0])
    moving = None
    for k, level in enumerate(ramp.stops):
        begin = level / slope + k * STOP_TIME
        if time[-1] < begin + STOP_TIME:
            return moving or level  # It ran away at this stop, or on the way to it.
        a, b, c = np.interp(begin + STOP_TIME * np.array([1.0, 2.0, 3.0]) / 3.0, time, way)
        rests = c - b <= max(_SPEED_SHARE * (b - a), _COUNTS * resolution, _WAY_SHARE * c)
        moving = None if rests else moving or level
    return moving
