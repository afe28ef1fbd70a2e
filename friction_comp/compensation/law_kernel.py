# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The compensation laws for one joint and one sample, compiled, from its position to its current.

The continuous law's current is ``trust · share · F(|ω|) · z``, plus what other effects carry; z in
-1..1 is the part of help and its direction. Displacement moves z; sliding pays for what else does:

1. *Displacement* moves z as it moves an elastic-plastic element of distance R.
2. *The tank* holds a distance. Whatever else moves z takes of it what help may then still give.
   Sliding fills it with a small share of the way, and rest does; it holds one reversal, 2 R.
3. *One wish*: the heading in motion, the announced direction as the joint slows down and at rest.
4. *Trust*: a joint that slips under its preload keeps a part of its help.

The proof that this is passive is in docs/law_proof.md. Whatever the law, `safety` has the last
word. `CompensationLaw` calls these functions for the motor, `reproduce` for thousands of runs.
"""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from friction_comp.compensation.law_parameters import (
    CONTINUOUS,
    DESIRED,
    KINETIC,
    NONE,
    Parameters,
    State,
    STILL,
)
from friction_comp.compensation.safety import BAD_TIME, is_plausible, limited, safe, within_movement
from friction_comp.model.sigmoid import kinetic_current

compiled_kinetic_current = njit(cache=True)(kinetic_current)
FREE, LEADING, HELD = range(3)
"""The joint moves; z goes to the announced direction at a joint that rests; it rests."""
LONGEST_STEP = 0.1
"""s; after a longer pause, or a clock that was set, the operator is reset."""
SPEED_TIME = 0.0025
"""s over which a speed is measured, at least, and of the filter that it goes through."""
LATE, LATE_TIME = 0.04, 0.5
"""Share withheld of a way that has lasted for so long, s: a joint that is let go comes to rest."""
STARTS = 3.0
"""R from rest over which breakaway friction holds the joint; it fades over as much again."""
FILL = 0.025
"""Share of the slid way that goes into the tank: what the share of help leaves to the gear."""
REST_TIME = 0.15
"""s for which a joint must be still to rest. Twice that fills the tank; so long must another
announcement last at a joint that has its preload."""
LEAD_TIME = 0.1
"""s over which the preload rises, and goes where somebody pushes against it."""
TURN_SHARE, SLOW = 0.10, 0.01
"""Share of a way's top speed below which the wish turns from heading to announced direction: with
less, help is still there at a turn; with more, a joint stops short of where the hand wants it. And
rad/s, with which a preload moves a joint; ways slower than ten times that give nothing back.
"""
EARLY, LATER = 0.7, 0.94
"""Factors on trust: of a slip as early as the law alone would cause it, and of any other."""
MOVED = math.radians(1.0)
"""rad; nobody is pushed farther by accident: a joint that goes on is moved by a person."""


@njit(cache=True)
def operate(p: Parameters, s: State, aim: float, is_pushed: bool) -> None:
    """Move z by the displacement of this sample and towards its wish, as far as the tank pays.

    `aim` is the announced direction times the share of help at rest.
    """
    driven = min(s.position + p.play, max(s.position - p.play, s.driven))
    moved, s.driven = driven - s.driven, driven
    # A joint that is not on its way is told otherwise when that has lasted, creep or not.
    s.lasted += s.step
    on_its_way = s.mode == FREE and s.heading != 0.0
    if on_its_way or s.aim == 0.0 or aim == s.aim or s.lasted > 2.0 * REST_TIME:
        s.aim, s.lasted = aim, 0.0
    _note_rest(p, s, s.aim)
    _note_way(p, s, moved)
    if s.mode == LEADING:
        _watch_slip(p, s, s.aim, is_pushed)
    elif s.mode == FREE and abs(s.position - s.rest_position) > MOVED and s.trusted < 2.0:
        s.trust, s.trusted = min(1.0, max(s.trust, s.trusted) + 1.0 - LATER), 2.0
    free = min(1.0, max(-1.0, s.z + moved / p.distance))
    wish, rate = _wish(p, s, s.aim, free)
    begin = s.z if s.mode == LEADING else free
    z = begin + min(rate * s.step, max(-rate * s.step, wish - begin))
    # What displacement alone would give, and what the slid way adds, less what help gave.
    element = min(1.0, max(-1.0, s.element + moved / p.distance))
    slid = abs(moved - p.distance * (element - s.element))
    left = (s.saved + (1.0 + FILL) * slid - s.z * moved
            + _debt(p.distance, s.z, s.element) - _debt(p.distance, free, element))
    price = p.distance + p.play
    for _ in range(12):
        owed = (_debt(price, z, element) - _debt(price, free, element))
        if owed <= left:
            break
        z = free + 0.7 * (z - free)
    else:
        z, owed = free, 0.0
    s.saved = min(2.0 * price, max(0.0, left - owed))
    s.z, s.element = z, element


@njit(cache=True)
def _debt(distance: float, z: float, element: float) -> float:
    """Return the most that help of z may still give beyond the element's, on any path, rad."""
    return 0.5 * distance * (1.0 - z * z) + distance * abs(element - z)


