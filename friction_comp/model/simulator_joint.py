# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A model's friction in the form of simulators: Coulomb, viscous, inertia and spring.

The simpler form is fitted to the torque that the model predicts for sweeps at constant speeds over
the joint's range in both directions; its error there is part of the result. Effects of the links
(weight, the rest of the arm), and those that depend on signals that a simulator's joint does not
have (load, temperature, time), are left out and listed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
import math

import numpy as np
from scipy.optimize import nnls

from friction_comp.checks import check_number
from friction_comp.model.friction_model import FrictionModel
from friction_comp.samples import Samples

# rad/s, if the model does not give its largest measured speed.
_TOP_SPEED = 1.0
# Sweeps have these shares of the top speed; a joint that hardly moves does not show a plateau.
_SPEEDS = np.geomspace(0.02, 1.0, 12)
_POINTS = 720
_LINKS = ('gravity', 'rigid_body', 'other_joints', 'load_torque')
_OWN_ELEMENTS = ('inertia', 'spring')


@dataclass(frozen=True)
class SimulatorJoint:
    """Parameters of a simulator's joint."""

    friction: float         # Coulomb friction, N·m
    damping: float          # viscous friction, N·m·s/rad
    inertia: float          # of the drive at the joint, kg·m²
    stiffness: float        # of a spring, N·m/rad
    rest: float             # its rest position, rad
    error: float            # RMS error of the simplified form, N·m
    relative_error: float   # the same as a share of the model's torque
    top_speed: float        # up to which the form was fitted, rad/s
    left_out: list[str]     # effects that are left out, with the reason


def simulator_joint(model: FrictionModel, top_speed: float | None = None) -> SimulatorJoint:
    """Return the parameters of a simulator's joint that fit a model best.

    The top speed is in rad/s; the largest of the model's look-up table when omitted, else 1.
    """
    top_speed = top_speed or model.largest_speed(_TOP_SPEED)
    gain = model.drive.torque_per_current
    kept, left_out = joint_friction_only(model)
    motion, late = sweeps(model, top_speed)
    torque = gain * kept.current(motion)[late]
    speed = np.asarray(motion.velocity)[late]
    (friction, damping), _ = nnls(np.column_stack((np.sign(speed), speed)), torque)
    residual = torque - friction * np.sign(speed) - damping * speed
    inertias = [gain * effect.coefficients[0] for effect in model.effects
                if effect.name == 'inertia']
    inertia = float(sum(inertias) if inertias else model.simulation.get('inertia', 0.0))
    springs = [effect for effect in model.effects if effect.name == 'spring']
    stiffness = gain * sum(effect.coefficients[0] for effect in springs)
    rest = springs[0].values['position'] if springs else 0.0
    error = math.sqrt(float(np.mean(residual ** 2)))
    rms_torque = math.sqrt(float(np.mean(torque ** 2)))
    return SimulatorJoint(float(friction), float(damping), inertia, stiffness, rest, error,
                          error / rms_torque if rms_torque else 0.0, top_speed, left_out)


def joint_friction_only(model: FrictionModel, known: tuple[str, ...] = ('acceleration',)
                        ) -> tuple[FrictionModel, list[str]]:
    """Return the model with the friction that depends on known signals, and what is left out."""
    kept, left_out = [], []
    for effect in model.effects:
        unknown = [name for name in effect.needs if name not in known]
        if effect.name in _LINKS:
            left_out.append(f'{effect.name}: belongs to the links and what they touch')
        elif effect.name in _OWN_ELEMENTS:
            continue
        elif unknown or not effect.holds_on_another_day:
            left_out.append(f'{effect.name}: depends on {unknown[0] if unknown else "time"}')
        else:
            kept.append(effect)
    return replace(model, effects=kept, arm=None), left_out


def sweeps(model: FrictionModel, top_speed: float) -> tuple[Samples, np.ndarray]:
    """Return sweeps at constant speeds over the joint's range, or a turn, in both directions.

    Also return which samples are after the first tenth of their sweep, where presliding is over.
    """
    check_number(top_speed, 'the top speed', above=0.0)
    low, high = model.position_limits or (-math.pi, math.pi)
    path = np.linspace(low, high, _POINTS)
    parts = []
    for speed in _SPEEDS * top_speed:
        for sign in (1.0, -1.0):
            zero = np.zeros(_POINTS)
            parts.append(Samples(
                time=(path - low) / speed, position=path if sign > 0 else path[::-1],
                current=zero, velocity=np.full(_POINTS, sign * speed), acceleration=zero))
    late = np.tile(np.arange(_POINTS) >= _POINTS // 10, len(parts))
    return Samples.concatenate(parts), late


def friction_table(model: FrictionModel, loads: np.ndarray, top_speed: float | None = None
                   ) -> tuple[list[str], np.ndarray]:
    """Return friction torque over speed, position and load, without weight and inertia.

    Names of the columns (velocity, position, load, torque), and the rows, shape (N, 4). Loads,
    shape (L,), N·m, are used where friction depends on the load.
    """
    kept, _ = joint_friction_only(model, ('acceleration', 'load'))
    motion, late = sweeps(model, top_speed or model.largest_speed(_TOP_SPEED))
    if not any('load' in effect.needs for effect in kept.effects):
        loads = np.zeros(1)
    shown = late & (np.arange(len(motion)) % 8 == 0)
    rows = []
    for load in loads:
        torque = model.drive.torque_per_current * kept.current(
            motion.with_(load=np.full(len(motion), load)))
        rows.append(np.column_stack((
            np.asarray(motion.velocity), motion.position, np.full(len(motion), load),
            torque))[shown])
    return (['velocity (rad/s)', 'position (rad)', 'load (N·m)', 'torque (N·m)'],
            np.concatenate(rows))
