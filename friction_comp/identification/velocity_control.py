# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The joint-velocity controller that identification drives the joint with (note, section 2.3).

A PI controller acts on ``e = (ω_ref - ω) + λ·(φ_ref - φ)``: the position part keeps the joint
inside its motion range however long the cycle, and lets the encoder's fine position stand in for
its coarse velocity (one count in a millisecond is 0.9 deg/s on the note's configuration 1). The
velocity is the encoder's difference behind a first-order low pass.

The step is compiled, so that the ROS node, plain loops and batches of simulated runs all use the
same controller.
"""

from __future__ import annotations

from numba import njit
import numpy as np

from friction_comp.low_pass import low_pass_weight

BANDWIDTH = 100.0
"""Crossover frequency in rad/s: far below the 1 ms sampling, far above the profile's changes."""

# Places in the parameter array.
GAIN, INTEGRAL_GAIN, POSITION_RATE, FILTER_TIME, LIMIT = 0, 1, 2, 3, 4
PUSH_POSITIVE, PUSH_NEGATIVE, INERTIA, BLEND_VELOCITY = 5, 6, 7, 8
PARAMETERS = 9

# Places in the state array.
STARTED, LAST_POSITION, VELOCITY, INTEGRAL, LAST_REFERENCE = 0, 1, 2, 3, 4
STATES = 5


def velocity_controller_parameters(acceleration_per_current: float, current_limit: float,
                                   push_positive: float = 0.0, push_negative: float = 0.0,
                                   bandwidth: float = BANDWIDTH,
                                   blend_velocity: float = 0.002) -> np.ndarray:
    """Return the controller's parameter array, float64.

    Parameters
    ----------
    acceleration_per_current : float
        k_t·n/J in rad/s² per A. An error of a factor two either way is harmless: the phase
        margin stays near 40 degrees or above.
    current_limit : float
        A.
    push_positive, push_negative : float
        Current in A (the second negative) that roughly overcomes friction in each direction; it
        is fed forward with the sign of the reference velocity and spares the integrator the
        swing at reversals. The mean current measured does not depend on it.
    bandwidth : float
        Crossover frequency in rad/s.
    blend_velocity : float
        Reference velocity in rad/s over which the push fades in.
    """
    parameters = np.zeros(PARAMETERS)
    parameters[GAIN] = bandwidth / acceleration_per_current
    parameters[INTEGRAL_GAIN] = parameters[GAIN] * bandwidth / 5.0
    parameters[POSITION_RATE] = bandwidth / 6.0
    parameters[FILTER_TIME] = 1.0 / (5.0 * bandwidth)
    parameters[LIMIT] = current_limit
    parameters[PUSH_POSITIVE] = push_positive
    parameters[PUSH_NEGATIVE] = push_negative
    parameters[INERTIA] = 1.0 / acceleration_per_current
    parameters[BLEND_VELOCITY] = blend_velocity
    return parameters


def velocity_controller_state() -> np.ndarray:
    """Return a fresh state array, float64: the controller at rest."""
    return np.zeros(STATES)


@njit(cache=True)
def velocity_controller_step(parameters: np.ndarray, state: np.ndarray, reference_position: float,
                             reference_velocity: float, position: float, time_step: float) -> float:
    """Return the current in A for one sample and advance the state in place.

    Parameters
    ----------
    parameters, state : ndarray
        From `velocity_controller_parameters` and `velocity_controller_state`.
    reference_position, reference_velocity, position : float
        rad, rad/s, rad.
    time_step : float
        Time since the previous sample in s; missed samples make it longer.
    """
    if state[STARTED] == 0.0:
        state[STARTED] = 1.0
        state[LAST_POSITION] = position
        state[VELOCITY] = 0.0
        state[INTEGRAL] = 0.0
        state[LAST_REFERENCE] = reference_velocity
    share = low_pass_weight(time_step, parameters[FILTER_TIME])
    measured = (position - state[LAST_POSITION]) / time_step
    state[VELOCITY] += share * (measured - state[VELOCITY])
    state[LAST_POSITION] = position
    acceleration = (reference_velocity - state[LAST_REFERENCE]) / time_step
    state[LAST_REFERENCE] = reference_velocity

    blend = min(1.0, abs(reference_velocity) / parameters[BLEND_VELOCITY])
    push = parameters[PUSH_POSITIVE] if reference_velocity > 0.0 else parameters[PUSH_NEGATIVE]
    error = ((reference_velocity - state[VELOCITY])
             + parameters[POSITION_RATE] * (reference_position - position))
    current = (blend * push + parameters[INERTIA] * acceleration + parameters[GAIN] * error
               + state[INTEGRAL])
    limit = parameters[LIMIT]
    if current > limit:
        current = limit
    elif current < -limit:
        current = -limit
    else:
        # The integrator stops at the limit, to avoid windup.
        state[INTEGRAL] += parameters[INTEGRAL_GAIN] * error * time_step
    return current
