# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An arm whose links MuJoCo simulates, with the drives, sensors and person of `Plant`.

In each substep MuJoCo receives the sum of motor, person's and friction torque of each joint;
friction is that of `joint`.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from pathlib import Path
from typing import Any

from numba import njit
import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.simulation.joint import (
    clamped_friction,
    end_sample,
    follow_reference,
    friction_level,
    limited,
    low_pass_weight,
    move_bristle,
    Plant,
    SUBSTEPS,
)
from friction_comp.simulation.undeclared import Undeclared, undeclared_torque


class MujocoPlant(Plant):
    """Simulated joints on the links of an MJCF or URDF, stepped one sample at a time.

    The arm begins at the file's first keyframe, if any. `joints` are hinges or slides of the file,
    in the order of the models; others move freely. `simulation.inertia` is added to the armature.
    Other parameters are those of `Plant`. Raises InputError if MuJoCo is not installed, or the file
    cannot be used.
    """

    def __init__(self, file: str | Path, joints: Sequence[str], models: Sequence[FrictionModel],
                 seed: int | Sequence[int] = 0,
                 undeclared: Sequence[Undeclared | None] | None = None,
                 sample_time: float = 1e-3) -> None:
        try:
            import mujoco
        except ModuleNotFoundError:
            raise InputError('arm_file: MuJoCo is missing: pip install mujoco') from None
        if len(joints) != len(models):
            raise InputError(f'the arm needs one model per joint, not {len(models)} for '
                             f'{len(joints)} joints')
        if len(set(joints)) < len(joints):
            raise InputError(f'the joints of the arm must differ, not {", ".join(joints)}')
        self._step_of_engine, self._multiply = mujoco.mj_step, mujoco.mj_mulM
        self.body = _model(mujoco, file)
        self._position, self._velocity = np.array([
            _degree_of_freedom(mujoco, self.body, file, joint) for joint in joints]).T
        self.body.opt.timestep = sample_time / SUBSTEPS
        super().__init__(models, seed, undeclared, sample_time)
        self.body.dof_armature[self._velocity] += self._parameters['inertia']
        self.data = mujoco.MjData(self.body)
        # Update the constants that depend on the armature.
        mujoco.mj_setConst(self.body, self.data)
        if self.body.nkey:
            mujoco.mj_resetDataKeyframe(self.body, self.data, 0)
        mujoco.mj_forward(self.body, self.data)
        self._torque, self._inertia = np.zeros((2, self.joints))
        self._product, self._unit = np.zeros((2, self.body.nv))
        self._update_inertia()
        self._forces(self._zeros, 0, self._zeros, self._zeros, self._nobody)
        self._end_sample()
        # No sample has passed, and the encoder has not moved yet.
        self._samples[:] = self._out['velocity'] = 0.0
        self.state = self._measured()

    def _moving(self) -> tuple[np.ndarray, np.ndarray]:
        return self.data.qpos[self._position], self.data.qvel[self._velocity]

    def _advance(self, command: np.ndarray, position: np.ndarray, velocity: np.ndarray,
                 active: np.ndarray) -> None:
        """Simulate the arm over one sample; see `Plant.step`."""
        self._update_inertia()
        for k in range(SUBSTEPS):
            self._forces(command, k, position, velocity, active)
            self.data.qfrc_applied[self._velocity] = self._torque
            self._step_of_engine(self.body, self.data)
        self._end_sample()

    def _end_sample(self) -> None:
        _end_sample(self._parameters, self._states, self._random, self.sample_time,
                    *self._moving(), self._out)

    def _forces(self, command: np.ndarray, substep: int, position: np.ndarray,
                velocity: np.ndarray, active: np.ndarray) -> None:
        _torques(self._parameters, self._states, self._random, self._tables, self._memories,
                 self.sample_time, substep, command, position, velocity, active, *self._moving(),
                 self.data.qfrc_bias[self._velocity], self._inertia, self._torque)

    def _update_inertia(self) -> None:
        """Update the diagonal of the arm's joint-space inertia, kg·m², shape (J,)."""
        for j, own in enumerate(self._velocity):
            self._unit[:] = 0.0
            self._unit[own] = 1.0
            self._multiply(self.body, self.data, self._product, self._unit)
            self._inertia[j] = self._product[own]


