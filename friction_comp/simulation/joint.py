# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated geared joints with encoder, current sensor, torque sensor S2 and a person."""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np

from friction_comp.errors import InputError
from friction_comp.simulation import joint_kernel as kernel
from friction_comp.simulation.undeclared import Undeclared

SIMULATION_ENTRIES = {
    'inertia', 'presliding_stiffness', 'presliding_damping', 'stribeck_velocity', 'current_noise',
    'torque_noise', 'human', 'movement', 'sources'}
HUMAN_ENTRIES = {'stiffness', 'damping', 'response_time'}

# Where a model file says nothing: a joint that its breakaway torque would accelerate at 10 rad/s²
# and deflect by 0.5 mrad, about what the note's drives do.
DEFAULT_ACCELERATION = 10.0
DEFAULT_PRESLIDING = 5e-4
DEFAULT_DAMPING_RATIO = 0.5
DEFAULT_STRIBECK_VELOCITY = math.radians(3.0)
DEFAULT_CURRENT_NOISE = 2e-3
# The person leans on the joint with the breakaway torque when it lags 0.1 rad behind.
DEFAULT_HUMAN_LAG = 0.1
DEFAULT_HUMAN_RESPONSE = 0.04


@dataclass(frozen=True)
class PlantState:
    """What a plant's sensors show at one instant; arrays of shape (J,).

    Attributes
    ----------
    time : float
        s since the start.
    position : ndarray
        rad, whole encoder counts.
    velocity : ndarray
        rad/s, first difference of the counted position.
    current : ndarray
        Measured motor current in A.
    interaction_torque : ndarray
        τ_b at the torque sensor S2 in N·m, positive where the person pushes forward.
    temperature : ndarray
        Motor temperature in degrees Celsius.
    """

    time: float
    position: np.ndarray
    velocity: np.ndarray
    current: np.ndarray
    interaction_torque: np.ndarray
    temperature: np.ndarray


def plant_parameters(model, undeclared=None):
    """Return the kernel's parameters of one joint.

    Parameters
    ----------
    model : FrictionModel
        Sigmoid, breakaway with its scatter, and the section `simulation`: `inertia` kg·m²,
        `presliding_stiffness` N·m/rad, `presliding_damping` N·m·s/rad, `stribeck_velocity`
        rad/s, `current_noise` A, `torque_noise` N·m, `human` with `stiffness` N·m/rad,
        `damping` N·m·s/rad and `response_time` s. What is missing follows from the drive.
    undeclared : Undeclared, optional

    Returns
    -------
    ndarray, shape (kernel.PARAMETERS,)

    Raises
    ------
    InputError
        If an entry is unknown, not a number or out of range.
    """
    undeclared = Undeclared() if undeclared is None else undeclared
    section = model.simulation
    _known(section, SIMULATION_ENTRIES, 'simulation')
    human = section.get('human') or {}
    _known(human, HUMAN_ENTRIES, 'simulation.human')
    sigmoid, scale = model.sigmoid, model.drive.torque_per_current
    plateaus = np.maximum([sigmoid.upper, -sigmoid.lower], 1e-6) * scale
    if model.breakaway is None:
        levels, scatter = plateaus, np.zeros(2)
    else:
        both = model.breakaway
        levels = np.maximum([both.positive_mean, -both.negative_mean], 1e-6) * scale
        scatter = np.array([both.positive_std, both.negative_std]) * scale
    typical = float(np.mean(levels))

    p = np.zeros(kernel.PARAMETERS)
    p[kernel.INERTIA] = undeclared.inertia + _number(
        section, 'inertia', typical / DEFAULT_ACCELERATION, 1e-9)
    p[kernel.TORQUE_PER_CURRENT] = scale * undeclared.torque_constant_factor
    p[kernel.RESOLUTION] = model.drive.position_resolution or 0.0
    p[kernel.LIMIT] = model.drive.current_limit
    p[kernel.CURRENT_NOISE] = _number(section, 'current_noise', DEFAULT_CURRENT_NOISE, 0.0)
    p[kernel.TORQUE_NOISE] = _number(section, 'torque_noise', 0.0, 0.0)
    p[kernel.STIFFNESS] = _number(
        section, 'presliding_stiffness', typical / DEFAULT_PRESLIDING, 1e-9)
    p[kernel.DAMPING] = _number(
        section, 'presliding_damping', 2.0 * DEFAULT_DAMPING_RATIO * math.sqrt(
            p[kernel.STIFFNESS] * p[kernel.INERTIA]), 0.0)
    p[kernel.UPPER] = sigmoid.upper * scale
    p[kernel.LOWER] = sigmoid.lower * scale
    p[kernel.STEEPNESS] = sigmoid.steepness
    p[kernel.SHIFT] = sigmoid.shift
    p[kernel.VISCOUS] = sigmoid.viscous * scale
    p[kernel.FLOOR_POSITIVE:kernel.FLOOR_NEGATIVE + 1] = np.minimum(levels, plateaus)
    p[kernel.BREAK_POSITIVE:kernel.BREAK_NEGATIVE + 1] = levels
    p[kernel.STD_POSITIVE:kernel.STD_NEGATIVE + 1] = scatter
    p[kernel.STRIBECK_VELOCITY] = _number(
        section, 'stribeck_velocity', DEFAULT_STRIBECK_VELOCITY, 1e-9)
    p[kernel.LAG] = undeclared.actuation_lag
    p[kernel.HUMAN_STIFFNESS] = _number(human, 'stiffness', typical / DEFAULT_HUMAN_LAG, 0.0)
    p[kernel.HUMAN_DAMPING] = _number(
        human, 'damping', 2.0 * math.sqrt(p[kernel.HUMAN_STIFFNESS] * p[kernel.INERTIA]), 0.0)
    p[kernel.HUMAN_RESPONSE] = _number(human, 'response_time', DEFAULT_HUMAN_RESPONSE, 0.0)
    p[kernel.THERMAL:kernel.THERMAL + 4] = undeclared.thermal
    return p


