# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Field names of the parameters, state and measured values of a simulated joint.

Compiled code reads the fields of these records by name. Where their values come from is in
`joint_parameters`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

ELEMENTS = 8
"""The most Maxwell-slip elements."""
DELAYS = 4
"""Samples by which a command can be late are fewer than this."""

RIGID, CLAMP, LUGRE, MAXWELL_SLIP = range(4)
"""One inertia that a clamp holds (`rigid_joint`), or two that a gear joins (`geared_joint`)."""

Record = Any
"""A record of one of the types below."""


def _record(floats: str, integers: str, arrays: dict[str, int]) -> np.dtype[np.void]:
    return np.dtype([(name, float) for name in floats.split()]
                    + [(name, np.int64) for name in integers.split()]
                    + [(name, float, (size,)) for name, size in arrays.items()], align=True)


JOINT = _record(
    # Rotor and link, kg·m²; the gear's compliance between them, N·m/rad and N·m·s/rad.
    'motor_inertia link_inertia gear_stiffness gear_damping '
    # N·m/A, rad, A; standard deviations in A and N·m.
    'torque_per_current resolution limit current_noise torque_noise '
    # Friction: Eq. 6 and the levels at rest in N·m, s/rad, rad/s, N·m·s/rad.
    'upper lower steepness shift viscous floor_positive floor_negative break_positive '
    'break_negative std_positive std_negative stribeck_velocity '
    # Presliding, N·m/rad and N·m·s/rad; times in s.
    'bristle_stiffness bristle_damping level_lag current_lag actuation_lag '
    # The motor's supply: V·s/rad at the joint, Ω, V; no limit where the resistance is 0.
    'back_emf resistance voltage '
    # The person, N·m/rad, N·m·s/rad, s and s.
    'human_stiffness human_damping human_response human_integral_time',
    'kind delay elements',
    {'thermal': 4, 'share': ELEMENTS, 'distance': ELEMENTS})
"""Parameters of one joint, all at the joint. `thermal` is that of `undeclared.warmed_up`; `share`
(1) and `distance` (rad) are those of the Maxwell-slip elements, of which `elements` count."""

FRICTION = ('upper', 'lower', 'viscous', 'floor_positive', 'floor_negative', 'break_positive',
            'break_negative', 'std_positive', 'std_negative')
"""The parameters to scale for a joint with more friction or less."""

JOINT_STATE = _record(
    # Where encoder and friction are, and the link; rad and rad/s.
    'rotor rotor_speed link link_speed '
    # Friction's level, and those drawn for this rest, N·m; how long the joint has been sticking,
    # s, and how far it has slid, rad.
    'level level_positive level_negative rest slid '
    # A, A; the person's push and the part of it that grew while the joint stood short, N·m;
    # degrees Celsius, rad, 1.
    'current late_current human pushed_on temperature counted samples',
    'sliding arrived', {'bristle': ELEMENTS, 'command': DELAYS})
"""State of one joint; `start_joint` sets it."""

MEASURED = np.dtype([(name, float) for name in (
    'position', 'velocity', 'current', 'interaction_torque', 'temperature')], align=True)
"""What a joint's sensors show: rad, rad/s, A, N·m, degrees Celsius."""
