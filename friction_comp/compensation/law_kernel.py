# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The compensation laws for one joint and one sample, compiled, from its position to its current.

The continuous law's current is ``A(|ω|)·z``, the amplitude times the state of the operator
(`friction_operator`), plus what other effects carry, within limits. `CompensationLaw` calls these
functions for the motor, and `reproduce` for thousands of runs.
"""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from friction_comp.compensation.friction_operator import (
    announced,
    approach,
    follow,
    lead,
    slow_down,
    turn_round,
)
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
from friction_comp.model.sigmoid import kinetic_current

compiled_kinetic_current = njit(cache=True)(kinetic_current)
LONGEST_STEP = 0.1
"""s; after a longer pause, or a clock that was set, the operator is reset."""
AGREEING = 5
"""Consecutive samples that must agree before an implausible position is accepted."""
FILTER_TIME = 0.004
"""s of each of the two filters that the law's speed goes through."""
TAKEN_DISTANCE = math.radians(0.5)
"""rad farther than at the fastest identified speed, over which trust falls from 1 to 0."""
PACE_TIME, CHANGE_SHARE, CHANGE_SPEED = 0.05, 0.02, 0.003
"""s over which the speed is averaged; relative change and absolute change in rad/s at which the
largest share is withheld."""
END_MARGIN, END_BRAKE = 0.03, 1.25
"""rad, 1.7 deg, beyond the announced end of a movement, where nothing pushes outwards any more; and
rad/s², the deceleration with which a joint without help would stop there: from where it takes more,
help is given back. A person's arm and a trajectory controller come to rest within a degree or two
of the goal; a smaller margin makes the arm heavier just there. Who brakes with less than
`END_BRAKE` keeps all help. With 2 rad/s², 4 of 256 joints that run by themselves go over 5 deg."""
BUMP_TIME = 0.05
"""s with which an exchanged model or law takes effect under a law without slope limit."""


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
    s.pushed_speed = math.inf


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
    weight = 1.0 - math.exp(-step / FILTER_TIME)
    s.half_speed += (travel / step - s.half_speed) * weight
    s.speed += (s.half_speed - s.speed) * weight
    return True


@njit(cache=True)
def amplitude(p: Parameters, s: State, positive: bool, speed: float, more: float
              ) -> tuple[float, float]:
    """Return A in A: the share of friction that is fed forward in one direction of sliding.

    Parameters
    ----------
    positive : bool
    speed : float
        rad/s, not negative.
    more : float
        What effects add to sliding friction here, A.

    Returns
    -------
    amplitude, start : float
        A, and how far the joint is still starting, 1..0.
    """
    if positive:
        plateau, mean = p.upper, p.break_positive
    else:
        plateau, mean = -p.lower, p.break_negative
    settled = math.tanh(0.5 * p.steepness * speed)
    # Refined effects may only sharpen the transition of Eq. 6: while it rises, their sum counts.
    sliding = max(0.0, min(plateau + more, max(plateau, plateau * settled + more)))
    near = p.slow_share * max(0.0, min(sliding, mean))
    # Until the joint has left its position of rest, breakaway friction holds it.
    moved = abs(s.position - s.rest_position)
    start = max(0.0, min(1.0, 2.0 - moved / p.start_distance))
    within = 0.0
    if s.mode != LEADING:
        within = max(0.0, min(1.0, 2.0 - moved / p.distance))
    near += start * max(0.0, p.start_share * mean - near)
    # Speed within presliding is not sliding: A would follow a vibration, some samples late. (While
    # z is led A does follow speed: it falls where the joint slips, before the slip is detected.)
    rises = settled * min(1.0, speed / p.slow) * (1.0 - within)
    # Beyond the identified speeds friction may rise less.
    level = near + (p.share * (sliding + p.viscous * min(speed, p.identified)) - near) * rises
    return level, start


@njit(cache=True)
def faded(p: Parameters, s: State, speed: float) -> float:
    """Return the share of current left above the identified speeds, and lower the trust there.

    A joint that fast is driven by a person in a hurry, whose movement ends, or by more current than
    friction dissipates, without an end: after a way of `hurried_way` its drive is trusted less,
    until later movements have restored it.
    """
    over = speed - p.identified
    if over > 0.0:
        s.overspeed += s.step
        if s.way > p.hurried_way:
            s.trust = max(p.least_trust, s.trust - over * s.step / TAKEN_DISTANCE)
    return 1.0 - min(1.0, max(0.0, speed - p.fade_from) / (p.fade_to - p.fade_from))


@njit(cache=True)
def while_steady(p: Parameters, s: State, speed: float) -> float:
    """Return the share of current left to a joint whose speed changes.

    Every movement starts with acceleration. After the start, a joint that becomes faster than it
    has been since then gains energy: from a person, where friction is below its mean, or because
    the model is too large. The law does not add to that. Nor does it sustain a joint that slows
    down, because that joint is meant to stop.
    """
    s.pace += (s.speed - s.pace) * min(1.0, s.step / PACE_TIME)
    pace = abs(s.pace)
    # A movement begins with motion and ends with rest: neither creep nor a short stop is either.
    if s.mode != FREE or s.z * s.pace <= 0.0:
        s.sliding = 0.0
    elif s.sliding > 0.0 or speed > p.lead_speed:
        s.sliding += s.step
    s.slowest = min(s.slowest, pace) if s.sliding > p.start_time else pace
    weight = min(1.0, s.step / p.start_time) if s.sliding > 0.0 else 1.0
    s.usual += (pace - s.usual) * weight
    changed = max((pace - s.slowest) / (CHANGE_SHARE * s.slowest + CHANGE_SPEED),
                  (s.usual - pace) / (CHANGE_SHARE * s.usual + CHANGE_SPEED))
    # Slowly: otherwise the law would respond to a trembling hand at its own frequency.
    most = 1.0 - p.least_changing
    s.withheld = approach(s.withheld, most * min(1.0, changed), most * s.step / p.start_time)
    return 1.0 - s.withheld


