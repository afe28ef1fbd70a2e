# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The continuous law: friction fed forward through an operator of the kind that friction is.

``i = A(|ω|)·z`` with z in -1..1 driven by displacement: an elastic-plastic element of distance R
behind a little backlash. Where A is no larger than the gear's friction and R no shorter than its
presliding, the law gives over any path at most what the gear takes, and a bounded rest
(docs/compensation_law.md has the proof). At rest z is led to the announced direction, and the law
watches what the joint bears of that: a drive that slips before all of it is there has lost
friction, and gets that much less until later movements have shown otherwise.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from friction_comp.compensation.guards import in_doubt, soft_end
from friction_comp.compensation.records import FREE, HELD, LEADING
from friction_comp.compiling import njit

LEAST_BORNE = 0.5
"""The preload is never lowered below this share."""
EARLIEST, EARLY_TIME = 0.75, 0.16
"""A slip is early beyond this share of the preload and within so many s of leading. Under less of
it a person moves the joint; later it had waited for a gear that swings."""
CREEP_TIME = 1.0
"""s that a joint may creep under its preload; a push takes tenths of a second."""
TAKEN_TIME, GIVEN_BACK = 0.5, 0.04
"""s within which the whole share goes beyond the identified speeds; what the rest after a movement
gives back of what the drive was seen not to bear."""
MOST_CHANGES, CHANGE_TIME = 2.5, 1.0
"""Changes of the announced direction, of which one is forgotten in so many s, beyond which none is
believed."""
PACE_TIME, CHANGE_SHARE, CHANGE_SPEED = 0.05, 0.02, 0.003
"""s over which the speed is averaged, and by which share and how many rad/s it has changed when
all is withheld that may be."""


@njit(cache=True)
def approach(value: float, aim: float, most: float) -> float:
    """Return `value` moved towards `aim` by at most `most`."""
    return value + min(most, max(-most, aim - value))


@njit(cache=True)
def follow(p: Any, s: Any) -> None:
    """Drive the operator by the displacement of this sample, and notice rest."""
    place = min(s.position + p.backlash, max(s.position - p.backlash, s.backlash_place))
    way = place - s.backlash_place
    s.backlash_place = place
    if s.mode != LEADING:
        s.z = min(1.0, max(-1.0, s.z + way / p.distance))
    if p.turning > 0.0 and way != 0.0:
        side = math.copysign(1.0, way)
        s.turned = side - (side - s.turned) * math.exp(-abs(way) / p.turning_distance)
    if abs(s.position - s.still_place) > p.still_way:
        s.still_place = s.position
        s.still_time = 0.0
    else:
        s.still_time += s.step
    # Whoever has moved it so far did mean it.
    if abs(s.position - s.home) > p.moved_way:
        s.borne = 1.0
        s.caution = 0


@njit(cache=True)
def _bears_less(p: Any, s: Any, left: float) -> None:
    s.borne = max(LEAST_BORNE / s.bears, left * s.borne)


@njit(cache=True)
def _slipped(p: Any, s: Any, aim: float, home: float, early: bool) -> None:
    """Lower the level of a joint that slipped under its preload."""
    s.slips += 1.0
    s.still_time, s.still_place = 0.0, s.position
    s.creeping = -math.inf
    if (s.position - home) * aim > 0.0:
        _bears_less(p, s, p.early * abs(s.ramp) if early else p.lowered)
        s.caution = 2 if early else 1
        s.home = home
    s.mode = FREE


