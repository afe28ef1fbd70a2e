# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The continuous law's operator: friction knows distances, not times, and so does help.

Its state z in -1..1 is the share of help and its direction. It is driven by displacement: an
elastic-plastic element of distance R behind a small backlash. A current ``A·z``, where A does not
exceed the gear's friction and R is at least its presliding distance, supplies over any path at most
the energy that the gear dissipates, plus a bounded amount (proof in docs/compensation_law.md). What
A leaves to the gear on a long way pays for z to go ahead of displacement at the next turn. At rest
z is led to the announced direction (the preload), and one observation bounds the model's error:
whether the joint holds it. What it has shown to hold is kept in one number, the trust in its drive.
A slip lowers it, a movement by a person restores some of it.
"""

from __future__ import annotations

import math

from numba import njit

from friction_comp.compensation.law_fields import FREE, HELD, LEADING, Parameters, State

PATIENCE = 0.3
"""s that a changed announcement must last at a joint that has not moved."""
PUSHED = 2.0
"""Factor by which v²/x must have risen from its least where somebody pushes the joint."""
FASTER = 1.1
"""Multiple of the speed at the last push that a sensor felt: who is faster gains speed alone."""
AGAIN = 1.5
"""Multiple of the speed below which help is given back, above which a joint has not turned."""


@njit(cache=True)
def approach(value: float, target: float, most: float) -> float:
    """Return `value` moved towards `target` by at most `most`."""
    return value + min(most, max(-most, target - value))


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
    s.gives_way = 0.0
    s.mode, s.ramp, s.still_time = LEADING, s.z, 0.0
    s.lead_position = s.position
    # A joint yields twice as far from one preload to the other as from none.
    s.yields = p.slip * max(1.0, abs(aim - s.z))


@njit(cache=True)
def _pushed_against(p: Parameters, s: State, aim: float) -> bool:
    """Return whether somebody moves the joint against its preload: no gear yields that way.

    While z is led a soft gear springs back, but not beyond where it was before.
    """
    if s.mode == HELD:
        if s.ramp * (s.position - s.yielded) > 0.0:
            s.yielded = s.position
        return s.ramp * (s.yielded - s.position) > p.against
    s.yielded = s.position
    return s.mode == LEADING and aim * (s.lead_position - s.position) > p.against


@njit(cache=True)
def _give_way(p: Parameters, s: State, aim: float) -> None:
    """Let the preload go where somebody pushes against it, as slowly as it came, until a rest."""
    if _pushed_against(p, s, aim):
        s.gives_way = aim if s.mode == LEADING else s.ramp
        s.mode, s.still_time, s.still_position = FREE, 0.0, s.position
        s.backlash_position = s.position
    if s.gives_way * s.z > 0.0:
        s.z, s.swing = approach(s.z, 0.0, s.step / p.lead_time), 0.0
    else:
        s.gives_way = 0.0


@njit(cache=True)
def lead(p: Parameters, s: State, aim: float, is_pushed: bool) -> None:
    """Lead the operator to its aim, the preload in A's parts, and check that the joint holds.

    A joint that moves in that direction by more than it yields has slipped: while z is led, which
    ends there, and once more from one rest to the next, unless it moved farther than anybody does
    by accident. Under a push that is felt this tells nothing of the drive, but that it goes faster
    once nobody pushes does.
    """
    _give_way(p, s, aim)
    if s.mode == LEADING:
        s.since += s.step
        moved = s.position - s.lead_position
        if abs(moved) > s.yields:
            if moved * aim > 0.0:
                s.rest_position = s.lead_position
                # The law moves the joint at about the speed above which z waits. The push of a
                # person grows more slowly.
                early = s.since < p.lead_time + 0.5 * p.slip / p.lead_speed
                if not is_pushed:
                    _slipped(p, s, p.early * abs(s.ramp) if early else p.lowered)
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
            slipped = s.z * aim > 0.0 and p.slip < moved * aim < p.moved_distance
            if slipped and not is_pushed:
                _slipped(p, s, p.lowered)
            # Within the slip distance a joint that creeps has not left its position of rest.
            if abs(moved) > p.slip:
                s.rest_position = s.position
        s.since = s.way = s.top = 0.0
        s.slowed, s.displaced, s.trusted, s.pushed_speed = 2, 0, s.trust, math.inf
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
        # A slip ends within a degree once the level is lowered: a joint that goes on is moved by a
        # person.
        if s.displaced == 0 and s.way > p.moved_distance:
            s.displaced = 1
            s.trust = min(1.0, max(s.trust, s.trusted) + 1.0 - p.lowered)
        if is_pushed:
            s.pushed_speed = abs(s.speed)
        elif abs(s.speed) > FASTER * s.pushed_speed:
            _slipped(p, s, p.early)
            s.pushed_speed = math.inf


@njit(cache=True)
def spend(s: State, target: float) -> None:
    """Move z towards a target beyond what displacement does, as far as the way has paid for it."""
    change = min(2.0 * s.saved, max(-2.0 * s.saved, target - s.z))
    s.z += change
    if change != 0.0:
        s.swing = 0.0
    s.saved -= 0.5 * abs(change)


@njit(cache=True)
def pushed(p: Parameters, s: State) -> bool:
    """Return whether somebody pushes the joint, which has broken friction.

    A gear that springs back drives the joint ever less, so that v²/x falls, x since it stood. What
    the law itself changes beyond displacement drives the joint, too: x begins again there.
    """
    if s.speed * s.swing <= 0.0:
        s.swing, s.least = 0.0, math.inf
    s.swing += s.speed * s.step
    if abs(s.swing) <= p.still_distance:
        return False
    gain = s.speed * s.speed / abs(s.swing)
    s.least = min(s.least, gain)
    return gain > PUSHED * s.least and abs(s.speed) > p.lead_speed


@njit(cache=True)
def turn_round(p: Parameters, s: State) -> None:
    """Note where a way ends: where the joint is R behind its farthest point, is pushed, or rests.

    A joint that stops springs back, and may go on: neither is a turn. Half of R is enough where
    presliding is known and help was given back before: less is left to spring back. Where it is
    unknown, and may be longer than R, a turn is where somebody pushes the joint back, or two R
    behind.
    """
    if s.mode == LEADING or s.still_time > 2.0 * p.rest_time:
        s.heading, s.farthest = 0.0, s.position
    beyond = s.position - s.farthest
    enough = p.turn_distance if s.slowed == 1 else max(p.distance, p.turn_distance)
    push = p.turn_distance > p.distance and pushed(p, s) and beyond * s.speed > 0.0
    turned = push or abs(beyond) > enough
    if beyond * s.heading > 0.0:
        s.farthest = s.position
    elif s.heading == 0.0 or turned:
        # A way without help is a movement by a person, as one from rest is.
        if s.way > p.moved_distance:
            s.displaced, s.trusted = 0, s.trust
        s.top = s.way = 0.0
        s.slowed, s.pushed_speed = 0, math.inf
        if turned:
            s.heading, s.farthest = math.copysign(1.0, beyond), s.position


@njit(cache=True)
def slow_down(p: Parameters, s: State, aim: float) -> None:
    """Give help back while the joint slows down below a share of this way's top speed.

    The hand then breaks friction alone at the turn, not what still helps in the old direction, too.
    Where the other direction is announced, z goes there before the joint does. Once a way: a joint
    that speeds up again was not about to turn, and would stop and go on again for ever.
    """
    speed = max(0.0, s.speed * s.heading)
    s.top = max(s.top, speed)
    left = (speed + p.lead_speed) / (p.turn_share * s.top + 1e-9)
    s.slowing = 0
    if s.mode != FREE or s.heading == 0.0:
        return
    if s.slowed == 1 and left > AGAIN:
        s.slowed = 2
    if left < 1.0 and s.slowed < 2:
        s.slowing = 1
        if s.heading * s.z > left:
            s.slowed = 1
        if aim * s.heading < 0.0:
            left = (1.0 + abs(aim)) * left - abs(aim)
        spend(s, s.heading * min(left, s.heading * s.z))