def _model(mujoco: Any, file: str | Path) -> Any:
    if not Path(file).is_file():
        raise InputError(f'{file}: there is no such file')
    try:
        return mujoco.MjModel.from_xml_path(str(file))
    except ValueError as error:
        raise InputError(f'{file}: MuJoCo cannot read it: {error}') from None


def _degree_of_freedom(mujoco: Any, body: Any, file: str | Path, joint: str) -> tuple[int, int]:
    """Return the indices of a joint's position and velocity in MuJoCo's state."""
    index = mujoco.mj_name2id(body, mujoco.mjtObj.mjOBJ_JOINT, joint)
    if index < 0:
        names = [mujoco.mj_id2name(body, mujoco.mjtObj.mjOBJ_JOINT, k) for k in range(body.njnt)]
        raise InputError(f'{file}: has no joint {joint!r}; it has {", ".join(map(str, names))}')
    kinds = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
    if int(body.jnt_type[index]) not in map(int, kinds):
        raise InputError(f'{file}: joint {joint!r} is neither a hinge nor a slide')
    return int(body.jnt_qposadr[index]), int(body.jnt_dofadr[index])


@njit(cache=True)
def _torques(parameters: np.ndarray, states: np.ndarray, randoms: np.ndarray, tables: np.ndarray,
             memories: np.ndarray, sample_time: float, substep: int, command: np.ndarray,
             reference_position: np.ndarray, reference_velocity: np.ndarray, active: np.ndarray,
             position: np.ndarray, velocity: np.ndarray, bias: np.ndarray, inertia: np.ndarray,
             torque: np.ndarray) -> None:
    """Write the torques of motors, persons and friction at the beginning of a substep, N·m.

    `bias` is each joint's torque due to weight and velocities, `inertia` its entry on the diagonal
    of the arm's: with both, the bristle is integrated implicitly as in `joint`.
    """
    h = sample_time / SUBSTEPS
    for j in range(parameters.shape[0]):
        p, s = parameters[j], states[j]
        x, v = position[j], velocity[j]
        if substep == 0:
            s.current = limited(p, command[j])
        s.late_current += (s.current - s.late_current) * low_pass_weight(h, p.actuation_lag)
        follow_reference(
            p, s, h, low_pass_weight(h, p.human_response),
            active[j] and math.isfinite(reference_position[j] + reference_velocity[j]),
            reference_position[j] + reference_velocity[j] * substep * h, reference_velocity[j], x,
            v)
        driving, extra = p.torque_per_current * s.late_current + s.human, 0.0
        sigma0, sigma1 = p.bristle_stiffness, p.bristle_damping
        if tables[j].shape[0] > 0 and tables[j][0, 0] >= 0.0:
            base = friction_level(p, s, abs(v), sigma0 * s.bristle + sigma1 * v > 0.0)
            load, extra = undeclared_torque(
                tables[j], memories[j], s.samples * sample_time + substep * h, x, v, s.human,
                s.temperature, s.rest, base)
            driving += load
        stuck = (v + h / inertia[j] * (driving - bias[j] - sigma0 * s.bristle)) / (
            1.0 + h / inertia[j] * (sigma1 + h * sigma0))
        friction, slips = clamped_friction(p, s, stuck, extra, abs(v), h)
        move_bristle(p, s, randoms[j], v if slips else stuck, friction, slips, h)
        torque[j] = driving - friction


@njit(cache=True)
def _end_sample(parameters: np.ndarray, states: np.ndarray, randoms: np.ndarray,
                sample_time: float, position: np.ndarray, velocity: np.ndarray, out: np.ndarray
                ) -> None:
    for j in range(parameters.shape[0]):
        p, s = parameters[j], states[j]
        s.position, s.velocity = position[j], velocity[j]
        end_sample(p, s, randoms[j], sample_time, out[j])
