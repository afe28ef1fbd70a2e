# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""All compensation laws for one joint and one sample, compiled.

`CompensationLaw` calls these functions for the motor, and `reproduce` for thousands of runs.
"""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from friction_comp.compensation.friction_operator import continuous_current, END_MARGIN
from friction_comp.compensation.law_fields import CONTINUOUS, FREE, KINETIC, NONE, Parameters, State
from friction_comp.low_pass import low_pass_weight
from friction_comp.model.sigmoid import compiled_kinetic_current

BUMP_TIME = 0.05
"""s; time constant with which an exchanged model or law takes effect under one without slope limit.
"""
LONGEST_STEP = 0.1
"""s; after a longer pause, or a clock that was set, the operator is reset."""
AGREEING = 5
"""Consecutive samples that must agree before an implausible position is accepted."""
FILTER_TIME = 0.004
"""s of each of the two filters that the law's speed goes through."""


@njit(cache=True)
def begin(p: Parameters, s: State, time: float, position: float) -> None:
    """Start at a position, at rest."""
    s.started = 1
    s.time, s.step = time, p.sample_time
    s.seen = position
    s.trust = s.trusted = 1.0
    settle(s, position)


@njit(cache=True)
def settle(s: State, position: float) -> None:
    """Reset to a joint at rest at this position, with the operator relaxed."""
    s.position = s.backlash_position = s.still_position = position
    s.rest_position = s.lead_position = s.farthest = position
    s.half_speed = s.speed = s.z = s.still_time = s.since = s.doubt = 0.0
    s.mode, s.displaced, s.slowed = FREE, 0, 0
    s.pace = s.slowest = s.usual = s.sliding = s.withheld = 0.0
    s.heading = s.top = s.way = s.saved = s.swing = 0.0


@njit(cache=True)
def observe(p: Parameters, s: State, time: float, position: float, velocity: float, known: bool
            ) -> bool:
    """Process a sample and return whether a current can be computed.

    The continuous law computes from positions alone, so that a wrong velocity cannot mislead it. A
    position that the joint cannot have reached is dropped. After a few consecutive samples that
    agree with each other the new position is accepted, and the operator starts again from there.
    Until then the current is held for `bad_time`, and is zero after that.

    Parameters
    ----------
    p, s : records of PARAMETERS and STATE
        The state changes in place.
    time, position, velocity : float
        s, rad, rad/s.
    known : bool
        Whether the velocity is measured; otherwise the position is differentiated.
    """
    if not (math.isfinite(time) and math.isfinite(position)
            and (p.law >= CONTINUOUS or math.isfinite(velocity) or not known)):
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
    if abs(step) > LONGEST_STEP:
        # A pause, or the clock was set.
        settle(s, position)
        step, s.bump = p.sample_time, 0.0
    elif step <= 0.0:
        s.step = 0.0
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
    return True


@njit(cache=True)
def printed_current(p: Parameters, speed: float) -> float:
    """Return the kinetic term of the printed law in A.

    Eq. 6, but only in motion: the look-up table has no points around standstill, so that the value
    of the fit there, up to half of the breakaway current, is arbitrary.
    """
    if speed == 0.0:
        return 0.0
    return compiled_kinetic_current(
        speed, p.upper, p.lower, p.steepness, p.shift, p.viscous)


@njit(cache=True)
def paper_current(p: Parameters, s: State, direction: float) -> float:
    """Return the current of section 2.5 as printed; `kinetic` is the same with direction 0."""
    s.kinetic = printed_current(p, s.speed)
    s.breakaway = 0.0
    if s.speed == 0.0:
        if direction > 0.0:
            s.breakaway = p.gain * p.break_positive
        elif direction < 0.0:
            s.breakaway = -p.gain * p.break_negative
    return s.kinetic + s.breakaway


@njit(cache=True)
def within_movement(p: Parameters, s: State, direction: float, end: float) -> float:
    """Return the direction, 0 for a joint that has been beyond the end of its movement.

    The end in rad, NaN if it is not said, holds until another movement is announced, or the joint
    rests while none is: an announcement ceases before its movement does. Other laws know no rest.
    """
    if direction != 0.0 and not (direction == s.outward and end == s.end):
        s.outward, s.end, s.beyond = direction, end, 0
    elif direction == 0.0 and (p.law != CONTINUOUS or s.still_time >= p.rest_time):
        s.outward, s.beyond = 0.0, 0
    if s.outward * (s.position - s.end) > END_MARGIN:
        s.beyond = 1
    return 0.0 if s.beyond == 1 else direction


@njit(cache=True)
def decide(p: Parameters, s: State, direction: float, end: float, forward: float, backward: float,
           carried: float) -> float:
    """Return the motor current in A for the sample that `observe` processed.

    Parameters
    ----------
    p, s : records of PARAMETERS and STATE
    direction : float
        d: -1, 0 or +1, anything else counts as 0.
    end : float
        Position at which the announced movement ends, rad; NaN if that is not said.
    forward, backward : float
        Signed contribution of friction effects in each direction of sliding, A; for the continuous
        law only.
    carried : float
        Current of other effects, A; of all effects for the other laws.
    """
    if not (direction == 1.0 or direction == -1.0) or p.law == KINETIC:
        direction = 0.0
    direction = within_movement(p, s, direction, end)
    if p.law >= CONTINUOUS:
        s.current = continuous_current(p, s, direction, forward, backward, carried)
    else:
        wanted = 0.0 if p.law == NONE else paper_current(p, s, direction) + carried
        if s.changed == 1:
            s.bump = s.current - wanted
        s.bump *= math.exp(-s.step / BUMP_TIME)
        s.current = min(p.limit, max(-p.limit, wanted + s.bump))
    s.changed = 0
    return s.current


@njit(cache=True)
def observe_bank(p: np.ndarray, s: np.ndarray, time: float, position: np.ndarray,
                 velocity: np.ndarray, known: bool, usable: np.ndarray) -> None:
    """Process a sample of every joint; rows are joints."""
    for j in range(len(p)):
        usable[j] = observe(p[j], s[j], time, position[j], velocity[j], known)


@njit(cache=True)
def decide_bank(p: np.ndarray, s: np.ndarray, usable: np.ndarray, direction: np.ndarray,
                end: np.ndarray, forward: np.ndarray, backward: np.ndarray, carried: np.ndarray,
                current: np.ndarray) -> None:
    """Write every joint's current in A; 0 where the sample cannot be used."""
    for j in range(len(p)):
        if usable[j]:
            current[j] = decide(
                p[j], s[j], direction[j], end[j], forward[j], backward[j], carried[j])
        else:
            current[j] = s[j].current = s[j].kinetic = s[j].breakaway = 0.0
