# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated geared joints with encoder, current sensor, torque sensor S2 and a person.

The plant node, `Plant` in a loop and the parallel runs of `reproduce` all call `joint_sample`. Its
equations of motion are in `joint_motion`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
import math

from numba import njit
import numpy as np
from numpy.typing import ArrayLike

from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.simulation.joint_motion import draw_levels, move_geared, move_rigid, normal
from friction_comp.simulation.joint_parameters import (
    DELAYS,
    ELEMENTS,
    joint_parameters,
    JOINT_STATE,
    MEASURED,
    Record,
    RIGID,
)
from friction_comp.simulation.undeclared import COLUMNS, Undeclared, warmed_up


@njit(cache=True)
def start_joint(p: Record, s: Record, random: np.ndarray) -> None:
    """Set the state to rest at position 0, and draw the first breakaway levels."""
    s.rotor = s.rotor_speed = s.link = s.link_speed = s.slid = 0.0
    s.current = s.late_current = s.human = s.integral_torque = s.counted = s.samples = 0.0
    s.rest, s.temperature, s.sliding = 1.0, p.thermal[1], 0
    s.arrived = 0
    for j in range(ELEMENTS):
        s.bristle[j] = 0.0
    for j in range(DELAYS):
        s.command[j] = 0.0
    draw_levels(p, s, random)
    s.level = 0.5 * (s.level_positive + s.level_negative)


@njit(cache=True)
def measure(p: Record, s: Record, random: np.ndarray, sample_time: float, out: Record) -> None:
    """Write the measured values of the state into the record `out`."""
    counted = s.rotor
    if p.resolution > 0.0:
        counted = math.floor(s.rotor / p.resolution + 0.5) * p.resolution
    out.position = counted
    out.velocity = (counted - s.counted) / sample_time
    s.counted = counted
    out.current = s.current
    if p.current_noise > 0.0:
        out.current += p.current_noise * normal(random)
    out.interaction_torque = s.human
    if p.torque_noise > 0.0:
        out.interaction_torque += p.torque_noise * normal(random)
    out.temperature = s.temperature


@njit(cache=True)
def joint_sample(p: Record, s: Record, random: np.ndarray, table: np.ndarray, memory: np.ndarray,
                 sample_time: float, command: float, reference_position: float,
                 reference_velocity: float, active: bool, out: Record) -> None:
    """Simulate one joint over one sample, and write the measured values at its end into `out`.

    `p`, `s` and `out` are records of JOINT, JOINT_STATE and MEASURED, `random`, `table` and
    `memory` the run's own. `command`, A, is constant over the sample. If `active`, the person holds
    the joint and sees the reference of the sample's beginning, rad and rad/s.
    """
    command = delayed_command(p, s, command)
    if p.kind == RIGID:
        move_rigid(p, s, random, table, memory, sample_time, command, reference_position,
                   reference_velocity, active)
    else:
        move_geared(p, s, random, table, memory, sample_time, command, reference_position,
                    reference_velocity, active)
    end_sample(p, s, random, sample_time, out)


@njit(cache=True)
def delayed_command(p: Record, s: Record, command: float) -> float:
    """Store a command in A, clipped to the limit; return the one of `p.delay` samples before."""
    for j in range(DELAYS - 1, 0, -1):
        s.command[j] = s.command[j - 1]
    s.command[0] = min(p.limit, max(-p.limit, command)) if math.isfinite(command) else 0.0
    return s.command[p.delay]


@njit(cache=True)
def end_sample(p: Record, s: Record, random: np.ndarray, sample_time: float, out: Record) -> None:
    """Update the motor temperature at the end of a sample, and measure."""
    s.temperature = warmed_up(s.temperature, s.current, sample_time, p.thermal)
    s.samples += 1.0
    measure(p, s, random, sample_time, out)


@njit(cache=True)
def bank_sample(p: np.ndarray, s: np.ndarray, random: np.ndarray, tables: np.ndarray,
                memories: np.ndarray, sample_time: float, command: np.ndarray,
                reference_position: np.ndarray, reference_velocity: np.ndarray,
                active: np.ndarray, out: np.ndarray) -> None:
    """Simulate all joints over one sample, a row each; nobody holds one without a reference."""
    for j in range(p.shape[0]):
        held = active[j] and math.isfinite(reference_position[j]) and math.isfinite(
            reference_velocity[j])
        joint_sample(p[j], s[j], random[j], tables[j], memories[j], sample_time, command[j],
                     reference_position[j], reference_velocity[j], held, out[j])


@dataclass(frozen=True)
class PlantState:
    """Measured values of a plant at one instant; arrays of shape (J,)."""

    time: float                     # s since the start
    position: np.ndarray            # rad, in whole encoder counts
    velocity: np.ndarray            # difference of successive positions, rad/s
    current: np.ndarray             # measured motor current, A
    interaction_torque: np.ndarray  # τ_b at sensor S2, N·m, positive: the person pushes forward
    temperature: np.ndarray         # of the motor, degrees Celsius


