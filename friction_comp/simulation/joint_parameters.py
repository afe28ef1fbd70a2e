# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Records of a simulated joint's parameters, state and measured values.

Compiled code reads their fields by name. `joint_parameters` makes the parameters of a model file.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from friction_comp.checks import check_mapping, check_number, check_whole_number
from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.simulation.undeclared import Undeclared

ELEMENTS = 8
"""Largest number of Maxwell-slip elements."""
DELAYS = 4
"""Number of commands that are stored: the largest delay is one sample less."""

RIGID, CLAMP, LUGRE, MAXWELL_SLIP = range(4)
"""Kinds of joint: one inertia with clamp friction, or one of the friction models of
a joint with two inertias and a gear ."""

Record = Any
"""A record of one of the types below."""


def _record(floats: str, integers: str, arrays: dict[str, int]) -> np.dtype[np.void]:
    return np.dtype([(name, float) for name in floats.split()]
                    + [(name, np.int64) for name in integers.split()]
                    + [(name, float, (size,)) for name, size in arrays.items()], align=True)


JOINT = _record(
    # Rotor and link, kg·m²; the gear's compliance between them, N·m/rad and N·m·s/rad.
    'motor_inertia link_inertia gear_stiffness gear_damping '
    # N·m/A; encoder count, rad; A; standard deviations in A and N·m.
    'torque_per_current resolution limit current_noise torque_noise '
    # Friction: Eq. 6, with steepness in s/rad, shift in rad/s and viscous in N·m·s/rad; levels at
    # rest, N·m; Stribeck velocity, rad/s.
    'upper lower steepness shift viscous floor_positive floor_negative break_positive '
    'break_negative std_positive std_negative stribeck_velocity '
    # Presliding, N·m/rad and N·m·s/rad; times in s.
    'bristle_stiffness bristle_damping level_lag current_lag actuation_lag '
    # The motor's supply: V·s/rad at the joint, Ω, V; a resistance of 0 means no limit.
    'back_emf resistance voltage '
    # The person: N·m/rad, N·m·s/rad, s, s.
    'human_stiffness human_damping human_response human_integral_time',
    'kind delay elements',
    {'thermal': 4, 'share': ELEMENTS, 'distance': ELEMENTS})
"""Parameters of one joint, all seen at the gear's output. `thermal` is that of
`undeclared.warmed_up`; `share` (1) and `distance` (rad) are those of the Maxwell-slip elements, of
which the first `elements` are used."""

FRICTION = ('upper', 'lower', 'viscous', 'floor_positive', 'floor_negative', 'break_positive',
            'break_negative', 'std_positive', 'std_negative')
"""The parameters to scale for a joint with more or less friction."""

JOINT_STATE = _record(
    # Rotor, where encoder and friction act, and link; rad and rad/s.
    'rotor rotor_speed link link_speed '
    # Sliding level, and the breakaway levels of the present rest, N·m; time since the joint began
    # to stick, s; distance slid, rad.
    'level level_positive level_negative rest slid '
    # Current, and after the actuation lag, A; the person's torque, and its part that grows while
    # the joint is short of its target, N·m; degrees Celsius; rad as the encoder counts; 1.
    'current late_current human integral_torque temperature counted samples',
    'sliding arrived', {'bristle': ELEMENTS, 'command': DELAYS})
"""State of one joint; `start_joint` sets it."""

MEASURED = np.dtype([(name, float) for name in (
    'position', 'velocity', 'current', 'interaction_torque', 'temperature')], align=True)
"""Measured values of one joint: rad, rad/s, A, N·m, degrees Celsius."""


GEARS = {'clamp': CLAMP, 'lugre': LUGRE, 'maxwell_slip': MAXWELL_SLIP}
GEAR_ENTRIES = {'gear', 'rotor_share', 'gear_resonance', 'gear_damping', 'supply_voltage',
                'winding_resistance'}
