# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates current ramps: breakaway currents, presliding and backlash."""

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
    find_backlash,
    presliding_std,
    ramp_friction,
    RampFriction,
)
from friction_comp.model.friction_model import Presliding

STOP_TIME = 0.16
"""Length of each pause of a ramp, s."""

# The joint slides during a pause if it moves in the last third by more than this share of its
# movement in the second third, this many counts and this share of the distance since the ramp
# began. A joint in presliding comes to rest.
_SPEED_SHARE, _COUNTS, _DISTANCE_SHARE = 0.5, 2.0, 0.08
_MOST_LOST = 0.1   # accepted share of ramps without a breakaway
# Accepted two standard errors of breakaway, as a share of it, for a gear with backlash.
_MOST_SCATTER = 0.05


class Ramp(NamedTuple):
    """One current ramp: `samples` are rows of `Sample`.

    `before` is the direction of the last slide before it, 0 if not known; `stops` are the currents
    in A at which the ramp paused.
    """

    direction: int
    before: int
    samples: np.ndarray
    stops: tuple[float, ...] = ()


@dataclass
class RampEvaluation:
    """Result of a drive's ramps."""

    records: BreakawayRecords
    presliding: Presliding | None   # None if the encoder is too coarse
    warnings: list[str]
    backlash: float | None          # rad; None if none was found


def evaluate_ramps(ramps: Sequence[Ramp], stopping: Sequence[Ramp], slope: float,
                   resolution: float, acceleration_per_current: float,
                   viscous: float) -> RampEvaluation:
    """Evaluate the ramps of a drive, without and with pauses, all with `slope` in A/s.

    Breakaway is the peak of friction (`ramp_friction`). If friction increases with speed from
    standstill, it has no peak, and breakaway is where the slide begins (`slide_begin`). Only ramps
    with pauses distinguish that from presliding: during a pause presliding comes to rest, a slide
    does not.

    `resolution` is in rad per count, `acceleration_per_current` (k_t·n/J) in rad/s² per A, and
    `viscous` (of Eq. 6) in A·s/rad. Raises IdentificationError if too many ramps show no breakaway,
    or if it scatters because of backlash.
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
            'request a steeper ramp_slope')
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
    # Compare the share of peak friction at which the joint slides: from pauses (`shares`), and from
    # the beginnings of slides (`begun`).
    slides = breakaway_records(begins, directions)
    begun = float(np.mean(np.abs(slides.current)) / np.mean(np.abs(records.current)))
    if shares and _lower_bound(shares) <= 0.5 * (1.0 + begun):
        records = slides
    backlash, upturns = find_backlash(peaks, directions, resolution)
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
    """Return the mean minus its uncertainty (Student's t, at the level of one standard error).

    A breakaway current that is too low is the safer error. For one ramp the uncertainty is zero.
    """
    count = len(shares)
    if count < 2:
        return float(shares[0])
    reach = stdtrit(count - 1, ndtr(1.0)) * np.std(shares, ddof=1) / math.sqrt(count)
    return float(np.mean(shares) - reach)


def _backlash_message(backlash: float, records: BreakawayRecords) -> str:
    """Return the warning about backlash; raise if breakaway scatters too much because of it."""
    for side, sign in (('positive', 1), ('negative', -1)):
        levels = np.abs(records.currents(sign))
        if len(levels) > 1 and 2.0 * np.std(levels, ddof=1) > (
                _MOST_SCATTER * math.sqrt(len(levels)) * np.mean(levels)):
            raise IdentificationError(
                f'backlash of {backlash:.2g} rad: breakaway in the {side} direction scatters by '
                f'{100.0 * np.std(levels, ddof=1) / np.mean(levels):.0f} %; request more '
                'breakaway_cycles or a less steep ramp_slope')
    return f'backlash of {backlash:.2g} rad; presliding is given without it'


def _presliding(ramps: Sequence[Ramp], peaks: Sequence[RampFriction], records: BreakawayRecords,
                upturns: Sequence[int], resolution: float,
                backlash: float | None) -> Presliding | None:
    levels = np.abs(records.current)
    onward = [ramp.before == ramp.direction for ramp in ramps]
    measured = [(same, peak.presliding(level, upturn))
                for same, peak, level, upturn in zip(onward, peaks, levels, upturns)]
    distance = combined_presliding(measured)
    # Less than two counts cannot be resolved.
    if distance <= 2.0 * resolution:
        return None
    return Presliding(
        distance,
        common_stiffness([peak for same, peak in zip(onward, peaks) if same],
                         float(np.mean(levels)), resolution),
        presliding_std(measured, distance, resolution), backlash)


def time_of_ramp(elapsed: float, slope: float, stops: Sequence[float]) -> float:
    """Return the time on the ramp of Eq. 8 in s, which stands still during pauses at `stops`, A."""
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
    """Return the current in A of the first pause from which on the joint never comes to rest.

    None if it comes to rest at the last pause.
    """
    time, position = ramp.samples[:, 0] - ramp.samples[0, 0], ramp.samples[:, 1]
    moved = ramp.direction * (position - position[0])
    moving = None
    for k, level in enumerate(ramp.stops):
        begin = level / slope + k * STOP_TIME
        if time[-1] < begin + STOP_TIME:
            return moving or level  # It slid during this pause, or before it.
        a, b, c = np.interp(begin + STOP_TIME * np.array([1.0, 2.0, 3.0]) / 3.0, time, moved)
        rests = c - b <= max(_SPEED_SHARE * (b - a), _COUNTS * resolution, _DISTANCE_SHARE * c)
        moving = None if rests else moving or level
    return moving