@njit(cache=True)
def _note_rest(p: Parameters, s: State, aim: float) -> None:
    """Note whether the joint rests, and begin what a rest begins."""
    s.still_time, s.since = s.still_time + s.step, s.since + s.step
    still = p.play if aim == 0.0 else STILL * p.slip + p.resolution
    if abs(s.position - s.still_position) > still:
        s.still_position, s.still_time = s.position, 0.0
    if s.still_time >= REST_TIME or s.mode == LEADING:
        s.saved += p.distance * s.step / REST_TIME
    if s.still_time < REST_TIME:
        if s.mode == HELD:
            s.mode, s.since = FREE, 0.0
        return
    if s.mode == FREE:
        s.trusted = s.trust
        # Within the slip distance a joint that creeps has not left its position of rest.
        if abs(s.position - s.rest_position) > p.slip:
            s.rest_position = s.driven = s.position
            # Help goes on from what it was in motion, a smaller part of breakaway friction.
            at_rest = s.trust * p.share * (p.break_positive if s.z > 0.0 else p.break_negative)
            s.z = math.copysign(min(abs(s.z), abs(s.friction) / (at_rest + 1e-9)), s.z)
    # Where displacement has led z beyond its aim, help only decreases, which moves no joint.
    if s.mode != LEADING and (aim - s.z) * aim > 0.02 * abs(aim):
        s.mode, s.since, s.still_time = LEADING, 0.0, 0.0
        # A joint yields twice as far from one preload to the other as from none.
        s.yields = p.slip * max(1.0, abs(aim - s.z))
    else:
        s.mode = HELD
    s.begin, s.is_fresh = s.position, int(abs(s.z) < 0.02)
    # While help decays at rest, a gear springs back.
    s.heading = 0.0 if s.is_fresh or aim != 0.0 else math.copysign(1.0, s.z)
    s.top = 0.0
    # No gear moves against its preload.
    if s.is_fresh or (s.position - s.farthest) * s.z > 0.0:
        s.farthest = s.position


@njit(cache=True)
def _note_way(p: Parameters, s: State, moved: float) -> None:
    """Note how far this way has gone, and where another one begins: R behind its farthest point.

    A joint that rested is on its way when it moves at all. If nobody announced anything, one count
    to and fro, which moves no play, is none.
    """
    beyond, width = s.position - s.farthest, p.distance
    if s.heading == 0.0 and s.mode != LEADING:
        width = p.play if moved != 0.0 or s.aim != 0.0 else math.inf
    if beyond * s.heading > 0.0:
        s.farthest = s.position
    elif abs(beyond) > width:
        s.is_fresh *= int(s.heading == 0.0)
        s.heading, s.farthest, s.top = math.copysign(1.0, beyond), s.position, 0.0
        if s.mode != LEADING:
            _begin_way(s)
    s.top = max(s.top, s.speed * s.heading)


@njit(cache=True)
def _begin_way(s: State) -> None:
    s.mode, s.still_position, s.still_time = FREE, s.position, 0.0
    s.begin, s.since = s.position, 0.0


@njit(cache=True)
def _watch_slip(p: Parameters, s: State, aim: float, is_pushed: bool) -> None:
    """End leading where the joint slips, is pushed the other way, or holds its preload."""
    moved = (s.position - s.begin) * math.copysign(1.0, aim)
    if aim == 0.0 or moved > s.yields or moved < -p.play:
        if aim != 0.0 and moved > 0.0:
            s.rest_position = s.begin
            # The law moves a joint at about `SLOW`; the push of a person grows more slowly.
            if not is_pushed:
                early = s.since < LEAD_TIME + 0.5 * p.slip / SLOW
                s.trust *= EARLY * abs(s.z) if early else LATER
        _begin_way(s)
    elif abs(s.z - aim) > 0.02:
        s.still_time = 0.0


