# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Where a way ends, and what is given back before: a joint turns, rests, or springs back."""

from __future__ import annotations

import math

from numba import njit

from friction_comp.compensation.law_fields import FREE, LEADING, Parameters, State

PUSHED = 2.0
"""Factor by which v²/x must have risen from its least where somebody pushes the joint."""
AGAIN = 1.5
"""Multiple of the speed below which help is given back, above which a joint has not turned."""


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
        s.slowed = 0
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
            left = 2.0 * left - 1.0
        spend(s, s.heading * min(left, s.heading * s.z))
