# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Both compensation laws for one joint and one sample, compiled.

`CompensationLaw` calls these functions for the motor, and `reproduce` for thousands of runs.
"""

from __future__ import annotations

import math

from numba import njit

NONE, KINETIC, PAPER, CONTINUOUS = range(4)

# Columns of the parameters: rad/s, A, s.
(LAW, UPPER, LOWER, STEEPNESS, SHIFT, VISCOUS, BREAK_POSITIVE, BREAK_NEGATIVE, LIMIT, SAMPLE_TIME,
 FILTER_TIME, RISE_TIME, FADE_BEGIN, FADE_END, BACK_SPEED) = range(15)
PARAMETERS = 15

# Columns of the state.
(STARTED, LAST_TIME, LAST_POSITION, SPEED, STEP, LEVEL, KINETIC_TERM, BREAKAWAY_TERM, OUTPUT, BUMP,
 CHANGED) = range(11)
STATES = 11

# A model that is exchanged while the law runs takes effect within a few of these, s.
BUMP_TIME = 0.05
LONGEST_STEP = 0.1


@njit(cache=True)
def smooth(share):
    """Return 0 below 0, 1 above 1 and the cubic between them whose ends are level."""
    share = min(1.0, max(0.0, share))
    return share * share * (3.0 - 2.0 * share)


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
        s[STARTED] = 0.0
        s[SPEED] = 0.0
        s[LEVEL] = 0.0
        s[BUMP] = 0.0
        return False
    if s[STARTED] > 0.0:
        # To whole nanoseconds, the resolution of stamps: a law that is driven by messages and one
        # in a plain loop then see the same step.
        step = min(LONGEST_STEP, max(0.0, round((time - s[LAST_TIME]) * 1e9) * 1e-9))
    else:
        step = p[SAMPLE_TIME]
        s[LAST_POSITION] = position
    if not known:
        velocity = (position - s[LAST_POSITION]) / step if step > 0.0 else s[SPEED]
    if p[LAW] == CONTINUOUS and p[FILTER_TIME] > 0.0:
        s[SPEED] += (velocity - s[SPEED]) * (1.0 - math.exp(-step / p[FILTER_TIME]))
    else:
        s[SPEED] = velocity
    s[STEP] = step
    s[STARTED] = 1.0
    s[LAST_TIME] = time
    s[LAST_POSITION] = position
    return True


@njit(cache=True)
def kinetic_current(p, speed):
    """Return the kinetic term in A.

    The printed law takes Eq. 6 as it is, but only in motion: the fit says nothing about standstill
    between the slowest speeds of its table, and its value there, up to half of the breakaway
    current, is an accident of where the transition came to lie. The continuous law centres the
    transition at standstill, with the same plateaus.
    """
    if p[LAW] == CONTINUOUS:
        plateau = p[UPPER] if speed > 0.0 else -p[LOWER]
        return p[VISCOUS] * speed + plateau * math.tanh(0.5 * p[STEEPNESS] * speed)
    if speed == 0.0:
        return 0.0
    return p[VISCOUS] * speed + p[LOWER] + (p[UPPER] - p[LOWER]) / (
        1.0 + math.exp(-p[STEEPNESS] * (speed - p[SHIFT])))


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
    if (direction != 1.0 and direction != -1.0) or p[LAW] == KINETIC:
        direction = 0.0
    speed = s[SPEED]
    kinetic = kinetic_current(p, speed)
    wanted = 0.0
    if direction > 0.0:
        wanted = p[BREAK_POSITIVE]
    elif direction < 0.0:
        wanted = -p[BREAK_NEGATIVE]
    if p[LAW] == CONTINUOUS:
        # The level itself turns smoothly when the direction does.
        largest = max(p[BREAK_POSITIVE], p[BREAK_NEGATIVE])
        most = largest * s[STEP] / p[RISE_TIME] if p[RISE_TIME] > 0.0 else math.inf
        s[LEVEL] += min(most, max(-most, wanted - s[LEVEL]))
        sign = 1.0 if s[LEVEL] > 0.0 else -1.0
        along = speed * sign
        if along >= 0.0:
            keep = 1.0 - smooth((along - p[FADE_BEGIN]) / (p[FADE_END] - p[FADE_BEGIN]))
        else:
            keep = 1.0 - smooth(-along / p[BACK_SPEED])
        breakaway = sign * keep * max(
            0.0, abs(s[LEVEL]) - max(0.0, sign * (kinetic + friction_effects)))
    else:
        s[LEVEL] = wanted
        breakaway = wanted if speed == 0.0 else 0.0
    current = kinetic + breakaway + effects
    if s[CHANGED] > 0.0:
        s[BUMP] = s[OUTPUT] - current
        s[CHANGED] = 0.0
    s[BUMP] *= math.exp(-s[STEP] / BUMP_TIME)
    current += s[BUMP]
    current = min(p[LIMIT], max(-p[LIMIT], current))
    s[KINETIC_TERM] = kinetic
    s[BREAKAWAY_TERM] = breakaway
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
