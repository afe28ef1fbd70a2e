# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Both compensation laws for one joint and one sample, compiled.

`CompensationLaw` calls these functions for the motor, and `reproduce` for thousands of runs.
"""

from __future__ import annotations

import math

from numba import njit

from friction_comp.compensation.continuous_law import continuous_current
from friction_comp.compensation.law_columns import (
    BREAK_NEGATIVE,
    BREAK_POSITIVE,
    BREAKAWAY_TERM,
    BUMP,
    CHANGED,
    CONTINUOUS,
    DEAD_SPEED,
    FILTER_TIME,
    HALF_SPEED,
    KINETIC,
    KINETIC_TERM,
    LAST_POSITION,
    LAST_TIME,
    LAW,
    LIMIT,
    LOWER,
    NONE,
    OUTPUT,
    PLACE,
    QUIET,
    RESOLUTION,
    SAMPLE_TIME,
    SHIFT,
    SPEED,
    STARTED,
    STEEPNESS,
    STEP,
    STILL_PLACE,
    UPPER,
    VISCOUS,
)

# A model that is exchanged while the law runs takes effect within a few of these, s.
BUMP_TIME = 0.05
LONGEST_STEP = 0.1


@njit(cache=True)
def observe(p, s, time, position, velocity, known):
    """Take in a sample and return whether it can be used.

    Parameters
    ----------
    p, s : ndarray
        Parameters and state of the joint; the state changes in place.
    time, position, velocity : float
        s, rad, rad/s.
    known : bool
        Whether the velocity is measured; otherwise the position is differentiated.
    """
    if not (math.isfinite(time) and math.isfinite(position)
            and (math.isfinite(velocity) or not known)):
        s[:] = 0.0
        return False
    if s[STARTED] > 0.0:
        # To whole nanoseconds, the resolution of stamps: a law that is driven by messages and one
        # in a plain loop then see the same step.
        step = min(LONGEST_STEP, max(0.0, round((time - s[LAST_TIME]) * 1e9) * 1e-9))
    else:
        step = p[SAMPLE_TIME]
        s[LAST_POSITION] = position
        s[PLACE] = position
        s[STILL_PLACE] = position
    if not known:
        velocity = (position - s[LAST_POSITION]) / step if step > 0.0 else s[SPEED]
    if p[LAW] == CONTINUOUS and p[FILTER_TIME] > 0.0:
        # Twice, so that a single count neither jumps nor bends the current.
        share = 1.0 - math.exp(-step / p[FILTER_TIME])
        s[HALF_SPEED] += (velocity - s[HALF_SPEED]) * share
        s[SPEED] += (s[HALF_SPEED] - s[SPEED]) * share
        s[PLACE] += (position - s[PLACE]) * share
    else:
        s[SPEED] = velocity
        s[PLACE] = position
    # An encoder at the edge of a count flickers between two.
    if abs(position - s[STILL_PLACE]) > 1.5 * p[RESOLUTION]:
        s[STILL_PLACE] = position
        s[QUIET] = 0.0
    else:
        s[QUIET] += step
    s[STEP] = step
    s[STARTED] = 1.0
    s[LAST_TIME] = time
    s[LAST_POSITION] = position
    return True


@njit(cache=True)
def printed_current(p, speed):
    """Return the kinetic term of the printed law in A.

    Eq. 6 as it is, but only in motion: the fit says nothing about standstill between the slowest
    speeds of its table, and its value there, up to half of the breakaway current, is an accident
    of where the transition came to lie. DEAD_SPEED, 0 in the law, lets `reproduce` show what slow
    motion contributes.
    """
    if abs(speed) <= p[DEAD_SPEED]:
        return 0.0
    return p[VISCOUS] * speed + p[LOWER] + (p[UPPER] - p[LOWER]) / (
        1.0 + math.exp(-p[STEEPNESS] * (speed - p[SHIFT])))


@njit(cache=True)
def paper_current(p, s, direction):
    """Return the current of section 2.5 as printed; `kinetic` is the same with direction 0."""
    kinetic = printed_current(p, s[SPEED])
    breakaway = 0.0
    if s[SPEED] == 0.0:
        if direction > 0.0:
            breakaway = p[BREAK_POSITIVE]
        elif direction < 0.0:
            breakaway = -p[BREAK_NEGATIVE]
    s[KINETIC_TERM] = kinetic
    s[BREAKAWAY_TERM] = breakaway
    return kinetic + breakaway


@njit(cache=True)
def decide(p, s, direction, effects, friction_effects):
    """Return the motor current in A for the sample that `observe` took in.

    Parameters
    ----------
    direction : float
        d: -1, 0 or +1, anything else counts as 0.
    effects : float
        Current of the model's further effects, A.
    friction_effects : float
        Their part that is friction too, which the breakaway term must not pay a second time.
    """
    if p[LAW] == NONE:
        return 0.0
    if not (direction == 1.0 or direction == -1.0) or p[LAW] == KINETIC:
        direction = 0.0
    if p[LAW] == CONTINUOUS:
        current = continuous_current(p, s, direction, friction_effects) + effects
    else:
        current = paper_current(p, s, direction) + effects
    if s[CHANGED] > 0.0:
        s[BUMP] = s[OUTPUT] - current
        s[CHANGED] = 0.0
    s[BUMP] *= math.exp(-s[STEP] / BUMP_TIME)
    current = min(p[LIMIT], max(-p[LIMIT], current + s[BUMP]))
    s[OUTPUT] = current
    return current


@njit(cache=True)
def observe_bank(p, s, time, position, velocity, known, usable):
    """Take in a sample of every joint; rows are joints."""
    for j in range(p.shape[0]):
        usable[j] = observe(p[j], s[j], time, position[j], velocity[j], known)


@njit(cache=True)
def decide_bank(p, s, usable, direction, effects, friction_effects, current):
    """Write every joint's current in A; 0 where the sample cannot be used."""
    for j in range(p.shape[0]):
        if usable[j]:
            current[j] = decide(p[j], s[j], direction[j], effects[j], friction_effects[j])
        else:
            current[j] = 0.0
            s[j, KINETIC_TERM] = 0.0
            s[j, BREAKAWAY_TERM] = 0.0
            s[j, OUTPUT] = 0.0
