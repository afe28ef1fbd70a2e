# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The continuous law's operator: displacement moves help, and sliding pays for what else does.

z in -1..1 is the share of help and its direction.

1. *Displacement* moves z as it moves an elastic-plastic element of distance R.
2. *The tank* holds a distance. Whatever else moves z by D takes R·D from it. Sliding fills it with
   a small share of the way, and rest does; it holds one reversal, 2 R.
3. *One wish*: the heading in motion, the announced direction as the joint slows down and at rest.
4. *Trust*: a joint that slips under its preload keeps a part of its help.

The proof that this is passive is in docs/law_proof.md.
"""

from __future__ import annotations

import math

from numba import njit

from friction_comp.compensation.law_fields import (
    FREE,
    HELD,
    LEADING,
    Parameters,
    RESTED,
    SLOWED,
    State,
    TURNED,
    WENT_ON,
)

FILL = 0.025
"""Share of the slid way that goes into the tank: what the share of help leaves to the gear."""
STILL = 0.05
"""Share of R, beyond encoder counts, that is no motion: of a joint that rests, or that nobody
pushes; and the play of the operator, so that no vibration of a held joint moves z."""
REST_TIME = 0.15
"""s for which a joint must be still to rest. Twice that fills the tank; so long must another
announcement last at a joint that has its preload."""
LEAD_TIME, LEAD_SPEED = 0.1, 0.01
"""s over which the preload rises, and rad/s below which it does: a soft gear would overshoot."""
TURN_SHARE = 0.15
"""Share of a way's top speed below which the wish turns from heading to announced direction."""
EARLY, LATER = 0.7, 0.94
"""Factors on trust: of a slip as early as the law alone would cause it, and of any other."""
MOVED = math.radians(1.0)
"""rad; nobody is pushed farther by accident: a joint that goes on is moved by a person."""


@njit(cache=True)
def operate(p: Parameters, s: State, aim: float, is_pushed: bool) -> None:
    """Move z by the displacement of this sample and towards its wish, as far as the tank pays.

    Parameters
    ----------
    p, s : records of PARAMETERS and STATE
    aim : float
        The announced direction times the share of help at rest.
    is_pushed : bool
        Whether a sensor feels that a person pushes that way.
    """
    play = STILL * p.distance + p.resolution
    driven = min(s.position + play, max(s.position - play, s.play))
    moved, s.play = driven - s.play, driven
    # A joint that has a preload is told otherwise when that has lasted.
    s.lasted += s.step
    if s.mode == FREE or s.aim == 0.0 or aim == s.aim or s.lasted > 2.0 * REST_TIME:
        s.aim, s.lasted = aim, 0.0
    aim = s.aim
    _note_rest(p, s, aim, is_pushed)
    free = min(1.0, max(-1.0, s.z + moved / p.distance))
    _note_way(p, s)
    if s.mode == LEADING:
        _watch_slip(p, s, aim, is_pushed)
    elif s.mode == FREE and abs(s.position - s.rest_position) > MOVED and s.trusted < 2.0:
        s.trust, s.trusted = min(1.0, max(s.trust, s.trusted) + 1.0 - LATER), 2.0
    wish, rate = _wish(s, p.distance, aim, free)
    begin = s.z if s.mode == LEADING else free
    z = begin + min(rate * s.step, max(-rate * s.step, wish - begin))
    # What displacement alone would give, and what the slid way adds, less what help gave.
    element = min(1.0, max(-1.0, s.element + moved / p.distance))
    slid = abs(moved - p.distance * (element - s.element))
    left = (s.saved + (1.0 + FILL) * slid - s.z * moved
            + _debt(p.distance, s.z, s.element) - _debt(p.distance, free, element))
    price = p.distance + play
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
def _note_rest(p: Parameters, s: State, aim: float, is_pushed: bool) -> None:
    """Note whether the joint rests, and begin what a rest begins."""
    s.still_time, s.since = s.still_time + s.step, s.since + s.step
    if abs(s.position - s.still_position) > STILL * p.distance + 1.5 * p.resolution:
        s.still_position, s.still_time = s.position, 0.0
    if s.still_time >= REST_TIME or s.mode == LEADING:
        s.saved += p.distance * s.step / REST_TIME
    if s.still_time < REST_TIME:
        s.mode = FREE if s.mode == HELD else s.mode
        return
    if s.mode == FREE:
        moved = (s.position - s.rest_position) * aim
        if p.slip < moved < MOVED and not is_pushed:
            s.trust *= LATER
        s.trusted, s.farthest = s.trust, s.position
        # Within the slip distance a joint that creeps has not left its position of rest.
        left = abs(s.position - s.rest_position) > p.slip
        if left:
            s.rest_position = s.position
        if left or s.friction == 0.0:
            # Help goes on from what it was in motion, which is a smaller part of breakaway
            # friction. A gear that sprang back got none for that.
            at_rest = s.trust * p.share * (p.break_positive if s.z > 0.0 else p.break_negative)
            s.z = math.copysign(min(abs(s.z), abs(s.friction) / (at_rest + 1e-9)), s.z)
    # Where displacement has led z beyond its aim, help only decreases, which moves no joint.
    if s.mode != LEADING and (aim - s.z) * aim > 0.02 * abs(aim):
        s.mode, s.begin, s.since, s.still_time = LEADING, s.position, 0.0, 0.0
        # A joint yields twice as far from one preload to the other as from none.
        s.yields = p.slip * max(1.0, abs(aim - s.z))
    elif (s.mode == HELD and s.way == TURNED and aim == 0.0 and abs(s.z) < 0.02
          and abs(s.speed) * REST_TIME > STILL * p.distance + 1.5 * p.resolution):
        # Help has decayed, and the gear still springs back: the rest begins when that is over.
        s.mode, s.still_position, s.still_time = FREE, s.position, 0.0
        return
    else:
        s.mode, s.begin = HELD, s.position
        if aim == 0.0:
            s.rest_position = s.position
    s.way = RESTED if abs(s.z) < 0.02 else TURNED
    # While help decays at rest, a gear springs back.
    s.heading = 0.0 if s.way == RESTED or aim != 0.0 else math.copysign(1.0, s.z)
    s.top = 0.0
    # No gear moves against its preload.
    if s.way == RESTED or (s.position - s.farthest) * s.z > 0.0:
        s.farthest = s.position


