# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""All compensation laws for one joint and one sample, compiled.

`CompensationLaw` calls these functions for the motor, and `reproduce` for thousands of runs.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from friction_comp.compensation.friction_operator import continuous_current
from friction_comp.compensation.guards import observe, within_movement
from friction_comp.compensation.records import CONTINUOUS, KINETIC, NONE
from friction_comp.compiling import njit
from friction_comp.model.sigmoid import compiled_kinetic_current

BUMP_TIME = 0.05
"""s; time constant with which an exchanged model or law takes effect under one without slope limit.
"""


@njit(cache=True)
def printed_current(p: Any, speed: float) -> float:
    """Return the kinetic term of the printed law in A.

    Eq. 6, but only in motion: the look-up table has no points around standstill, so that the value
    of the fit there, up to half of the breakaway current, is arbitrary.
    """
    if speed == 0.0:
        return 0.0
    return compiled_kinetic_current(
        speed, p.upper, p.lower, p.steepness, p.shift, p.viscous)


@njit(cache=True)
def paper_current(p: Any, s: Any, direction: float) -> float:
    """Return the current of section 2.5 as printed; `kinetic` is the same with direction 0."""
    s.kinetic = printed_current(p, s.speed)
    s.breakaway = 0.0
    if s.speed == 0.0:
        if direction > 0.0:
            s.breakaway = p.gain * p.break_positive
        elif direction < 0.0:
            s.breakaway = -p.gain * p.break_negative
    return s.kinetic + s.breakaway


@njit(cache=True)
def decide(p: Any, s: Any, direction: float, end: float, forward: float, backward: float,
           carried: float) -> float:
    """Return the motor current in A for the sample that `observe` processed.

    Parameters
    ----------
    p, s : records of PARAMETERS and STATE
    direction : float
        d: -1, 0 or +1, anything else counts as 0.
    end : float
        Position at which the announced movement ends, rad; NaN if that is not said.
    forward, backward : float
        Signed contribution of friction effects in each direction of sliding, A; for the continuous
        law only.
    carried : float
        Current of other effects, A; of all effects for the other laws.
    """
    if not (direction == 1.0 or direction == -1.0) or p.law == KINETIC:
        direction = 0.0
    direction = within_movement(p, s, direction, end)
    if p.law >= CONTINUOUS:
        s.current = continuous_current(p, s, direction, forward, backward, carried)
    else:
        wanted = 0.0 if p.law == NONE else paper_current(p, s, direction) + carried
        if s.changed == 1:
            s.bump = s.current - wanted
        s.bump *= math.exp(-s.step / BUMP_TIME)
        s.current = min(p.limit, max(-p.limit, wanted + s.bump))
    s.changed = 0
    return s.current


@njit(cache=True)
def observe_bank(p: np.ndarray, s: np.ndarray, time: float, position: np.ndarray,
                 velocity: np.ndarray, known: bool, usable: np.ndarray) -> None:
    """Process a sample of every joint; rows are joints."""
    for j in range(len(p)):
        usable[j] = observe(p[j], s[j], time, position[j], velocity[j], known)


@njit(cache=True)
def decide_bank(p: np.ndarray, s: np.ndarray, usable: np.ndarray, direction: np.ndarray,
                end: np.ndarray, forward: np.ndarray, backward: np.ndarray, carried: np.ndarray,
                current: np.ndarray) -> None:
    """Write every joint's current in A; 0 where the sample cannot be used."""
    for j in range(len(p)):
        if usable[j]:
            current[j] = decide(
                p[j], s[j], direction[j], end[j], forward[j], backward[j], carried[j])
        else:
            current[j] = s[j].current = s[j].kinetic = s[j].breakaway = 0.0
