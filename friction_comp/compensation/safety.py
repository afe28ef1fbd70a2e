# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What no law can skip: implausible samples, speed, position limits, and the end of a movement."""

from __future__ import annotations

import math

from numba import njit

from friction_comp.compensation.law_parameters import CONTINUOUS, Parameters, State

FASTEST = 3.0
"""Multiple of the fastest identified speed above which a position is implausible."""
BAD_TIME = 0.02
"""s for which the current is held in doubt; after that it is zero, and the law starts again."""
FADE_FROM, FADE_TO = 1.15, 1.5
"""Multiples of the fastest identified speed between which help fades: a drive that has two thirds
of its model's friction stays below 1.25 of it."""
HURRIED_WAY, HURRIED = math.radians(60.0), 0.7
"""rad: the longest way of a person in a hurry. A drive that lost friction goes on, and is trusted
with that factor."""
SOFT_END = math.radians(5.0)
"""rad before a position limit, over which what pushes outwards fades."""
END_MARGIN, END_BRAKE = 0.03, 1.25
"""rad beyond the announced end of a movement, where nothing pushes outwards any more: a hand and a
controller come to rest within 1.7 deg. And rad/s², with which a joint without help would stop
there; who brakes with less keeps all help."""
TURN_TIME = 0.02
"""s in which the current may change from full friction in one direction to the other."""


@njit(cache=True)
def is_plausible(p: Parameters, s: State, travel: float, step: float) -> bool:
    """Return whether a joint can have gone so far, rad, and how long that has been in doubt."""
    if abs(travel) <= FASTEST * p.identified * (step + s.doubt) + 3.0 * p.resolution:
        s.doubt = 0.0
        return True
    s.dropped += 1.0
    s.doubt += step
    return False


@njit(cache=True)
def within_movement(p: Parameters, s: State, direction: float, end: float) -> float:
    """Return the direction, 0 for a joint that has been beyond the end of its movement.

    The end in rad, NaN if it is not said, holds until another movement is announced, or the joint
    rests while none is: an announcement ceases before its movement does. Other laws know no rest.
    """
    if direction != 0.0 and not (direction == s.outward and end == s.end):
        s.outward, s.end, s.beyond = direction, end, 0
    elif direction == 0.0 and (p.law != CONTINUOUS or s.heading == 0.0):
        s.outward, s.beyond = 0.0, 0
    if s.outward * (s.position - s.end) > END_MARGIN:
        s.beyond = 1
    return 0.0 if s.beyond == 1 else direction


@njit(cache=True)
def safe(p: Parameters, s: State, current: float) -> float:
    """Return what of a law's current against friction may be sent here, A."""
    speed = abs(s.speed)
    over = speed / p.identified
    if over > 1.0 and abs(s.position - s.begin) > HURRIED_WAY:
        s.trust = min(s.trust, HURRIED)
    current *= 1.0 - min(1.0, max(0.0, (over - FADE_FROM) / (FADE_TO - FADE_FROM)))
    if current * s.outward > 0.0 and not math.isnan(s.end):
        room = END_MARGIN - s.outward * (s.position - s.end)
        current *= min(1.0, max(0.0, room / max(END_MARGIN, 0.5 * speed * speed / END_BRAKE)))
    room = p.highest - s.position if current > 0.0 else s.position - p.lowest
    return current * min(1.0, max(0.0, room / SOFT_END))


@njit(cache=True)
def limited(p: Parameters, s: State, wanted: float, friction: float) -> float:
    """Return the current, A: within the drive's limit, and its slope within that of friction."""
    wanted = min(p.limit, max(-p.limit, wanted))
    s.blends = max(0.0, s.blends - s.step)
    if p.law < CONTINUOUS and s.blends == 0.0:
        return wanted
    most = 2.0 * friction * s.step / TURN_TIME
    return min(p.limit, max(-p.limit, s.current + min(most, max(-most, wanted - s.current))))
