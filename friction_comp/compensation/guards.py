# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Selects the samples that the compensation laws use, and handles implausible ones.

The continuous law computes from positions alone, so that a wrong velocity cannot mislead it. A
position that the joint cannot have reached is dropped. After a few consecutive samples that agree
with each other the new position is accepted, and the operator starts again from there. Until then
the current is held for `bad_time`, and is zero after that.
"""

from __future__ import annotations

import math
from typing import Any

from friction_comp.compensation.records import CONTINUOUS, FREE
from friction_comp.compiling import njit
from friction_comp.low_pass import low_pass_weight

LONGEST_STEP = 0.1
"""s; after a longer pause, or a clock that was set, the operator is reset."""
AGREEING = 5
"""Consecutive samples that must agree before an implausible position is accepted."""
ABSURD = 1e6
"""rad; beyond any joint."""
FILTER_TIME = 0.004
"""s of each of the two filters that the law's speed goes through."""
END_MARGIN, END_TIME = 0.03, 0.3
"""rad, 1.7 deg, beyond the announced end of a movement, where nothing pushes outwards any more; and
s before that place from which on help is given back. A person's arm and a trajectory controller
come to rest within a degree or two of the goal; a smaller margin makes the arm heavier just there.
Who brakes evenly for twice the time, or longer, keeps all help. A shorter one gives a joint that
runs by itself no room to stop: with 0.25 s, 2 of 768 go farther than 5 deg.
"""


@njit(cache=True)
def begin(p: Any, s: Any, time: float, position: float) -> None:
    """Start at a position, at rest."""
    s.started = 1
    s.time, s.step = time, p.sample_time
    s.seen = position
    s.trust = s.trusted = 1.0
    settle(s, position)


@njit(cache=True)
def settle(s: Any, position: float) -> None:
    """Reset to a joint at rest at this position, with the operator relaxed."""
    s.position = s.backlash_position = s.still_position = position
    s.rest_position = s.lead_position = s.stop_position = position
    s.half_speed = s.speed = s.z = s.still_time = s.since = s.doubt = 0.0
    s.mode, s.displaced, s.stopped = FREE, 0, 0.0
    s.pace = s.slowest = s.usual = s.sliding = s.withheld = 0.0
    s.heading = s.top = s.way = s.saved = 0.0


@njit(cache=True)
def observe(p: Any, s: Any, time: float, position: float, velocity: float, known: bool) -> bool:
    """Process a sample and return whether a current can be computed.

    Parameters
    ----------
    p, s : records of PARAMETERS and STATE
        The state changes in place.
    time, position, velocity : float
        s, rad, rad/s.
    known : bool
        Whether the velocity is measured; otherwise the position is differentiated.
    """
    # Drivers report NaN for what they do not measure; the continuous law needs no velocity.
    if p.law >= CONTINUOUS and math.isnan(velocity):
        known = False
    if not (math.isfinite(time) and math.isfinite(position) and abs(position) < ABSURD
            and (math.isfinite(velocity) or not known)):
        s.dropped += 1.0
        s.doubt += p.sample_time
        if s.doubt > p.bad_time:
            s.started = 0
        return False
    if s.started == 0:
        dropped, slips, overspeed = s.dropped, s.slips, s.overspeed
        begin(p, s, time - p.sample_time, position)
        s.dropped, s.slips, s.overspeed = dropped, slips, overspeed
    # To whole nanoseconds, the resolution of stamps: a law that is driven by messages and one in
    # a plain loop then see the same step.
    step = round((time - s.time) * 1e9) * 1e-9
    leaps = step > LONGEST_STEP or step < -LONGEST_STEP
    again = leaps and 0.0 < time - s.leapt <= LONGEST_STEP
    if again or (p.law < CONTINUOUS and step > LONGEST_STEP):
        # Two in a row: a pause, or the clock was set. The other laws have no memory.
        settle(s, position)
        step, s.bump = p.sample_time, 0.0
    elif leaps and step > 0.0:
        # A single one is a wrong stamp. Accepted, it would make all later ones too old.
        s.leapt = time
        s.dropped += 1.0
        return False
    elif step <= 0.0:
        s.step = 0.0
        if leaps:
            s.leapt = time
        if p.law < CONTINUOUS and known:
            s.speed = velocity
        return True
    s.step, s.time = step, time
    travel = position - s.position
    if p.law < CONTINUOUS:
        s.speed = velocity if known else travel / step
        s.position = position
        return True
    near = p.fastest * step + 3.0 * p.resolution
    s.agreed = s.agreed + 1 if abs(position - s.seen) <= near else 0
    s.seen = position
    if abs(travel) > near + p.fastest * s.doubt:
        s.dropped += 1.0
        s.doubt += step
        if s.agreed < AGREEING:
            return True
        settle(s, position)
        travel = 0.0
    s.doubt = 0.0
    s.position = position
    # Filtered twice, so that a single encoder count causes neither a step nor a kink.
    weight = low_pass_weight(step, FILTER_TIME)
    s.half_speed += (travel / step - s.half_speed) * weight
    s.speed += (s.half_speed - s.speed) * weight
    if known:
        _compare(p, s, velocity)
    return True


@njit(cache=True)
def _compare(p: Any, s: Any, velocity: float) -> None:
    """Update the time in s for which the measured velocity has contradicted the encoder."""
    tolerance = 0.05 + 0.5 * abs(s.speed) + 3.0 * p.resolution / s.step
    if abs(velocity - s.speed) > tolerance:
        s.contradiction = min(2.0 * p.rest_time, s.contradiction + s.step)
    else:
        s.contradiction = max(0.0, s.contradiction - s.step)


@njit(cache=True)
def in_doubt(p: Any, s: Any) -> bool:
    """Return whether samples have been implausible for so long that the current is zero."""
    return s.doubt > p.bad_time or s.contradiction > p.rest_time


@njit(cache=True)
def within_movement(p: Any, s: Any, direction: float, end: float) -> float:
    """Return the direction, 0 for a joint that has been beyond the end of its movement.

    The end in rad, NaN if it is not said, holds until another movement is announced, or the joint
    rests while none is: an announcement ceases before its movement does.
    """
    if direction != 0.0 and not (direction == s.outward and end == s.end):
        s.outward, s.end, s.beyond = direction, end, 0
    elif direction == 0.0 and s.still_time >= p.rest_time:
        s.outward, s.beyond = 0.0, 0
    if s.outward * (s.position - s.end) > END_MARGIN:
        s.beyond = 1
    return 0.0 if s.beyond == 1 else direction


@njit(cache=True)
def soft_end(p: Any, s: Any, current: float) -> float:
    """Return the current in A, reduced where it pushes out of the announced movement or the limits.

    Outside, the joint moves outwards with its bare friction, and inwards with help.
    """
    if current * s.outward > 0.0 and not math.isnan(s.end):
        room = END_MARGIN - s.outward * (s.position - s.end)
        current *= min(1.0, max(0.0, room / max(END_MARGIN, END_TIME * abs(s.speed))))
    if p.soft_end > 0.0:
        room = p.highest - s.position if current > 0.0 else s.position - p.lowest
        current *= min(1.0, max(0.0, room / p.soft_end))
    return current
