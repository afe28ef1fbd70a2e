# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Random chains of links with friction in their joints; Pinocchio computes their dynamics."""

from dataclasses import dataclass, field

import numpy as np
import pinocchio
from scipy.spatial.transform import Rotation

X, Y, Z = np.eye(3)
STANDSTILL = 1e-9  # rad/s


def rms(values):
    """Return the root mean square, 0 of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0


def log_uniform(generator, low, high):
    """Return a number between two others, any of its orders of magnitude as likely."""
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


@dataclass
class Friction:
    """Friction of n joints, each attribute of shape (n,).

    `coulomb`: N·m. `viscous`: N·m·s/rad. `stribeck`: what breakaway asks beyond Coulomb friction,
    N·m. `stribeck_speed`: speed over which that fades, rad/s. `reversal_speed`: speed over which
    friction changes its sign, rad/s.
    """

    coulomb: np.ndarray
    viscous: np.ndarray
    stribeck: np.ndarray
    stribeck_speed: np.ndarray
    reversal_speed: np.ndarray

    @classmethod
    def draw(cls, generator, speed):
        """Draw friction whose Coulomb and viscous parts together are 1 N·m at a speed.

        `speed`: ndarray, shape (n,); how fast each joint moves, rad/s.
        """
        n = len(speed)
        coulomb = generator.uniform(0.4, 0.95, n)
        present = generator.random(n) < 0.4
        return cls(coulomb, (1 - coulomb) / speed,
                   present * coulomb * generator.uniform(0.2, 1.0, n),
                   speed * generator.uniform(0.05, 0.2, n),
                   speed * generator.uniform(0.003, 0.01, n))

    def scale(self, factor):
        """Multiply all torques by a factor, a number or shape (n,)."""
        self.coulomb = self.coulomb * factor
        self.viscous = self.viscous * factor
        self.stribeck = self.stribeck * factor

    def torque(self, velocity, rest_share=None):
        """Return the friction of all joints.

        `velocity`: ndarray, shape (..., n); rad/s. `rest_share`: ndarray, shape (..., n),
        optional; share of Coulomb friction, with its sign, that acts where a joint stands.
        Returns N·m of shape (..., n).
        """
        sign = np.tanh(velocity / self.reversal_speed)
        moving = self.coulomb * sign + self.viscous * velocity + (
            self.stribeck * np.exp(-(velocity / self.stribeck_speed) ** 2) * sign)
        if rest_share is None:
            return moving
        return np.where(np.abs(velocity) < STANDSTILL, rest_share * self.coulomb, moving)


@dataclass
class Arm:
    """A chain with n joints.

    `model`: the links, without what the rotors add. `rotor_inertia`: ndarray, shape (n,); what
    each rotor adds at the joint's side, kg·m².
    """

    model: pinocchio.Model
    rotor_inertia: np.ndarray = None
    friction: Friction = None
    _data: pinocchio.Data = field(init=False, repr=False)

    def __post_init__(self):
        self._data = self.model.createData()

    def link_torque(self, position, velocity, acceleration):
        """Return what the links ask of all joints by inverse dynamics, N·m.

        Each argument and the result has shape (N, n); rad, rad/s and rad/s².
        """
        return np.array([pinocchio.rnea(self.model, self._data, *state).copy()
                         for state in zip(position, velocity, acceleration)])

    def rigid_torque(self, position, velocity, acceleration):
        """Return what links and rotors ask of all joints, N·m, of shapes as in `link_torque`."""
        return (self.link_torque(position, velocity, acceleration)
                + self.rotor_inertia * acceleration)

    def gravity_torque(self, position):
        """Return what gravity asks of all joints, N·m; position and result of shape (N, n)."""
        return np.array([pinocchio.computeGeneralizedGravity(self.model, self._data, q).copy()
                         for q in position])

    def own_inertia(self, position):
        """Return each joint's own inertia in a posture without its rotor, kg·m², shape (n,)."""
        return np.diag(pinocchio.crba(self.model, self._data, position)).copy()

    def potential_energy(self, position):
        """Return the potential energy in a posture of shape (n,), J."""
        return pinocchio.computePotentialEnergy(self.model, self._data, position)

    def forward_dynamics(self):
        """Return a function from position, velocity and torque, each (n,), to acceleration.

        The torque is that of the motors, friction is taken off it; N·m, rad/s².
        """
        # A model of its own: whether inverse dynamics count the armature depends on the release.
        model = self.model.copy()
        model.armature = self.rotor_inertia
        data = model.createData()

        def acceleration(position, velocity, torque):
            return pinocchio.aba(model, data, position, velocity,
                                 torque - self.friction.torque(velocity)).copy()

        return acceleration


def _axes(generator, joints, style):
    if style == 'planar':
        return [Y] * joints
    if style == 'alternating':
        return ([Z, Y, Y, Z, Y, Z] if generator.random() < 0.5 else [Z, Y, Y, Y, Z, Y])[:joints]
    drawn = [generator.normal(size=3) for _ in range(joints)]
    return [axis / np.linalg.norm(axis) for axis in drawn]


def _joint_about(axis):
    for known, kind in ((X, pinocchio.JointModelRX), (Y, pinocchio.JointModelRY),
                        (Z, pinocchio.JointModelRZ)):
        if np.array_equal(axis, known):
            return kind()
    return pinocchio.JointModelRevoluteUnaligned(axis)


def draw_chain(generator, joints, style, base):
    """Draw a chain of ellipsoids, lighter towards its end.

    `joints`: at most 6. `style`: {'planar', 'alternating', 'random'}; axes all parallel, upright
    and across by turns, or in any direction. `base`: {'upright', 'wall', 'ceiling'}; what the arm
    is fixed to. Joints are called joint1, joint2 and so on.
    """
    model = pinocchio.Model()
    axes = _axes(generator, joints, style)
    length = generator.uniform(0.1, 0.5, joints)
    first_mass = log_uniform(generator, 0.5, 8)
    fall = generator.uniform(0.45, 0.9)
    parent = 0
    for k in range(joints):
        offset = np.zeros(3)
        if k > 0:
            sideways = generator.uniform(-0.08, 0.08, 3) * (generator.random() < 0.5)
            offset = np.array([0, 0, length[k - 1]]) + (0 if style == 'planar' else 1) * sideways
        parent = model.addJoint(parent, _joint_about(axes[k]),
                                pinocchio.SE3(np.eye(3), offset), f'joint{k + 1}')
        mass = first_mass * fall ** k * generator.uniform(0.7, 1.3)
        half_axes = length[k] * np.array([generator.uniform(0.15, 0.4),
                                          generator.uniform(0.15, 0.4),
                                          generator.uniform(0.3, 0.6)])
        ellipsoid = pinocchio.Inertia.FromEllipsoid(mass, *half_axes)
        turn = Rotation.from_rotvec(generator.normal(size=3) * 0.4).as_matrix()
        lever = np.array([0, 0, length[k] * generator.uniform(0.3, 0.7)])
        lever = lever + generator.uniform(-0.12, 0.12, 3) * length[k]
        model.appendBodyToJoint(
            parent, pinocchio.Inertia(mass, lever, turn @ ellipsoid.inertia @ turn.T),
            pinocchio.SE3.Identity())
    gravity = np.array([0, 0, -9.81])
    if base == 'ceiling':
        gravity = -gravity
    if base == 'wall':
        across = Y if style == 'planar' else X
        gravity = Rotation.from_rotvec(across * np.pi / 2).apply(gravity)
    model.gravity.linear = gravity
    return model