@njit(cache=True)
def lead(p: Any, s: Any, aim: float) -> None:
    """Lead the operator of a joint at rest to the announced direction, and watch that it holds.

    Before anybody pushes, the joint shows whether it bears the preload of this rest: if it moves
    farther than its presliding, it gets less, and never more than what takes sliding, until it
    rests. An early slip that ends by itself tells that the drive has lost friction. Once it holds,
    displacement decides again.
    """
    if s.still_time >= p.rest_time:
        s.turned = approach(s.turned, 0.0, s.step / p.lead_time)
    if s.mode == LEADING:
        s.creeping += s.step
        if abs(s.position - s.mark) > p.slip:
            _slipped(p, s, aim, s.mark, EARLIEST < abs(s.ramp) < 1.0
                     and s.creeping < EARLY_TIME and s.borne == 1.0)
            return
        # A gear that gives fast under the preload would swing beyond it.
        if abs(s.speed) < p.lead_speed:
            s.ramp = approach(s.ramp, aim, s.step / p.lead_time)
        s.z = s.ramp
        s.backlash_place = s.home = s.position
        if s.ramp != aim:
            s.still_time = 0.0
        elif s.still_time >= p.bear_time:
            s.mode = HELD
    elif s.still_time >= p.rest_time:
        if s.mode == FREE:
            gone = s.position - s.home
            if s.caution == 2:
                # What stops by itself was moved by the law: so much less does the drive bear.
                s.bears, s.borne = max(LEAST_BORNE, s.bears * s.borne), 1.0
            elif abs(gone) > p.moved_way:
                s.bears = min(1.0, s.bears + GIVEN_BACK)
            if abs(gone) > p.slip:
                if s.starting == 1 and s.caution == 0 and gone * aim > 0.0 and (
                        abs(gone) < p.moved_way):
                    _bears_less(p, s, p.lowered)
                s.home = s.position
            # What creeps along from rest to rest has not left its place.
            s.mark = s.home
        slipped = s.caution > 0
        s.starting, s.caution, s.creeping = 1, 0, 0.0
        if s.direction == 0.0:
            # Displacement goes on deciding, for a push may come at any time.
            s.z = approach(s.z * (1.0 - s.opposed), 0.0, s.step / p.lead_time)
            s.opposed, s.mode, s.ramp, s.home = 0.0, HELD, 0.0, s.position
        elif slipped or (abs(aim - s.z) > 0.02 and (s.mode == FREE or aim != s.ramp)):
            # The level that comes back after a slip is watched as a preload is.
            s.z *= 1.0 - s.opposed
            s.opposed = 0.0
            s.mode, s.ramp, s.mark, s.still_time = LEADING, s.z, s.position, 0.0
        else:
            s.mode, s.ramp = HELD, aim
            if abs(s.position - s.mark) > p.slip:
                _slipped(p, s, aim, s.mark, False)
    else:
        s.mode = FREE
        gone = s.position - s.home
        if abs(gone) < p.start_way:
            s.creeping += s.step
            if s.creeping > CREEP_TIME and s.z * aim > 0.0 and gone * aim > 0.0:
                _slipped(p, s, aim, s.home, False)


@njit(cache=True)
def interpolated(at: float, knots: np.ndarray, values: np.ndarray) -> float:
    """Return the value at a place, linear between the knots, level beyond their ends."""
    if at <= knots[0]:
        return values[0]
    for k in range(1, len(knots)):
        if at < knots[k]:
            share = (at - knots[k - 1]) / (knots[k] - knots[k - 1])
            return values[k - 1] + share * (values[k] - values[k - 1])
    return values[-1]


@njit(cache=True)
def amplitude(p: Any, s: Any, positive: bool, speed: float, more: float) -> tuple[float, float]:
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
        plateau, mean, std = p.upper, p.break_positive, p.std_positive
        excess = interpolated(speed, p.knots, p.excess_positive)
    else:
        plateau, mean, std = -p.lower, p.break_negative, p.std_negative
        excess = interpolated(speed, p.knots, p.excess_negative)
    settled = math.tanh(0.5 * p.steepness * speed)
    # Refined effects may only sharpen the transition of Eq. 6: while it rises, their sum counts.
    sliding = max(0.0, min(plateau + more, max(plateau, plateau * settled + more)) - excess)
    # What takes longer to turn round has an element of its own, which is never led. Whether a ramp
    # met it before the joint broke free shows beside sliding friction without it.
    mean = min(mean, max(plateau, mean - p.turning))
    near = p.slow_share * max(0.0, min(sliding, mean - std))
    # Until it has left its place of rest the joint holds with breakaway friction.
    start = within = 0.0
    if s.starting == 1:
        gone = abs(s.position - s.home)
        start = max(0.0, min(1.0, 2.0 - gone / p.start_way))
        if s.mode != LEADING:
            within = max(0.0, min(1.0, 2.0 - gone / p.distance))
        near += start * max(0.0, p.gain * mean - near)
    if s.caution > 0:
        near = min(near, p.slow_share * sliding)
    lost = s.caution == 2 or s.bears < 1.0
    if not lost:
        # Displacement never raises it above what the joint bore at this rest.
        near *= s.borne
    # Speed within presliding is no sliding: A would follow a vibration, some samples late. (While z
    # is led A follows all the same: it falls where the joint slips, before that is seen.) Nor does
    # speed raise it above what the joint bore, until it has left its place of rest.
    if s.borne < 1.0:
        within = start
    rises = settled * min(1.0, speed / p.slow) * (1.0 - within)
    level = near + (p.share * (sliding + p.viscous * speed) - near) * rises
    return (s.borne * level if lost else level), start