@njit(cache=True)
def _note_way(p: Parameters, s: State) -> None:
    """Note how far this way has gone, and where another one begins: R behind its farthest point.

    Half of that where help was given back before; a joint that rested, when it moves at all.
    """
    beyond = s.position - s.farthest
    width = (0.5 if s.way == SLOWED else 1.0) * p.distance
    if s.heading == 0.0 and s.mode != LEADING:
        width = STILL * p.distance + 1.5 * p.resolution
    if beyond * s.heading > 0.0:
        s.farthest = s.position
    elif abs(beyond) > width:
        s.way = s.way if s.heading == 0.0 else TURNED
        s.heading, s.farthest, s.top = math.copysign(1.0, beyond), s.position, 0.0
        if s.mode != LEADING:
            s.mode, s.still_position, s.still_time = FREE, s.position, 0.0
            s.begin, s.since = s.position, 0.0
    s.top = max(s.top, s.speed * s.heading)


@njit(cache=True)
def _watch_slip(p: Parameters, s: State, aim: float, is_pushed: bool) -> None:
    """End leading where the joint slips, is pushed the other way, or holds its preload."""
    moved = (s.position - s.begin) * math.copysign(1.0, aim)
    if aim == 0.0 or abs(moved) > s.yields or -moved > STILL * p.distance + 1.5 * p.resolution:
        if aim != 0.0 and moved > s.yields:
            s.rest_position = s.begin
            # The law moves the joint at about the speed above which it waits. The push of a
            # person grows more slowly.
            if not is_pushed:
                early = s.since < LEAD_TIME + 0.5 * p.slip / LEAD_SPEED
                s.trust *= EARLY * abs(s.z) if early else LATER
        s.mode, s.still_time, s.still_position = FREE, 0.0, s.position
        s.begin, s.since = s.position, 0.0
    elif abs(s.z - aim) > 0.02:
        s.still_time = 0.0


@njit(cache=True)
def _wish(s: State, distance: float, aim: float, free: float) -> tuple[float, float]:
    """Return where z should be, and how fast it may go there, 1/s; `free` is by displacement."""
    if s.mode != FREE:
        return aim, 1.0 / LEAD_TIME if abs(s.speed) < LEAD_SPEED else 0.0
    if s.heading == 0.0:
        return free, 0.0
    if aim * s.heading < 0.0 and s.z * s.heading < 0.0 and s.way < SLOWED:
        # Somebody pushes against the preload: no gear yields that way.
        return 0.0, 1.0 / LEAD_TIME
    weight = (max(0.0, s.speed * s.heading) + LEAD_SPEED) / (TURN_SHARE * s.top + 1e-9)
    if weight < 1.0 and s.way != WENT_ON:
        s.way = SLOWED
        wish = weight * s.heading + (1.0 - weight) * aim
        if aim * s.heading <= 0.0 and (wish - free) * s.heading <= 0.0:
            return wish, 1e6
    elif weight > 1.5 and s.way == SLOWED:
        s.way = WENT_ON     # Once a way: otherwise a heavy joint would stop and go.
    elif aim == 0.0 and (s.way == RESTED or (
            s.way == TURNED and (s.position - s.begin) * s.heading > distance)):
        return s.heading, 1e6
    return free, 0.0
