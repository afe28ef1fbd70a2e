# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The joint-velocity controller of identification (note, section 2.3).

A PI controller acts on ``e = (ω_ref - ω) + λ·(φ_ref - φ)``. The position term keeps the joint in
its range during long cycles, and compensates for the coarse velocity of the encoder. The velocity
is the difference of encoder positions, filtered by a first-order low pass.
"""

from __future__ import annotations

from typing import NamedTuple

from numba import njit
import numpy as np

from friction_comp.low_pass import low_pass_weight

BANDWIDTH, LEAST_BANDWIDTH = 100.0, 10.0
"""Crossover frequency in rad/s: far below the sampling frequency of 1 kHz, far above that of the
profile; it falls with rate and delay. Below the second, slow constant velocities are not held."""
PHASE, DELAY_SHARE = 1.0, 0.4
"""Phase margin in rad without any delay: a quarter turn less filter, integrator and position, 0.2 +
0.2 + 0.16 rad; and the share of it that sampling and delay may take: 34 degrees then remain."""
LEAST_RATE = 100.0
"""Lowest rate of joint states in Hz at which a joint is moved."""
LONGEST_DELAY = DELAY_SHARE * PHASE / LEAST_BANDWIDTH - 1.0 / LEAST_RATE
"""Longest delay in s between command and measured current at which a joint is moved, 0.03 s."""
# rad/s of reference velocity over which the push fades in.
_BLEND_VELOCITY = 0.002
# Places in the state array.
_POSITION, _VELOCITY, _INTEGRAL, _REFERENCE = 0, 1, 2, 3


class Controller(NamedTuple):
    """Parameters of the controller.

    An acceleration per current that is wrong by a factor of two is harmless: the phase margin stays
    near 40 degrees. The push, about friction, is fed forward with the sign of the reference
    velocity, so that the integrator need not change at reversals; the measured mean does not depend
    on it.
    """

    acceleration_per_current: float     # k_t·n/J, rad/s² per A
    limit: float                        # A
    push_positive: float = 0.0          # A
    push_negative: float = 0.0          # A, negative
    bandwidth: float = BANDWIDTH        # rad/s


def velocity_controller_state() -> np.ndarray:
    """Return a new state array, float64, of a controller at rest."""
    return np.array([np.nan, 0.0, 0.0, 0.0])


@njit(cache=True)
def velocity_controller_step(parameters: Controller, state: np.ndarray, reference_position: float,
                             reference_velocity: float, position: float, time_step: float) -> float:
    """Return the current in A for one sample (rad, rad/s, s), and advance the state in place."""
    if np.isnan(state[_POSITION]):
        state[_POSITION], state[_REFERENCE] = position, reference_velocity
    bandwidth = parameters.bandwidth
    gain = bandwidth / parameters.acceleration_per_current
    share = low_pass_weight(time_step, 1.0 / (5.0 * bandwidth))
    measured = (position - state[_POSITION]) / time_step
    state[_VELOCITY] += share * (measured - state[_VELOCITY])
    state[_POSITION] = position
    acceleration = (reference_velocity - state[_REFERENCE]) / time_step
    state[_REFERENCE] = reference_velocity

    blend = min(1.0, abs(reference_velocity) / _BLEND_VELOCITY)
    push = parameters.push_positive if reference_velocity > 0.0 else parameters.push_negative
    error = ((reference_velocity - state[_VELOCITY])
             + bandwidth / 6.0 * (reference_position - position))
    current = (blend * push + 1.0 / parameters.acceleration_per_current * acceleration
               + gain * error + state[_INTEGRAL])
    if abs(current) > parameters.limit:
        return parameters.limit if current > 0.0 else -parameters.limit
    # The integrator stops at the limit, to avoid windup.
    state[_INTEGRAL] += gain * bandwidth / 5.0 * error * time_step
    return current
