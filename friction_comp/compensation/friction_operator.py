# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The continuous law: friction knows distances, not times, and so does what is fed forward.

``i = A(|ω|)·z``, where z in -1..1 is driven by displacement: an elastic-plastic element of distance
R behind a small backlash. Where A does not exceed the gear's friction and R is at least its
presliding distance, the law supplies over any path at most the energy that the gear dissipates,
plus a bounded amount (proof in docs/compensation_law.md). What A leaves to the gear on a long way
pays for z to go ahead of displacement at the next turn. At rest z is led to the announced direction
(the preload), and one observation bounds the model's error: whether the joint holds it. What it has
shown to hold is kept in one number, the trust in its drive. A slip lowers it, a movement by a
person restores some of it.
"""

from __future__ import annotations

import math

from numba import njit

from friction_comp.compensation.law_fields import DESIRED, FREE, HELD, LEADING, Parameters, State
from friction_comp.compensation.turns import slow_down, turn_round

TAKEN_TIME = 0.1
"""s in which trust falls from one to zero above the identified speeds."""
PATIENCE = 0.3
"""s that a changed announcement must last at a joint that has not moved."""
PACE_TIME, CHANGE_SHARE, CHANGE_SPEED = 0.05, 0.02, 0.003
"""s over which the speed is averaged; relative change and absolute change in rad/s at which the
largest share is withheld."""
END_MARGIN, END_TIME = 0.03, 0.3
"""rad, 1.7 deg, beyond the announced end of a movement, where nothing pushes outwards any more; and
s before that place from which on help is given back. A person's arm and a trajectory controller
come to rest within a degree or two of the goal; a smaller margin makes the arm heavier just there.
Who brakes evenly for twice the time, or longer, keeps all help. A shorter one gives a joint that
runs by itself no room to stop: with 0.25 s, 2 of 768 go farther than 5 deg.
"""


@njit(cache=True)
def approach(value: float, target: float, most: float) -> float:
    """Return `value` moved towards `target` by at most `most`."""
    return value + min(most, max(-most, target - value))


@njit(cache=True)
def follow(p: Parameters, s: State) -> None:
    """Drive the operator by the displacement of this sample, and detect rest.

    A long way saves for its turn; a vibration is too short to.
    """
    driven = min(s.position + p.backlash, max(s.position - p.backlash, s.backlash_position))
    displacement = driven - s.backlash_position
    s.backlash_position = driven
    s.way += abs(displacement)
    if s.way > p.saving_distance:
        s.saved = min(1.0, s.saved + abs(displacement) / p.saving_distance)
    if s.mode != LEADING:
        before = s.z
        s.z = min(1.0, max(-1.0, before + displacement / p.distance))
        if s.slowing == 1 and s.heading * (s.z - before) > 0.0:
            s.z = before
    if abs(s.position - s.still_position) > p.still_distance:
        s.still_position = s.position
        s.still_time = 0.0
    else:
        s.still_time += s.step


@njit(cache=True)
def _slipped(p: Parameters, s: State, share: float) -> None:
    """Lower the trust in a drive that slipped under its preload to a share of what it was."""
    s.slips += 1.0
    s.trust = max(p.least_trust, share * s.trust)


@njit(cache=True)
def _start_leading(p: Parameters, s: State, aim: float) -> None:
    """Begin to lead z from where it is."""
    s.mode, s.ramp, s.lead_position, s.still_time = LEADING, s.z, s.position, 0.0
    # A joint yields twice as far from one preload to the other as from none.
    s.yields = p.slip * max(1.0, abs(aim - s.z))


@njit(cache=True)
def lead(p: Parameters, s: State, aim: float) -> None:
    """Lead the operator to the announced direction, and check that the joint holds.

    A joint that moves in that direction by more than it yields has slipped: while z is led, which
    ends there, and once more from one rest to the next, unless it moved farther than anybody does
    by accident.
    """
    if s.mode == LEADING:
        s.since += s.step
        moved = s.position - s.lead_position
        if abs(moved) > s.yields:
            if moved * aim > 0.0:
                # The law moves the joint at about the speed above which z waits. The push of a
                # person grows more slowly.
                early = s.since < p.lead_time + 0.5 * p.slip / p.lead_speed
                _slipped(p, s, p.early * abs(s.ramp) if early else p.lowered)
                s.rest_position = s.lead_position
            s.mode, s.still_time, s.still_position = FREE, 0.0, s.position
            return
        # A gear that yields fast under the preload would overshoot.
        if abs(s.speed) < p.lead_speed:
            s.ramp = approach(s.ramp, aim, s.step / p.lead_time)
        s.z, s.swing = s.ramp, 0.0
        s.backlash_position = s.rest_position = s.position
        if s.ramp != aim:
            s.still_time = 0.0
        elif s.still_time >= p.rest_time:
            s.mode = HELD
    elif s.still_time >= p.rest_time:
        if s.mode == FREE:
            moved = s.position - s.rest_position
            if s.z * aim > 0.0 and p.slip < moved * aim < p.moved_distance:
                _slipped(p, s, p.lowered)
            # Within the slip distance a joint that creeps has not left its position of rest.
            if abs(moved) > p.slip:
                s.rest_position = s.position
        s.since = s.way = s.top = 0.0
        s.slowed, s.displaced, s.trusted = 2, 0, s.trust
        if aim == 0.0:
            # Displacement keeps driving the operator, since a push may come at any time.
            if s.z != 0.0:
                s.swing = 0.0
            s.z = approach(s.z, 0.0, s.step / p.lead_time)
            s.mode, s.ramp, s.rest_position = HELD, 0.0, s.position
        elif abs(aim - s.z) > 0.02 and (s.mode == FREE or aim != s.ramp):
            _start_leading(p, s, aim)
        else:
            s.mode, s.ramp = HELD, aim
    else:
        s.mode = FREE
        s.since += s.step
        # A slip that was answered with less ends within a degree: who goes on is moved by a person.
        if s.displaced == 0 and s.way > p.moved_distance:
            s.displaced = 1
            s.trust = min(1.0, max(s.trust, s.trusted) + 1.0 - p.lowered)


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
    near += start * max(0.0, p.gain * mean - near)
    # Speed within presliding is not sliding: A would follow a vibration, some samples late. (While
    # z is led A does follow speed: it falls where the joint slips, before the slip is detected.)
    rises = settled * min(1.0, speed / p.slow) * (1.0 - within)
    level = near + (p.share * (sliding + p.viscous * speed) - near) * rises
    return level, start


@njit(cache=True)
def faded(p: Parameters, s: State, speed: float) -> float:
    """Return the share of current left above the identified speeds, and lower the trust there.

    A joint that fast is driven by more current than friction dissipates, or by a person in a hurry:
    its drive is trusted less, until later movements have restored it.
    """
    over = (speed - p.fade_from) / (p.fade_to - p.fade_from)
    if over > 0.0:
        s.overspeed += s.step
        s.trust = max(p.least_trust, s.trust - s.step / TAKEN_TIME)
    return 1.0 - min(1.0, max(0.0, over))


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
def announced(p: Parameters, s: State, direction: float) -> float:
    """Return the direction to act on.

    Each announcement stores a bounded energy. It is spent by moving: the next one counts at once.
    At a joint that has not moved since, it counts when it has lasted.
    """
    if s.aim * (s.position - s.aim_position) > p.moved_distance:
        s.aim_position = -s.aim * math.inf
    if direction != s.direction:
        s.direction, s.lasted = direction, 0.0
    s.lasted += s.step
    moved = abs(s.position - s.aim_position) > p.moved_distance
    if direction != s.aim and (moved or s.aim == 0.0 or s.lasted > PATIENCE):
        s.aim, s.aim_position = direction, s.position
    return s.aim


@njit(cache=True)
def bound_of(p: Parameters, forward: float, backward: float, carried: float) -> float:
    """Return the limit of the current in A: the drive's, and near friction by the model.

    What effects carry is beside friction, so that the bound takes nothing from it.
    """
    sliding = max(p.upper, -p.lower) + max(0.0, p.viscous) * p.fade_from
    friction = max(sliding + max(0.0, forward, -backward), p.break_positive, p.break_negative)
    return min(p.limit, p.bound * friction + abs(carried))


@njit(cache=True)
def in_doubt(p: Parameters, s: State) -> bool:
    """Return whether samples have been implausible for so long that the current is zero."""
    return s.doubt > p.bad_time


@njit(cache=True)
def soft_end(p: Parameters, s: State, current: float) -> float:
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


@njit(cache=True)
def continuous_current(p: Parameters, s: State, direction: float, forward: float, backward: float,
                       carried: float) -> float:
    """Return the current of the continuous law in A.

    Parameters
    ----------
    p, s : records of PARAMETERS and STATE
    direction : float
        -1, 0 or 1.
    forward, backward : float
        Signed contribution of friction effects in each direction of sliding, A.
    carried : float
        Current of the other effects, A: added outside the operator.
    """
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
        aim = heard if p.gain > 0.0 else 0.0
        # A movement in its direction spends an announcement, so a joint cannot swing on it.
        turn = aim if math.isfinite(s.aim_position) else 0.0
        follow(p, s)
        lead(p, s, aim)
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
    if in_doubt(p, s):
        s.friction = wanted = 0.0
    elif s.doubt > 0.0:
        wanted = s.current
    else:
        s.friction = soft_end(p, s, friction)
        wanted = s.friction + carried
    wanted = min(limit, max(-limit, wanted))
    current = approach(s.current, wanted, p.slope * s.step)
    friction = current - carried
    s.breakaway = start * friction
    s.kinetic = friction - s.breakaway
    return current
