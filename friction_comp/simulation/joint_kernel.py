# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The simulated joint: one compiled function that advances it by one sample.

The plant node, the plain loop and the thousands of parallel runs of `reproduce` all call
`joint_sample`; there is no second model of the joint. How it moves is in `rigid_joint` and
`geared_joint`.
"""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from friction_comp.simulation.friction_level import draw_levels
from friction_comp.simulation.geared_joint import move_geared
from friction_comp.simulation.joint_records import DELAYS, ELEMENTS, Record, RIGID
from friction_comp.simulation.random_sequence import normal
from friction_comp.simulation.rigid_joint import move_rigid
from friction_comp.simulation.undeclared import warmed_up


@njit(cache=True)
def start_joint(p: Record, s: Record, random: np.ndarray) -> None:
    """Set the state of a joint at rest at position 0 and draw its first breakaway levels."""
    s.rotor = s.rotor_speed = s.link = s.link_speed = s.slid = 0.0
    s.current = s.late_current = s.human = s.pushed_on = s.counted = s.samples = 0.0
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
    """Write what the sensors show of the state into the record `out`."""
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
    """Take one joint through one sample and measure it at the end.

    Parameters
    ----------
    p, s : records of JOINT and JOINT_STATE
        The state is changed in place.
    random : ndarray of uint64, shape (1,)
        The run's own random sequence.
    table, memory : ndarray
        Undeclared effects; rows of code -1 do nothing.
    sample_time : float
        s.
    command : float
        Current in A held over the sample, whole samples late by the joint's delay; clipped to the
        limit, 0 where it is not finite.
    reference_position, reference_velocity : float
        What the person sees at the beginning of the sample, rad and rad/s.
    active : bool
        Whether the person holds the joint at all.
    out : record of MEASURED
        Written in place.
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
    """Take a command in A and return the limited one that is due, whole samples late."""
    for j in range(DELAYS - 1, 0, -1):
        s.command[j] = s.command[j - 1]
    s.command[0] = min(p.limit, max(-p.limit, command)) if math.isfinite(command) else 0.0
    return s.command[p.delay]


@njit(cache=True)
def end_sample(p: Record, s: Record, random: np.ndarray, sample_time: float, out: Record) -> None:
    """Warm the motor up over a sample, and measure."""
    s.temperature = warmed_up(s.temperature, s.current, sample_time, p.thermal)
    s.samples += 1.0
    measure(p, s, random, sample_time, out)


@njit(cache=True)
def bank_sample(p: np.ndarray, s: np.ndarray, random: np.ndarray, tables: np.ndarray,
                memories: np.ndarray, sample_time: float, command: np.ndarray,
                reference_position: np.ndarray, reference_velocity: np.ndarray,
                active: np.ndarray, out: np.ndarray) -> None:
    """Take every joint of a bank through one sample; rows are joints.

    Nobody holds a joint for which there is no finite reference.
    """
    for j in range(p.shape[0]):
        held = active[j] and math.isfinite(reference_position[j]) and math.isfinite(
            reference_velocity[j])
        joint_sample(p[j], s[j], random[j], tables[j], memories[j], sample_time, command[j],
                     reference_position[j], reference_velocity[j], held, out[j])


@njit(cache=True)
def start_bank(p: np.ndarray, s: np.ndarray, random: np.ndarray, sample_time: float,
               out: np.ndarray) -> None:
    """Start and measure every joint of a bank."""
    for j in range(p.shape[0]):
        start_joint(p[j], s[j], random[j])
        measure(p[j], s[j], random[j], sample_time, out[j])
