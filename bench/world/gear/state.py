# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The numbers of a gear, of its state and of a person, as records that compiled code reads."""

import numpy as np

from world.person import floats as _floats, PERSON_STATE

ELEMENTS = 6
LONGEST_COMMAND_DELAY = 4

MAXWELL_SLIP, LUGRE, CLAMP, DAHL, BOUC_WEN = range(5)
FRICTIONS = {'maxwell_slip': MAXWELL_SLIP, 'lugre': LUGRE, 'clamp': CLAMP, 'dahl': DAHL,
             'bouc_wen': BOUC_WEN}
DIFFERENCE, FILTERED, DRIVER = range(3)


# All at the joint: a motor's angle divided by the gear ratio, its torque times the ratio. SI.
GEAR = np.dtype([
    ('friction', 'i8'), ('velocity_kind', 'i8'), ('command_delay', 'i8'),
    *_floats(
        # rotor and link, and the gear between them
        'motor_inertia link_inertia stiffness damping '
        # friction on the motor's side: sliding level, level at rest, how it falls between
        # them, how much larger it is in positive direction (relative, smaller in negative)
        'coulomb static stribeck_velocity stribeck_exponent viscous asymmetry '
        # breakaway scatter: relative, and the distance of sliding that renews the surface
        'scatter renewal '
        # presliding: distance (95 % of the level), damping ratio, shape constants of the kind
        'presliding damping_ratio bristle exponent share damping_velocity attraction '
        # friction on the link's side
        'link_coulomb link_bristle link_viscous '
        # what depends on place, load and temperature
        'ripple ripple_frequency ripple_phase cogging cogging_frequency cogging_phase '
        'load_friction gravity gravity_phase heating heating_time warming '
        # motor and converter
        'torque_per_current current_limit current_time current_noise current_ripple '
        'current_ripple_frequency back_emf resistance voltage '
        # sensor
        'resolution velocity_time velocity_noise'),
    ('element_share', 'f8', (ELEMENTS,)), ('element_distance', 'f8', (ELEMENTS,)),
])

STATE = np.dtype([
    ('random', 'u8'), *PERSON_STATE,
    *_floats('motor motor_velocity link link_velocity bristle link_bristle current slid resting '
             'breakaway_factor measured measured_velocity temperature offset friction '
             'friction_work'),
    ('element', 'f8', (ELEMENTS,)), ('slipping', 'i8', (ELEMENTS,)),
    ('commands', 'f8', (LONGEST_COMMAND_DELAY,)),
])