def random_states(seed: int | Sequence[int], runs: int) -> np.ndarray:
    """Return initial states of `runs` independent random sequences, shape (runs, 1) uint64."""
    return np.random.SeedSequence(seed).generate_state(runs, np.uint64).reshape(runs, 1)


class ReferenceHold:
    """Extrapolates the last reference with its velocity until the next one, or a timeout in s."""

    def __init__(self, timeout: float = 0.5) -> None:
        self.timeout = float(timeout)
        self._reference: tuple[float, np.ndarray, np.ndarray] | None = None

    def update(self, time: float, position: ArrayLike, velocity: ArrayLike) -> None:
        """Set a new reference: s, rad, rad/s; arrays of shape (J,)."""
        self._reference = (float(time), np.array(position, dtype=float),
                           np.array(velocity, dtype=float))

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray] | tuple[None, None]:
        """Return position and velocity of shape (J,) at a time in s, or None and None."""
        if self._reference is None or not time - self._reference[0] <= self.timeout:
            return None, None
        since, position, velocity = self._reference
        return position + velocity * (time - since), velocity


class Plant:
    """Simulated joints that are stepped one sample at a time; a seed gives the same numbers.

    Each joint has a model (see `joint_parameters`) and an `Undeclared` or None.
    """

    def __init__(self, models: Iterable[FrictionModel], seed: int | Sequence[int] = 0,
                 undeclared: Sequence[Undeclared | None] | None = None,
                 sample_time: float = 1e-3) -> None:
        models = list(models)
        if undeclared is None:
            undeclared = [None] * len(models)
        if not models or len(undeclared) != len(models):
            raise InputError('the plant needs one model and one undeclared file or None per joint')
        if not 0.0 < sample_time <= 0.01:
            raise InputError(f'sample_time must be in (0, 0.01] s, not {sample_time!r}')
        self.sample_time = float(sample_time)
        self.joints = len(models)
        extras = [Undeclared() if extra is None else extra for extra in undeclared]
        self._random = random_states(seed, self.joints)
        self._parameters = np.array(
            [joint_parameters(model, extra) for model, extra in zip(models, extras)])
        self._tables = np.full((self.joints, max(len(e.table) for e in extras), COLUMNS), -1.0)
        for table, extra in zip(self._tables, extras):
            table[:len(extra.table)] = extra.table
        self._memories = np.zeros((self.joints, max(1, max(e.memory_size for e in extras))))
        self._states = np.zeros(self.joints, JOINT_STATE)
        self._out = np.zeros(self.joints, MEASURED)
        # Views and constants that are created once: each would take as long as a step, about 1 µs.
        self._samples = self._states['samples']
        self._shown = self._out.view(float).reshape(self.joints, -1).T
        self._zeros, self._nobody = np.zeros(self.joints), np.zeros(self.joints, dtype=bool)
        self._everybody = ~self._nobody
        for p, s, random, out in zip(self._parameters, self._states, self._random, self._out):
            start_joint(p, s, random)
            measure(p, s, random, self.sample_time, out)
        # Compile the step, or load it from the cache, before the first call.
        none = np.zeros(0)
        bank_sample(self._parameters[:0], self._states[:0], self._random[:0], self._tables[:0],
                    self._memories[:0], self.sample_time, none, none, none, none.astype(bool),
                    self._out[:0])
        self.state = self._measured()

    def step(self, command: ArrayLike, reference_position: ArrayLike | None = None,
             reference_velocity: ArrayLike | None = None,
             human_active: ArrayLike | None = None) -> PlantState:
        """Apply a constant current over one sample and return the measured values at its end.

        All arrays have the shape (J,). Currents in A that are not finite count as 0, others are
        clipped to the limit. The person follows the reference, rad and rad/s at the present time,
        on the joints where `human_active`, by default all that have one.
        """
        if human_active is None:
            active = self._nobody if reference_position is None else self._everybody
        else:
            active = self._row(human_active, bool)
        position = self._zeros if reference_position is None else self._row(reference_position)
        velocity = self._zeros if reference_velocity is None else self._row(reference_velocity)
        self._advance(self._row(command), position, velocity, active)
        self.state = self._measured()
        return self.state

    def _advance(self, command: np.ndarray, position: np.ndarray, velocity: np.ndarray,
                 active: np.ndarray) -> None:
        """Simulate all joints over one sample; each array has shape (J,)."""
        bank_sample(
            self._parameters, self._states, self._random, self._tables, self._memories,
            self.sample_time, command, position, velocity, active, self._out)

    def _row(self, values: ArrayLike, kind: type = float) -> np.ndarray:
        # Broadcasting takes longer than a step: arrays with one value per joint do without it.
        row: np.ndarray = np.asarray(values, dtype=kind, order='C')
        if row.shape == (self.joints,):
            return row
        if row.ndim:
            raise InputError(f'expected {self.joints} values, one per joint, not shape {row.shape}')
        return np.full(self.joints, row)

    def _measured(self) -> PlantState:
        # `MEASURED` has the names and the order of `PlantState`'s arrays.
        return PlantState(float(self._samples[0]) * self.sample_time, *self._shown.copy())