@njit(cache=True)
def sliding_friction(p: Parameters, forward: float, backward: float) -> float:
    """Return friction by the model without viscous friction, A: of Eq. 6 and of effects."""
    return max(p.upper, -p.lower) + max(0.0, forward, -backward)


@njit(cache=True)
def bound_of(p: Parameters, forward: float, backward: float, carried: float) -> float:
    """Return the limit of the current in A: the drive's, and near friction by the model.

    What effects carry is beside friction, so that the bound takes nothing from it.
    """
    sliding = sliding_friction(p, forward, backward) + max(0.0, p.viscous) * p.identified
    friction = max(sliding, p.break_positive, p.break_negative)
    return min(p.limit, p.bound * friction + abs(carried))


@njit(cache=True)
def soft_end(p: Parameters, s: State, current: float) -> float:
    """Return the current in A, reduced where it pushes out of the announced movement or the limits.

    Outside, the joint moves outwards with its bare friction, and inwards with help.
    """
    if current * s.outward > 0.0 and not math.isnan(s.end):
        room = END_MARGIN - s.outward * (s.position - s.end)
        current *= min(1.0, max(0.0, room / max(END_MARGIN, 0.5 * s.speed * s.speed / END_BRAKE)))
    if p.soft_end > 0.0:
        room = p.highest - s.position if current > 0.0 else s.position - p.lowest
        current *= min(1.0, max(0.0, room / p.soft_end))
    return current


@njit(cache=True)
def continuous_current(p: Parameters, s: State, direction: float, is_pushed: bool, forward: float,
                       backward: float, carried: float) -> float:
    """Return the current of the continuous law in A; for the arguments see `decide`."""
    limit = bound_of(p, forward, backward, carried)
    if s.step == 0.0:
        return min(limit, max(-limit, s.current))
    s.bump = 0.0
    heard = announced(p, s, direction)
    turn = 0.0
    desired = p.law == DESIRED
    if desired:
        # Friction of the reference's motion: what the joint does is its controller's affair.
        s.z, s.trust = direction, 1.0
    elif s.doubt == 0.0:
        aim = p.preload * heard
        # A movement in its direction spends an announcement, so a joint cannot swing on it.
        turn = aim if math.isfinite(s.aim_position) else 0.0
        follow(p, s)
        # Not where the push is the other way, or beyond the end.
        lead(p, s, aim, is_pushed and aim * direction > 0.0)
        turn_round(p, s)
        slow_down(p, s, turn)
    speed = abs(s.speed)
    positive = s.z > 0.0
    level, start = amplitude(p, s, positive, speed, forward if positive else -backward)
    share = (1.0 if desired else while_steady(p, s, speed)) * faded(p, s, speed)
    # Before the turn z against this way is a gear that springs back, not a push: one that yields
    # farther than R would swing for ever.
    if not desired and s.z * s.heading < 0.0 and s.z * turn <= 0.0:
        share = 0.0
    friction = s.trust * share * level * s.z
    if s.doubt > p.bad_time:
        s.friction = wanted = 0.0
    elif s.doubt > 0.0:
        wanted = s.current
    else:
        s.friction = soft_end(p, s, friction)
        wanted = s.friction + carried
    wanted = min(limit, max(-limit, wanted))
    slope = 2.0 * sliding_friction(p, forward, backward) / p.turn_time
    current = approach(s.current, wanted, slope * s.step)
    friction = current - carried
    s.breakaway = start * friction
    s.kinetic = friction - s.breakaway
    return current


@njit(cache=True)
def paper_current(p: Parameters, s: State, direction: float) -> float:
    """Return the current of section 2.5 as printed; `kinetic` is the same with direction 0.

    Eq. 6 counts only in motion: the look-up table has no points around standstill, so that the
    value of the fit there, up to half of the breakaway current, is arbitrary.
    """
    s.kinetic = s.breakaway = 0.0
    if s.speed != 0.0:
        s.kinetic = compiled_kinetic_current(
            s.speed, p.upper, p.lower, p.steepness, p.shift, p.viscous)
    elif direction > 0.0:
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
    if p.law >= CONTINUOUS:
        s.current = continuous_current(p, s, direction, is_pushed, forward, backward, carried)
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
                end: np.ndarray, is_pushed: np.ndarray, forward: np.ndarray, backward: np.ndarray,
                carried: np.ndarray, current: np.ndarray) -> None:
    """Write every joint's current in A; 0 where the sample cannot be used."""
    for j in range(len(p)):
        if usable[j]:
            current[j] = decide(
                p[j], s[j], direction[j], end[j], is_pushed[j] > 0.0, forward[j], backward[j],
                carried[j])
        else:
            current[j] = s[j].current = s[j].kinetic = s[j].breakaway = 0.0
