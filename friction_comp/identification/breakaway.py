# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Breakaway is the largest current that holds: ramps pause on stairs of 1 % of the current.

In presliding, a joint whose current stays constant comes to rest; one that slides goes on, or
becomes faster: for friction that falls or rises with speed, for every kind of presliding, and for a
rotor that slides through backlash until teeth stop it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.measured import Breakaway
from friction_comp.statistics import noise_level

STAIR, SLIDING_STAIR = 0.01, 0.03
"""Height of a stair as a share of its current, and of one above a current that did not hold."""

FIRST_STAIR, NEAR_STAIR = 0.9, 0.95
"""The first stair, as a share of the only current that held so far, and of the least of several: it
is near breakaway, since what a joint creeps under stairs is no part of its presliding distance."""

STAIR_TIME = 0.08
"""Time in s that a rise of current takes beyond that of its slope: one that is too quick shakes the
joint, and a contact with little damping creeps while it is shaken."""

SHORTEST_PAUSE, LONGEST_PAUSE = 0.15, 2.4
"""Times on a stair, s: doubled from the shortest on until the joint rests, or slides."""

SLIDE_SHARE = 0.5
"""A joint slides that moves during a pause by this share of all its movement on the ramp before."""

CREEP = 3e-4
"""Speed in rad/s below which a joint holds although it never comes to rest: a contact may creep at
a steady rate from far below breakaway on. Low speeds are a hundred times as fast."""

# The joint also rests if it moves in the last third of a pause by at most this share of its
# movement in the second third, or by at most so much of a count, or by less than its noise shows.
_SPEED_SHARE, _COUNTS, _ERRORS = 0.5, 0.5, 3.0


class Held(NamedTuple):
    """A pause during which the joint came to rest: beginning and end in s, position in rad."""

    begin: float
    end: float
    position: float


def first_stair(held: Sequence[float]) -> float:
    """Return the current in A of a ramp's first stair, after those that held, A."""
    # A single one does not tell how much they differ.
    return NEAR_STAIR * min(held) if len(held) > 1 else FIRST_STAIR * held[0]


def risen(share: float, from_rest: bool) -> float:
    """Return the share by which a current has risen after a share of the time, level at the end.

    From rest, it begins with its mean slope: what damps the contact would else seem to stiffen it.
    """
    slope = 1.0 if from_rest else 0.0
    return share * (slope + share * (3.0 - 2.0 * slope - share * (2.0 - slope)))


def rests(time: Sequence[float], position: Sequence[float], sign: int, resolution: float) -> bool:
    """Return whether a joint has come to rest, or nearly so, during a pause.

    Time in s and position in rad since its beginning; `sign` is the ramp's direction, `resolution`
    the angle of an encoder count in rad. The means of thirds are compared, which resolve less than
    a count.
    """
    share = (np.asarray(time) - time[0]) / (time[-1] - time[0])
    x = sign * (np.asarray(position) - position[0])
    thirds = [x[(share >= k / 3.0) & (share <= (k + 1) / 3.0)] for k in range(3)]
    first, second, third = (float(np.mean(part)) for part in thirds)
    before, now = second - first, third - second
    noise = _ERRORS * noise_level(x - np.interp(share, (1 / 6, 0.5, 5 / 6), (
        first, second, third))) * math.sqrt(2.0 / len(thirds[-1]))
    creep = CREEP * (time[-1] - time[0]) / 3.0
    return now <= max(_COUNTS * resolution, noise, _SPEED_SHARE * before, creep)


def unseen_speed(held: Sequence[Held], resolution: float) -> float:
    """Return the speed in rad/s below which a joint seemed to rest, by an encoder's count in rad.

    The median of pauses during which the joint came to rest, see `rests`.
    """
    return float(np.median([3.0 * _COUNTS * resolution / (one.end - one.begin) for one in held]))


class SlideBegin(NamedTuple):
    """Where a joint breaks away on a ramp: time in s, measured current in A, position in rad."""

    time: float
    current: float
    position: float


@dataclass(frozen=True)
class BreakawayRecords:
    """Every breakaway of an identification; arrays of shape (M,), in order of time."""

    time: np.ndarray        # s
    current: np.ndarray     # A, negative in the negative direction
    position: np.ndarray    # rad
    direction: np.ndarray   # +1 or -1

    def __len__(self) -> int:
        return len(self.time)

    def currents(self, direction: int) -> np.ndarray:
        """Return the currents of one direction in A, signed."""
        return self.current[self.direction == direction]

    def statistics(self) -> Breakaway:
        """Return means, standard deviations, mean positions; InputError without both directions."""
        values = {}
        for name, direction in (('positive', 1), ('negative', -1)):
            currents = self.currents(direction)
            if currents.size == 0:
                raise InputError(f'no breakaway in the {name} direction')
            values[f'{name}_mean'] = float(np.mean(currents))
            values[f'{name}_std'] = float(np.std(currents, ddof=1)) if currents.size > 1 else 0.0
            values[f'{name}_position'] = float(np.mean(self.position[self.direction == direction]))
        return Breakaway(**values)


def breakaway_records(begins: list[SlideBegin], directions: list[int]) -> BreakawayRecords:
    """Return the beginnings of slides, and their directions, as arrays."""
    time, current, position = np.array(begins, dtype=float).reshape(-1, 3).T
    return BreakawayRecords(time, current, position, np.array(directions, dtype=int))