SIMULATION_ENTRIES = {
    'inertia', 'presliding_stiffness', 'presliding_damping', 'stribeck_velocity', 'current_noise',
    'torque_noise', 'delay_samples', 'human', 'movement', 'sources'} | GEAR_ENTRIES
HUMAN_ENTRIES = {'stiffness', 'damping', 'response_time', 'integral_time'}

# Of the breakaway torque, rad.
DEFAULT_PRESLIDING = 5e-4
DEFAULT_DAMPING_RATIO = 0.5
DEFAULT_STRIBECK_VELOCITY = math.radians(3.0)


def joint_parameters(model: FrictionModel, undeclared: Undeclared | None = None) -> np.void:
    """Return the parameters of one joint, a record of `JOINT`, from its model.

    They follow from its sigmoid, its breakaway with scatter, and its section `simulation` (see
    msg_docs/README.md). Raises InputError if an entry is unknown, not a number or out of range.
    """
    undeclared = Undeclared() if undeclared is None else undeclared
    section = model.simulation
    check_mapping(section, 'simulation', SIMULATION_ENTRIES)
    p: np.void = np.zeros(1, JOINT)[0]
    scale = model.drive.torque_per_current
    p['torque_per_current'] = scale * undeclared.torque_constant_factor
    p['resolution'] = model.drive.position_resolution or 0.0
    p['limit'] = model.drive.current_limit
    p['current_noise'] = _entry(section, 'current_noise', 2e-3, least=0.0)
    p['torque_noise'] = _entry(section, 'torque_noise', 0.0, least=0.0)
    p['delay'] = check_whole_number(
        section.get('delay_samples', 0), 'simulation.delay_samples', least=0, most=DELAYS - 1)
    p['actuation_lag'] = undeclared.actuation_lag
    p['thermal'] = undeclared.thermal
    typical = _set_friction(p, model)
    # By default, the breakaway torque accelerates the joint at 10 rad/s².
    inertia = undeclared.inertia + _entry(section, 'inertia', typical / 10.0, least=1e-9)
    p['kind'], p['motor_inertia'] = RIGID, inertia
    stiffness = p['bristle_stiffness'] = _entry(
        section, 'presliding_stiffness', typical / DEFAULT_PRESLIDING, least=1e-9)
    p['bristle_damping'] = _entry(
        section, 'presliding_damping',
        2.0 * DEFAULT_DAMPING_RATIO * math.sqrt(stiffness * inertia), least=0.0)
    _set_human(p, section, typical, inertia)
    if 'gear' in section:
        _set_gear(p, model, typical / stiffness)
    elif own := GEAR_ENTRIES & set(section):
        raise InputError(f'simulation.{min(own)} needs a gear: one of {", ".join(GEARS)}')
    return p


def _set_friction(p: np.void, model: FrictionModel) -> float:
    """Set Eq. 6 and the levels at rest; return the mean of the breakaway levels, N·m."""
    sigmoid, scale = model.sigmoid, model.drive.torque_per_current
    plateaus = np.maximum([sigmoid.upper, -sigmoid.lower], 1e-6) * scale
    if model.breakaway is None:
        levels, scatter = plateaus, np.zeros(2)
    else:
        both = model.breakaway
        levels = np.maximum([both.positive_mean, -both.negative_mean], 1e-6) * scale
        scatter = np.array([both.positive_std, both.negative_std]) * scale
    for name in ('upper', 'lower', 'viscous'):
        p[name] = getattr(sigmoid, name) * scale
    p['steepness'], p['shift'] = sigmoid.steepness, sigmoid.shift
    p['floor_positive'], p['floor_negative'] = np.minimum(levels, plateaus)
    p['break_positive'], p['break_negative'] = levels
    p['std_positive'], p['std_negative'] = scatter
    p['stribeck_velocity'] = _entry(
        model.simulation, 'stribeck_velocity', DEFAULT_STRIBECK_VELOCITY, least=1e-9)
    return float(np.mean(levels))


