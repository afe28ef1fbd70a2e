# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Breakaway currents and presliding from the ramps of an identification."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import math

import numpy as np
from scipy.special import ndtr, stdtrit

from friction_comp.identification.backlash import crossed_backlash
from friction_comp.identification.breakaway import breakaway_currents, BreakawayRecords
from friction_comp.identification.friction_peak import (
    combined_presliding,
    common_stiffness,
    presliding_std,
    ramp_friction,
    RampFriction,
)
from friction_comp.identification.goal import IdentificationError
from friction_comp.identification.ramp import moving_level, Ramp
from friction_comp.model.friction_model import Presliding

_MOST_LOST = 0.1   # share of ramps without a breakaway that is borne
# Two standard errors of breakaway, as a share of it, that are accepted for a gear with backlash.
_MOST_LOOSE = 0.05


@dataclass
class RampEvaluation:
    """What a drive's ramps say.

    Attributes
    ----------
    records : BreakawayRecords
    presliding : Presliding or None
        None where the encoder is too coarse to tell.
    warnings : list of str
    backlash : float, optional
        rad; None where none shows.
    """

    records: BreakawayRecords
    presliding: Presliding | None
    warnings: list[str] = field(default_factory=list)
    backlash: float | None = None


def evaluate_ramps(ramps: Sequence[Ramp], stopping: Sequence[Ramp], slope: float,
                   resolution: float, acceleration_per_current: float,
                   viscous: float) -> RampEvaluation:
    """Evaluate the ramps of a drive.

    Breakaway is the peak of what friction takes (`friction_peak`). Where friction of a joint that
    slides grows with speed from standstill on, it has no peak, and breakaway is where the slide
    begins (`slide_begin`). One ramp cannot tell that from presliding; a ramp with stops can: at a
    stop presliding comes to rest, a slide does not.

    Parameters
    ----------
    ramps, stopping : sequence of Ramp
        Without stops, and with.
    slope : float
        Gradient in A/s of all of them.
    resolution : float
        rad of an encoder count.
    acceleration_per_current : float
        k_t·n/J in rad/s² per A.
    viscous : float
        A·s/rad, of Eq. 6.

    Raises
    ------
    IdentificationError
        If too many ramps show no breakaway, or backlash makes it scatter.
    """
    def friction_of(ramp: Ramp) -> RampFriction | None:
        time, position, current = ramp.samples[np.isfinite(ramp.samples[:, 2]), :3].T
        return ramp_friction(time, position, current, ramp.direction, resolution,
                             acceleration_per_current, viscous)

    begins, peaks, kept = [], [], []
    for ramp in ramps:
        begin, peak = _slide_begin_of(ramp, resolution), friction_of(ramp)
        if len(begin) > 0 and peak is not None:
            begins.append(begin)
            peaks.append(peak)
            kept.append(ramp)
    warnings = _lost(len(ramps) - len(kept), len(ramps))
    records = BreakawayRecords.join(begins)
    at_peaks = _at_peaks(records, kept, peaks)
    moved = [(moving_level(ramp, slope, resolution), friction_of(ramp)) for ramp in stopping]
    shares = [level / peak.breakaway for level, peak in moved if level and peak]
    # Share of the peak friction that a joint holds at rest, from its stops and from where slides
    # begin.
    begun = float(np.mean(np.abs(records.current)) / np.mean(np.abs(at_peaks.current)))
    if not shares or _lower_bound(shares) > 0.5 * (1.0 + begun):
        records = at_peaks
    sides = [ramp.before == ramp.direction for ramp in kept]
    backlash, crossed = crossed_backlash(peaks, [ramp.direction for ramp in kept], resolution)
    if backlash > 0.0:
        warnings.append(_backlash_message(backlash, records))
    levels = np.abs(records.current)
    return RampEvaluation(records, _presliding(sides, peaks, levels, crossed, resolution),
                          warnings, backlash or None)


def _backlash_message(backlash: float, records: BreakawayRecords) -> str:
    """Return what to say of backlash; refuse a breakaway current that it makes unsure."""
    for sign in (1, -1):
        levels = np.abs(records.current[records.direction == sign])
        if len(levels) > 1 and 2.0 * np.std(levels, ddof=1) > (
                _MOST_LOOSE * math.sqrt(len(levels)) * np.mean(levels)):
            raise IdentificationError(
                f'backlash of {backlash:.2g} rad: breakaway in the '
                f'{"positive" if sign > 0 else "negative"} direction scatters by '
                f'{100.0 * np.std(levels, ddof=1) / np.mean(levels):.0f} %; ask for more '
                'breakaway_cycles or a less steep ramp_slope')
    return (f'backlash of {backlash:.2g} rad at least; presliding is given without it')


def _lower_bound(shares: Sequence[float]) -> float:
    """Return the mean less its uncertainty (Student's t, at the level of one standard error).

    A breakaway current that is too low is the safer error. One ramp has no uncertainty.
    """
    count = len(shares)
    if count < 2:
        return float(shares[0])
    reach = stdtrit(count - 1, ndtr(1.0)) * np.std(shares, ddof=1) / math.sqrt(count)
    return float(np.mean(shares) - reach)


def _slide_begin_of(ramp: Ramp, resolution: float) -> BreakawayRecords:
    time, position, current, warmth = ramp.samples[np.isfinite(ramp.samples[:, 2])].T
    command = ramp.direction * np.maximum(time - time[0], 1e-6)
    begin = breakaway_currents(time, position, current, command=command, temperature=warmth,
                               resolution=resolution)
    begin.rest_time[:], begin.cycle[:] = ramp.rest, ramp.cycle
    return begin


def _lost(lost: int, count: int) -> list[str]:
    if lost > _MOST_LOST * count:
        raise IdentificationError(
            f'{lost} of {count} ramps show no clear breakaway: the joint creeps; '
            'ask for a steeper ramp_slope')
    return [f'{lost} of {count} ramps show no clear breakaway'] if lost else []


def _at_peaks(records: BreakawayRecords, ramps: Sequence[Ramp],
              peaks: Sequence[RampFriction]) -> BreakawayRecords:
    way = np.array([peak.position[peak.peak] for peak in peaks])
    sign = records.direction
    return replace(
        records, time=np.array([peak.time[peak.peak] for peak in peaks]),
        current=sign * np.array([peak.breakaway for peak in peaks]),
        position=np.array([ramp.samples[0, 1] for ramp in ramps]) + sign * way)


def _presliding(sides: Sequence[bool], peaks: Sequence[RampFriction], breakaway: np.ndarray,
                crossed: Sequence[float], resolution: float) -> Presliding | None:
    ways = [(side, max(0.0, peak.presliding(level) - loose))
            for side, peak, level, loose in zip(sides, peaks, breakaway, crossed)]
    distance = combined_presliding(ways)
    # Less than two counts cannot be resolved.
    if distance <= 2.0 * resolution:
        return None
    onward = [peak for side, peak in zip(sides, peaks) if side]
    return Presliding(
        distance, common_stiffness(onward, float(np.mean(breakaway)), resolution),
        presliding_std(ways, distance, resolution))
