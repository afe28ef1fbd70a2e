# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates current ramps: breakaway currents, presliding and backlash."""

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
from friction_comp.model.measured import Presliding

# Share of a pause at its beginning whose current is not used: the current controller settles.
_SETTLING = 0.3
# Accepted two standard errors of breakaway, as a share of it, for a gear with backlash.
_MOST_SCATTER = 0.05


class Ramp(NamedTuple):
    """One current ramp on which the joint broke away: `samples` are rows of `Sample`.

    `before` is the direction of the last slide before it, 0 if not known; `held` is the last pause
    at which the joint came to rest.
    """

    direction: int
    before: int
    samples: np.ndarray
    held: Held


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
        SlideBegin(ramp.held.end, _held_current(ramp), ramp.held.position) for ramp in ramps],
        directions)
    curves = []
    for ramp in ramps:
        held = np.isfinite(ramp.samples[:, 2]) & (ramp.samples[:, 0] <= ramp.held.end)
        time, position, current = ramp.samples[held].T
        curves.append(ramp_friction(time, position, current, ramp.direction, resolution,
                                    acceleration_per_current, viscous))
    backlash, upturns = find_backlash(curves, directions, resolution)
    warnings = [_backlash_message(backlash, records)] if backlash > 0.0 else []
    presliding = _presliding(ramps, curves, records, upturns, resolution, backlash or None)
    return RampEvaluation(records, presliding, warnings, backlash or None)


def _held_current(ramp: Ramp) -> float:
    begin = ramp.held.begin + _SETTLING * (ramp.held.end - ramp.held.begin)
    time, _, current = ramp.samples.T
    measured = current[(time >= begin) & (time <= ramp.held.end) & np.isfinite(current)]
    if not measured.size:
        raise IdentificationError('the measured current is not finite')
    return float(np.mean(measured))


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