def _set_human(p: np.void, section: dict[str, Any], typical: float, inertia: float) -> None:
    human = check_mapping(section.get('human') or {}, 'simulation.human', HUMAN_ENTRIES)

    def entry(name: str, default: float) -> float:
        return _entry(human, name, default, 'simulation.human', least=0.0)
    # At a lag of 0.1 rad the person pushes with the breakaway torque.
    p['human_stiffness'] = entry('stiffness', typical / 0.1)
    p['human_damping'] = entry('damping', 2.0 * math.sqrt(p['human_stiffness'] * inertia))
    p['human_response'] = entry('response_time', 0.04)
    # A joint that stops short of its target is pushed twice as hard after this time, s. The note's
    # peaks hardly depend on it (a quarter of it: 1.5 %), but with half of it, a joint with
    # compensated sliding friction overshoots the target.
    p['human_integral_time'] = entry('integral_time', 0.5)


def _set_gear(p: np.void, model: FrictionModel, presliding: float) -> None:
    """Split the inertia into rotor and link with a compliant gear; `presliding` is in rad."""
    section = model.simulation
    if section['gear'] not in tuple(GEARS):
        raise InputError(
            f'simulation.gear must be one of {", ".join(GEARS)}, not {section["gear"]!r}')
    inertia = float(p['motor_inertia'])
    # Most of the inertia at the output is the rotor's; rotor and link resonate at about 40 Hz.
    share = _entry(section, 'rotor_share', 0.8, least=0.05, most=0.95)
    resonance = _entry(section, 'gear_resonance', 40.0, least=1.0, most=300.0)
    damping = _entry(section, 'gear_damping', 0.05, least=0.0, most=1.0)
    p['kind'] = GEARS[section['gear']]
    p['motor_inertia'], p['link_inertia'] = share * inertia, (1.0 - share) * inertia
    reduced = share * (1.0 - share) * inertia
    p['gear_stiffness'] = reduced * (2.0 * math.pi * resonance) ** 2
    p['gear_damping'] = 2.0 * damping * math.sqrt(p['gear_stiffness'] * reduced)
    given = float(p['bristle_damping'])
    set_presliding(p, presliding, np.ones(ELEMENTS if p['kind'] == MAXWELL_SLIP else 1),
                   DEFAULT_DAMPING_RATIO)
    if 'presliding_damping' in section:
        p['bristle_damping'] = given
    if 'supply_voltage' in section or 'winding_resistance' in section:
        p['voltage'] = _entry(section, 'supply_voltage', 0.0, above=0.0)
        p['resistance'] = _entry(section, 'winding_resistance', 0.0, above=0.0)
        # In SI units the torque constant of a motor equals its back-EMF constant.
        p['back_emf'] = p['torque_per_current']


def set_presliding(p: np.void, distance: float, shares: np.ndarray, damping: float) -> None:
    """Set the presliding of a gear, in a record of JOINT.

    `distance` in rad is that of the element that slips last, or g_b/σ0 of LuGre; the elements'
    distances are spaced evenly up to it, `shares` are scaled to a sum of 1. `damping` is relative
    to the critical damping of the rotor on the elements before they slip.
    """
    count = len(shares)
    shares = np.asarray(shares, dtype=float) / np.sum(shares)
    distances = distance * np.arange(1, count + 1) / count
    p['elements'] = count
    p['share'][:count], p['distance'][:count] = shares, distances
    level = 0.5 * (p['break_positive'] + p['break_negative'])
    p['bristle_stiffness'] = level / distance
    p['bristle_damping'] = 2.0 * damping * math.sqrt(
        level * float(np.sum(shares / distances)) * p['motor_inertia'])


def _entry(section: dict[str, Any], name: str, default: float, where: str = 'simulation',
           **bounds: float) -> float:
    return check_number(section.get(name, default), f'{where}.{name}', **bounds)
