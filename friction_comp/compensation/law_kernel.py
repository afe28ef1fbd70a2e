# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The compensation laws for one joint and one sample, compiled, from its position to its current.

The continuous law's current is ``trust · share · F(|ω|) · z``, friction times the state of the
operator (`tank_operator`), plus what other effects carry. Whatever the law, `safety` has the last
word. `CompensationLaw` calls these functions for the motor, `reproduce` for thousands of runs.
"""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from friction_comp.compensation.law_fields import (
    CONTINUOUS,
    DESIRED,
    FREE,
    KINETIC,
    LEADING,
    NONE,
    Parameters,
    State,
)
from friction_comp.compensation.safety import BAD_TIME, is_plausible, limited, safe, within_movement
from friction_comp.compensation.tank_operator import LEAD_SPEED, operate
from friction_comp.model.sigmoid import kinetic_current

compiled_kinetic_current = njit(cache=True)(kinetic_current)
LONGEST_STEP = 0.1
"""s; after a longer pause, or a clock that was set, the operator is reset."""
FILTER_TIME = 0.004
"""s of each of the two filters that a speed from positions goes through."""
AGREE_SHARE = 0.2
"""Share by which the reported velocity may lead beside the positions that are seen, over
`LONGEST_STEP`."""
LATE, LATE_TIME = 0.04, 0.5
"""Share withheld of a way that has lasted for so long, s: a joint that is let go comes to rest."""
STARTS = 3.0
"""R from rest over which breakaway friction holds the joint; it fades over as much again."""


@njit(cache=True)
def settle(s: State, position: float) -> None:
    """Reset to a joint at rest at this position, with the operator relaxed."""
    s.position = s.play = s.still_position = s.rest_position = s.farthest = s.begin = position
    s.half_speed = s.speed = s.z = s.element = s.still_time = s.since = s.doubt = 0.0
    s.heading = s.top = s.saved = s.ahead = s.aim = 0.0
    s.mode, s.way = FREE, 0


@njit(cache=True)
def observe(p: Parameters, s: State, time: float, position: float, velocity: float, known: bool
            ) -> bool:
    """Process a sample and return whether a current can be computed.

    A reported velocity counts for the continuous law where it leads to the positions that are
    seen, so that a wrong one cannot mislead it. A position that the joint cannot have reached is
    dropped; the law starts again where such positions last.

    Parameters
    ----------
    p, s : records of PARAMETERS and STATE
        The state changes in place.
    time, position, velocity : float
        s, rad, rad/s.
    known : bool
        Whether the velocity is measured; otherwise the position is differentiated.
    """
    known = known and (math.isfinite(velocity) or p.law < CONTINUOUS)
    if not (math.isfinite(time) and math.isfinite(position)
            and (math.isfinite(velocity) or not known)):
        s.dropped += 1.0
        s.doubt += p.sample_time
        if s.doubt > BAD_TIME:
            s.started = 0
        return False
    if s.started == 0:
        s.started, s.time, s.trust, s.trusted = 1, time - p.sample_time, 1.0, 1.0
        settle(s, position)
    # To whole nanoseconds, the resolution of stamps: a law that is driven by messages and one in
    # a plain loop then see the same step.
    step = round((time - s.time) * 1e9) * 1e-9
    if abs(step) > LONGEST_STEP or s.doubt > BAD_TIME:
        settle(s, position)
        step = p.sample_time
    s.step = max(0.0, step)
    if step > 0.0:
        s.time = time
        travel = position - s.position
        if not is_plausible(p, s, travel, step):
            return True
        s.position = position
        # Filtered twice, so that a single encoder count causes neither a step nor a kink.
        weight = 1.0 - math.exp(-step / FILTER_TIME)
        s.half_speed += (travel / step - s.half_speed) * weight
        s.speed += (s.half_speed - s.speed) * weight
        if p.law < CONTINUOUS:
            s.speed = travel / step
        elif known:
            s.ahead = (s.ahead + velocity * step - travel) * math.exp(-step / LONGEST_STEP)
            speed = min(abs(velocity), abs(s.half_speed))
            if abs(s.ahead) < AGREE_SHARE * LONGEST_STEP * speed + 3.0 * p.resolution:
                s.speed = velocity
    if p.law < CONTINUOUS and known:
        s.speed = velocity
    return True


@njit(cache=True)
def friction_level(p: Parameters, s: State, positive: bool, more: float) -> float:
    """Return F in A: friction in one direction of sliding, from rest to the speed of now.

    `more` is what effects add to sliding friction here, A.
    """
    plateau, mean = (p.upper, p.break_positive) if positive else (-p.lower, p.break_negative)
    speed = abs(s.speed)
    settled = math.tanh(0.5 * p.steepness * speed)
    # Refined effects may only sharpen the transition of Eq. 6: while it rises, their sum counts.
    sliding = max(0.0, min(plateau + more, max(plateau, plateau * settled + more)))
    # Until the joint has left its position of rest, breakaway friction holds it. Speed within
    # presliding is not sliding: it would follow a vibration, some samples late.
    moved = abs(s.position - s.rest_position) / p.distance
    near = max(0.0, min(sliding, mean))
    near += min(1.0, max(0.0, 2.0 - moved / STARTS)) * (mean - near)
    within = 0.0 if s.mode == LEADING else min(1.0, max(0.0, 2.0 - moved))
    rises = settled * min(1.0, speed / LEAD_SPEED) * (1.0 - within)
    # Beyond the identified speeds friction may rise less.
    return near + (sliding + p.viscous * min(speed, p.identified) - near) * rises


@njit(cache=True)
def paper_current(p: Parameters, s: State, direction: float) -> float:
    """Return the current of section 2.5 as printed; `kinetic` is the same with direction 0.

    Eq. 6 counts only in motion: the look-up table has no points around standstill, so that the
    value of the fit there, up to half of the breakaway current, is arbitrary.
    """
    if s.speed != 0.0:
        return compiled_kinetic_current(
            s.speed, p.upper, p.lower, p.steepness, p.shift, p.viscous)
    return p.gain * max(p.break_positive * direction, p.break_negative * -direction) * direction


@njit(cache=True)
def decide(p: Parameters, s: State, direction: float, end: float, is_pushed: bool, forward: float,
           backward: float, carried: float) -> float:
    """Return the motor current in A for the sample that `observe` processed.

    Parameters
    ----------
    p, s : records of PARAMETERS and STATE
    direction : float
        d: -1, 0 or +1, anything else counts as 0.
    end : float
        Position at which the announced movement ends, rad; NaN if that is not said.
    is_pushed : bool
        Whether a sensor feels beyond doubt that a person pushes in this direction.
    forward, backward : float
        Signed contribution of friction effects in each direction of sliding, A; for the continuous
        law only.
    carried : float
        Current of other effects, A; of all effects for the other laws.
    """
    if not (direction == 1.0 or direction == -1.0) or p.law == KINETIC:
        direction = 0.0
    direction = within_movement(p, s, direction, end)
    if s.doubt > 0.0:
        s.friction = s.friction if s.doubt <= BAD_TIME else 0.0
        s.current = s.current if s.doubt <= BAD_TIME else 0.0
        return s.current
    if p.law < CONTINUOUS:
        friction = 0.0 if p.law == NONE else paper_current(p, s, direction)
    elif s.step == 0.0:
        return min(p.limit, max(-p.limit, s.current))
    else:
        share = p.share
        if p.law == DESIRED:
            # Friction of the reference's motion: what the joint does is its controller's affair.
            s.z, s.trust = direction, 1.0
        else:
            operate(p, s, min(1.0, p.gain / p.share) * direction, is_pushed)
            share -= LATE * min(1.0, max(0.0, s.since / LATE_TIME - 1.0)) * (s.mode == FREE)
        positive = s.z > 0.0
        level = friction_level(p, s, positive, forward if positive else -backward)
        friction = s.trust * share * level * s.z
    s.friction = safe(p, s, friction)
    largest = max(p.upper, -p.lower, p.break_positive, p.break_negative) + max(
        0.0, forward, -backward)
    s.current = limited(p, s, s.friction + carried, largest)
    return s.current


@njit(cache=True)
def observe_bank(p: np.ndarray, s: np.ndarray, time: float, position: np.ndarray,
                 velocity: np.ndarray, known: bool, usable: np.ndarray) -> None:
    """Process a sample of every joint; rows are joints."""
    for j in range(len(p)):
        usable[j] = observe(p[j], s[j], time, position[j], velocity[j], known)


@njit(cache=True)
def decide_bank(p: np.ndarray, s: np.ndarray, usable: np.ndarray, direction: np.ndarray,
                end: np.ndarray, is_pushed: np.ndarray, forward: np.ndarray, backward: np.ndarray,
                carried: np.ndarray, current: np.ndarray) -> None:
    """Write every joint's current in A; 0 where the sample cannot be used."""
    for j in range(len(p)):
        if usable[j]:
            current[j] = decide(
                p[j], s[j], direction[j], end[j], is_pushed[j] > 0.0, forward[j], backward[j],
                carried[j])
        else:
            current[j] = s[j].current = s[j].friction = 0.0
