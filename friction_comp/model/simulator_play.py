# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Plays a recorded motion with a joint of MuJoCo that has a model's numbers.

The joint gets the recorded torque, without that of the links, and a weak controller holds it near
the recorded position, since the smallest error of a torque would integrate to any distance. How far
it strays tells what the joint lacks; a joint without friction is the yardstick.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
import math
from typing import Any

import numpy as np

from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.simulator_joint import joint_friction_only, SimulatorJoint
from friction_comp.model.sliding_friction import Sliding
from friction_comp.samples import Samples
from friction_comp.statistics import rms

# Natural frequency of the controller, Hz: higher ones hide what lacks, lower ones let noise wander.
_HOLD = 2.0
# Longest step of the simulation, s, and longest motion that is played, s.
_STEP, _LONGEST = 1e-3, 60.0
# Frequency of a swing without a recording, Hz, and their number.
_SWING, _SWINGS = 0.5, 5


@dataclass(frozen=True)
class Played:
    """How far a simulated joint strays from a recording."""

    error: float            # RMS of position, rad
    share: float            # of the RMS of the recorded position about its mean
    frictionless: float     # RMS of position of a joint without friction, rad


def attributes(joint: SimulatorJoint, with_inertia: bool = True) -> str:
    """Return the attributes of a joint in MJCF."""
    inertia = f' armature="{joint.inertia:.9g}"' if with_inertia and joint.inertia else ''
    spring = (f' stiffness="{joint.stiffness:.9g}" springref="{joint.rest:.9g}"'
              if joint.stiffness else '')
    return f'frictionloss="{joint.coulomb:.9g}" damping="{joint.viscous:.9g}"{inertia}{spring}'


def play(joint: SimulatorJoint, motion: Samples, torque: np.ndarray) -> Played | None:
    """Play a motion with the torque of its motor, N·m, (N,); None without MuJoCo or an inertia."""
    try:
        import mujoco
    except ModuleNotFoundError:
        return None
    if not joint.inertia or joint.inertia <= 0.0 or len(motion) < 10:
        return None
    bare = replace(joint, coulomb=0.0, viscous=0.0)
    strayed = [_stray(mujoco, one, motion, torque) for one in (joint.passive(), bare.passive())]
    moved = np.concatenate([motion.position[part] for part in _parts(motion)])
    size = float(np.std(moved))
    if not size or not all(map(len, strayed)):
        return None
    error, frictionless = map(rms, strayed)
    return Played(error, error / size, frictionless)


def swing(model: FrictionModel) -> tuple[Samples, np.ndarray]:
    """Return a swing up to the model's largest speed, and the joint's own torque, N·m, (N,)."""
    kept, _ = joint_friction_only(model)
    inertia = [effect for effect in model.effects if effect.name in ('inertia', 'spring')]
    speed, turning = max(Sliding.of(model).speeds), 2.0 * math.pi * _SWING
    time = np.arange(0.0, _SWINGS / _SWING, 2.0 * _STEP)
    motion = Samples(
        time=time, position=-speed / turning * np.cos(turning * time),
        velocity=speed * np.sin(turning * time),
        acceleration=speed * turning * np.cos(turning * time), current=np.zeros(len(time)))
    current = replace(kept, effects=[*kept.effects, *inertia]).current(motion)
    return motion, (model.torque_per(model.unit) or 1.0) * current


def _parts(motion: Samples) -> list[slice]:
    parts, left = [], _LONGEST
    for part in motion.segments():
        time = motion.time[part]
        count = int(np.searchsorted(time, time[0] + left))
        if count >= 10:
            parts.append(slice(part.start, part.start + count))
            left -= float(time[count - 1] - time[0])
        if left <= 0.0:
            break
    return parts


def _stray(mujoco: Any, joint: SimulatorJoint, motion: Samples, torque: np.ndarray) -> np.ndarray:
    """Return the distance of the simulated from the recorded joint at every step, rad."""
    step = motion.sample_time / max(1, math.ceil(motion.sample_time / _STEP))
    # A tiny mass, since MuJoCo wants one beside the armature.
    body = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option gravity="0 0 0" timestep="{step:.9g}" '
        f'integrator="implicitfast"/><worldbody><body><joint name="joint" axis="0 0 1" '
        f'{attributes(joint)}/><geom size="0.01" mass="1e-9"/></body></worldbody></mujoco>')
    data, strayed = mujoco.MjData(body), []
    frequency = 2.0 * math.pi * _HOLD
    stiffness = float(joint.inertia or 0.0) * frequency ** 2
    damping = 2.0 * float(joint.inertia or 0.0) * frequency
    for part in _parts(motion):
        time = np.arange(motion.time[part][0], motion.time[part][-1], step)
        position, velocity, applied = (np.interp(time, motion.time[part], values[part]) for values
                                       in (motion.position, np.asarray(motion.velocity), torque))
        mujoco.mj_resetData(body, data)
        data.qpos[0], data.qvel[0] = position[0], velocity[0]
        off = np.empty(len(time))
        for k, (q, v, u) in enumerate(zip(position.tolist(), velocity.tolist(), applied.tolist())):
            off[k] = data.qpos[0] - q
            data.qfrc_applied[0] = u + stiffness * (q - data.qpos[0]) + damping * (v - data.qvel[0])
            mujoco.mj_step(body, data)
        strayed.append(off)
    return np.concatenate(strayed) if strayed else np.empty(0)