@njit(cache=True)
def faded(p: Any, s: Any, speed: float) -> float:
    """Return the share that is left beyond the identified speeds, and keep the account of it.

    A joint that gets there is driven by more than friction takes, or by a person in a hurry: it is
    taken to bear less until rests that are borne have shown otherwise.
    """
    over = (speed - p.fade_from) / (p.fade_to - p.fade_from)
    if over > 0.0:
        s.overspeed += s.step
        s.bears = max(p.least_trust, s.bears - s.step / TAKEN_TIME)
    return 1.0 - min(1.0, max(0.0, over))


@njit(cache=True)
def while_steady(p: Any, s: Any, speed: float) -> float:
    """Return the share that is left to a joint whose speed changes, and keep the account of it.

    Who starts a movement speeds up. After that a joint that becomes faster than it has been since
    then gains energy from somebody: a person, or friction below its mean here, or a model above
    it. The law does not add to that. Nor does it keep going what loses speed: that is to stop.
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
    # Slowly, or a hand that trembles would be answered at its own frequency.
    most = 1.0 - p.least_changing
    s.withheld = approach(s.withheld, most * min(1.0, changed), most * s.step / p.start_time)
    return 1.0 - s.withheld


@njit(cache=True)
def announced(p: Any, s: Any, direction: float) -> float:
    """Return the direction to act on: none while it changes faster than in any exercise.

    What one announcement stores is bounded; announcements are not.
    """
    s.changes = max(0.0, s.changes - s.step)
    if direction != s.direction:
        s.direction = direction
        s.changes = min(s.changes + CHANGE_TIME, (MOST_CHANGES + 1.0) * CHANGE_TIME)
    return 0.0 if s.changes > MOST_CHANGES * CHANGE_TIME else direction


@njit(cache=True)
def unless_opposed(p: Any, s: Any, direction: float) -> float:
    """Return the share that is left to a joint that moves against the announced direction.

    It is to stop and turn round: help that keeps it going is taken back. A joint that springs back
    near its place of rest is on no way anywhere, and is held as before.
    """
    opposes = (s.mode == FREE and s.z * direction < 0.0
               and abs(s.position - s.home) > p.moved_way)
    s.opposed = approach(s.opposed, 1.0 if opposes else 0.0, s.step / p.lead_time)
    return 1.0 - s.opposed


@njit(cache=True)
def rise(p: Any, s: Any, wanted: float, direction: float) -> None:
    """Let friction's current rise gently and fall at once.

    A person who breaks a joint loose has a loaded arm: help that comes with the first milliradian
    would throw it. Less on the way up than on the way back only takes more from a vibration. A push
    that nobody announced is helped at once while presliding, which is known, shows it: on the
    first way from rest, for what comes to and fro is a vibration.
    """
    held = s.friction if s.friction * wanted > 0.0 else 0.0
    time = p.rise_time if wanted * direction > 0.0 else p.alone_time
    if s.starting == 1 and s.creeping < p.start_time and abs(s.position - s.home) < p.distance:
        time = min(time, p.push_time)
    most = max(p.upper, -p.lower) * s.step / time
    s.friction = approach(held, wanted, most) if abs(wanted) > abs(held) else wanted


@njit(cache=True)
def continuous_current(p: Any, s: Any, direction: float, forward: float, backward: float,
                       carried: float) -> float:
    """Return the current of the continuous law in A.

    Parameters
    ----------
    p, s : records of PARAMETERS and STATE
    direction : float
        -1, 0 or 1.
    forward, backward : float
        What friction effects add in each direction of sliding, A, with its sign.
    carried : float
        What other effects ask for, A: added outside the operator.
    """
    if s.step == 0.0:
        return min(p.limit, max(-p.limit, s.current))
    s.bump = 0.0
    direction = announced(p, s, direction)
    if s.doubt == 0.0:
        follow(p, s)
        lead(p, s, direction if p.gain > 0.0 else 0.0)
    speed = abs(s.speed)
    positive = s.z > 0.0
    level, start = amplitude(p, s, positive, speed, forward if positive else -backward)
    share = while_steady(p, s, speed) * faded(p, s, speed) * unless_opposed(p, s, direction)
    friction = s.bears * share * (level * s.z + p.share * p.turning * s.turned)
    if in_doubt(p, s):
        s.friction = wanted = 0.0
    elif s.doubt > 0.0:
        wanted = s.current
    else:
        rise(p, s, soft_end(p, s, friction), direction)
        wanted = s.friction + carried
    wanted = min(p.limit, max(-p.limit, wanted))
    current = approach(s.current, wanted, p.slope * s.step)
    if not math.isfinite(current):
        s.started = 0
        current = 0.0
    friction = current - carried
    s.breakaway = start * friction
    s.kinetic = friction - s.breakaway
    return current