def random_states(seed, runs):
    """Return independent starting points of `runs` random sequences, shape (runs, 1) uint64."""
    return np.random.SeedSequence(seed).generate_state(runs, np.uint64).reshape(runs, 1)


class Plant:
    """Simulated joints that are stepped one sample at a time.

    Parameters
    ----------
    models : list of FrictionModel
        One per joint: see `plant_parameters`.
    seed : int
        Of all noise and scatter; the same seed and commands give the same numbers.
    undeclared : list of Undeclared or None, optional
        One per joint.
    sample_time : float
        s.
    """

    def __init__(self, models, seed=0, undeclared=None, sample_time=1e-3):
        models = list(models)
        undeclared = [None] * len(models) if undeclared is None else list(undeclared)
        if not models or len(undeclared) != len(models):
            raise InputError('the plant needs one model, and one undeclared file or none, a joint')
        if not (math.isfinite(sample_time) and 0.0 < sample_time <= 0.01):
            raise InputError(f'sample_time must be in (0, 0.01] s, not {sample_time!r}')
        self.sample_time = float(sample_time)
        self.joints = len(models)
        self._random = random_states(seed, self.joints)
        self._parameters = np.array(
            [plant_parameters(model, extra) for model, extra in zip(models, undeclared)])
        extras = [Undeclared() if extra is None else extra for extra in undeclared]
        self._tables = np.full((self.joints, max(len(e.table) for e in extras), 10), -1.0)
        for table, extra in zip(self._tables, extras):
            table[:len(extra.table)] = extra.table
        self._memories = np.zeros((self.joints, max(1, max(e.memory_size for e in extras))))
        self._states = np.zeros((self.joints, kernel.STATES))
        self._out = np.zeros((self.joints, kernel.OUTPUTS))
        for j in range(self.joints):
            kernel.start_state(self._parameters[j], self._states[j], self._random[j])
            kernel.measure(self._parameters[j], self._states[j], self._random[j],
                           self.sample_time, self._out[j])
        self.state = self._measured()

    def step(self, command, reference_position=None, reference_velocity=None, human_active=None):
        """Hold a current over one sample and return what the sensors show at its end.

        Parameters
        ----------
        command : array_like, shape (J,)
            Motor current in A; not finite counts as 0, larger than the limit is clipped.
        reference_position, reference_velocity : array_like, shape (J,), optional
            The movement that the person follows, at the state's time: rad, rad/s.
        human_active : array_like of bool, shape (J,), optional
            Which joints the person holds; all that have a reference when omitted.

        Returns
        -------
        PlantState
        """
        active = reference_position is not None if human_active is None else human_active
        active = np.broadcast_to(np.asarray(active, dtype=bool), self.joints).copy()
        position = self._row(0.0 if reference_position is None else reference_position)
        velocity = self._row(0.0 if reference_velocity is None else reference_velocity)
        active &= np.isfinite(position) & np.isfinite(velocity)
        kernel.bank_sample(
            self._parameters, self._states, self._random, self._tables, self._memories,
            self.sample_time, self._row(command), position, velocity, active, self._out)
        self.state = self._measured()
        return self.state

    def _row(self, values):
        row = np.asarray(values, dtype=float)
        if row.ndim and row.shape != (self.joints,):
            raise InputError(f'expected {self.joints} values, one a joint, not shape {row.shape}')
        return np.broadcast_to(row, self.joints).astype(float)

    def _measured(self):
        out = self._out
        return PlantState(
            time=float(self._states[0, kernel.SAMPLES]) * self.sample_time,
            position=out[:, kernel.OUT_POSITION].copy(),
            velocity=out[:, kernel.OUT_VELOCITY].copy(),
            current=out[:, kernel.OUT_CURRENT].copy(),
            interaction_torque=out[:, kernel.OUT_TORQUE].copy(),
            temperature=out[:, kernel.OUT_TEMPERATURE].copy())


def _known(section, names, where):
    if not isinstance(section, dict):
        raise InputError(f'{where} is not a mapping')
    unknown = set(section) - names
    if unknown:
        raise InputError(f'{where} has unknown entries: {sorted(map(str, unknown))}')


def _number(section, name, default, lowest):
    value = section.get(name, default)
    if (isinstance(value, bool) or not isinstance(value, (int, float))
            or not math.isfinite(value) or value < lowest):
        raise InputError(
            f'simulation: {name} must be a finite number of at least {lowest}, not {value!r}')
    return float(value)
