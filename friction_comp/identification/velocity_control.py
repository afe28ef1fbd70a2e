# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The joint-velocity controller that identification drives the joint with (note, section 2.3).

A PI controller acts on ``e = (ω_ref - ω) + λ·(φ_ref - φ)``: the position part keeps the joint
inside its motion range however long the cycle, and lets the encoder's fine position stand in for
its coarse velocity (one count in a millisecond is 0.9 deg/s on the note's configuration 1). The
velocity is the encoder's difference behind a first-order low pass.
"""

from __future__ import annotations

from typing import NamedTuple

from numba import njit
import numpy as np

from friction_comp.low_pass import low_pass_weight

BANDWIDTH = 100.0
"""Crossover frequency in rad/s: far below the 1 ms sampling, far above the profile's changes."""

# rad/s of reference velocity over which the push fades in.
_BLEND_VELOCITY = 0.002

# Places in the state array.
LAST_POSITION, VELOCITY, INTEGRAL, LAST_REFERENCE = 0, 1, 2, 3


class Controller(NamedTuple):
    """Parameters of the controller.

    An error of a factor two of the acceleration per current either way is harmless: the phase
    margin stays near 40 degrees or above. The push roughly overcomes friction in each direction;
    it is fed forward with the sign of the reference velocity and spares the integrator the swing
    at reversals. The mean current measured does not depend on it.
    """

    acceleration_per_current: float     # k_t·n/J, rad/s² per A
    limit: float                        # A
    push_positive: float = 0.0          # A
    push_negative: float = 0.0          # A, negative
    bandwidth: float = BANDWIDTH        # rad/s


def velocity_controller_state() -> np.ndarray:
    """Return a fresh state array, float64: the controller at rest."""
    return np.array([np.nan, 0.0, 0.0, 0.0])


@njit(cache=True)
def velocity_controller_step(parameters: Controller, state: np.ndarray, reference_position: float,
                             reference_velocity: float, position: float, time_step: float) -> float:
    """Return the current in A for one sample and advance the state in place.

    The references are in rad and rad/s; the time since the previous sample is in s, longer where
    samples were missed.
    """
    if np.isnan(state[LAST_POSITION]):
        state[LAST_POSITION], state[LAST_REFERENCE] = position, reference_velocity
    bandwidth = parameters.bandwidth
    gain = bandwidth / parameters.acceleration_per_current
    share = low_pass_weight(time_step, 1.0 / (5.0 * bandwidth))
    measured = (position - state[LAST_POSITION]) / time_step
    state[VELOCITY] += share * (measured - state[VELOCITY])
    state[LAST_POSITION] = position
    acceleration = (reference_velocity - state[LAST_REFERENCE]) / time_step
    state[LAST_REFERENCE] = reference_velocity

    blend = min(1.0, abs(reference_velocity) / _BLEND_VELOCITY)
    push = parameters.push_positive if reference_velocity > 0.0 else parameters.push_negative
    error = ((reference_velocity - state[VELOCITY])
             + bandwidth / 6.0 * (reference_position - position))
    current = (blend * push + 1.0 / parameters.acceleration_per_current * acceleration
               + gain * error + state[INTEGRAL])
    if abs(current) > parameters.limit:
        return parameters.limit if current > 0.0 else -parameters.limit
    # The integrator stops at the limit, to avoid windup.
    state[INTEGRAL] += gain * bandwidth / 5.0 * error * time_step
    return current