@njit(cache=True)
def _wish(p: Parameters, s: State, aim: float, free: float) -> tuple[float, float]:
    """Return where z should be, and how fast it may go there, 1/s; `free` is by displacement."""
    if s.mode != FREE:
        return aim, 1.0 / LEAD_TIME
    weight = (max(0.0, s.speed * s.heading) + SLOW) / (TURN_SHARE * s.top + 1e-9)
    if weight < 1.0:
        s.is_fresh = 0
        wish = weight * s.heading + (1.0 - weight) * aim
        if aim * s.heading <= 0.0 and (wish - free) * s.heading <= 0.0:
            return wish, 1e6
    elif aim * s.heading < 0.0 and s.z * s.heading < 0.0:
        # Somebody pushes against the preload: no gear yields that way.
        return 0.0, 1.0 / LEAD_TIME
    elif aim == 0.0 and s.heading != 0.0 and s.is_fresh:
        return s.heading, 1e6
    return free, 0.0


@njit(cache=True)
def settle(s: State, position: float) -> None:
    """Reset to a joint at rest at this position, with the operator relaxed."""
    s.position = s.driven = s.still_position = s.rest_position = s.farthest = s.begin = position
    s.count_speed = s.counted = s.counting = s.speed = s.z = s.element = s.still_time = 0.0
    s.since = s.doubt = s.heading = s.top = s.saved = s.aim = 0.0
    s.mode, s.is_fresh = FREE, 1


@njit(cache=True)
def observe(p: Parameters, s: State, time: float, position: float, velocity: float, known: bool
            ) -> bool:
    """Process a sample and return whether a current can be computed.

    A reported velocity, if it is `known`, counts for the printed laws only. A position that the
    joint cannot have reached is dropped; the law starts again where they last.
    """
    known = known and p.law < CONTINUOUS
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
        # Over whole encoder counts; between two of them a speed is at most what shows none.
        s.counted, s.counting = s.counted + travel, s.counting + step
        most = (abs(s.counted) + p.resolution) / s.counting
        s.count_speed = min(most, max(-most, s.count_speed))
        if s.counted != 0.0 and s.counting > SPEED_TIME:
            s.count_speed, s.counted, s.counting = s.counted / s.counting, 0.0, 0.0
        s.speed += (s.count_speed - s.speed) * (1.0 - math.exp(-step / SPEED_TIME))
        if p.law < CONTINUOUS:
            s.speed = travel / step
    if known:
        s.speed = velocity
    return True


@njit(cache=True)
def friction_level(p: Parameters, s: State, positive: bool, more: float) -> float:
    """Return F in A: friction in one direction of sliding, from rest to the speed of now.

    `more` is what effects add to sliding friction here, A.
    """
    plateau, mean = (p.upper, p.break_positive) if positive else (-p.lower, p.break_negative)
    if s.mode != FREE:
        return mean
    speed = abs(s.speed)
    settled = math.tanh(0.5 * p.steepness * speed)
    # Refined effects may only sharpen the transition of Eq. 6: while it rises, their sum counts.
    sliding = max(0.0, min(plateau + more, max(plateau, plateau * settled + more)))
    near, left = min(sliding, mean), abs(s.position - s.rest_position) / (STARTS * p.distance)
    near += min(1.0, max(0.0, 2.0 - left)) * (mean - near)
    # Beyond the identified speeds friction may rise less.
    return near + (sliding + p.viscous * min(speed, p.identified) - near) * settled


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

    A direction d that is not -1 or +1 counts as 0, an end that is not said is NaN. `forward` and
    `backward` are what friction effects add in each direction of sliding, `carried` is the current
    of the other effects, A; of all effects for the laws that are not continuous.
    """
    if not (direction == 1.0 or direction == -1.0) or p.law == KINETIC:
        direction = 0.0
    direction = within_movement(p, s, direction, end)
    if s.doubt > 0.0:
        if s.doubt > BAD_TIME:
            s.friction = s.current = 0.0
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
