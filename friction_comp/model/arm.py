# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The other joints in a model: rigid bodies of a URDF, or terms found without one.

A `Tree` has the links' parameters, as `friction_comp.arm` fits them. Without a URDF, a `Coupling`
is a sum of terms: each group is the torque of one energy on the joint, by Lagrange's equations. A
potential energy is a harmonic of a sum of angles, a kinetic energy such a harmonic times two
velocities. Friction acts where a motor turns with the sum or the difference of two joints, as in a
wrist. Programs that run with a robot need only this, neither a URDF nor Pinocchio.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import functools
from itertools import combinations
from typing import Any

import numpy as np

from friction_comp.errors import InputError, listed, mapping, number
from friction_comp.model.differentiation import differentiate, settings_of
from friction_comp.samples import Samples

# Numbers of each link: see `Tree`.
PARAMETERS = 10
FREE_FALL = (0.0, 0.0, -9.81)
# What a file says of each link.
_OF_LINK = ('joint', 'kind', 'parent', 'rotation', 'place', 'axis', 'inertial_parameters')
# Rotation matrices in a file are rounded, by less than this in any product.
_ROUNDED = 1e-6


@dataclass(frozen=True)
class Tree:
    """L joints, each carried by an earlier one, with its link; InputError if they are no tree."""

    joints: tuple[str, ...]     # names, as recordings have them
    kinds: tuple[str, ...]      # 'revolute' or 'prismatic'
    parents: np.ndarray         # (L,), index of the joint each is carried by; -1 for the base
    # Frame of each joint at position zero in the frame of its parent, m.
    rotations: np.ndarray       # (L, 3, 3)
    places: np.ndarray          # (L, 3)
    axes: np.ndarray            # (L, 3), unit vectors in the joints' own frames
    # (L, 10), of each link, in the frame of its joint: mass kg, first moment kg·m (three), and the
    # entries Ixx, Ixy, Iyy, Ixz, Iyz, Izz of the inertia about the frame's origin, kg·m².
    parameters: np.ndarray
    gravity: np.ndarray         # (3,), of free fall in the frame of the base, m/s²
    signal = 'rigid_body'

    def __post_init__(self) -> None:
        size = len(self.joints)
        for name, shape in {'rotations': (size, 3, 3), 'places': (size, 3), 'axes': (size, 3),
                            'parameters': (size, PARAMETERS), 'gravity': (3,)}.items():
            value = np.ascontiguousarray(getattr(self, name), dtype=float)
            if value.shape != shape or not np.isfinite(value).all():
                raise InputError(f'arm.{name} must be finite numbers of shape {shape}')
            object.__setattr__(self, name, value)
        parents = np.ascontiguousarray(self.parents, dtype=np.int64)
        object.__setattr__(self, 'parents', parents)
        turned = self.rotations @ self.rotations.transpose(0, 2, 1)
        if not (size > 0 and len(set(self.joints)) == size == len(self.kinds)
                and set(self.kinds) <= {'revolute', 'prismatic'}
                and parents.shape == (size,) and (parents < np.arange(size)).all()
                and (parents >= -1).all()):
            raise InputError('arm: links must be revolute or prismatic joints of different names, '
                             'each carried by an earlier one or the base')
        if (np.abs(turned - np.eye(3)).max() > _ROUNDED or (np.linalg.det(self.rotations) < 0).any()
                or np.abs(np.linalg.norm(self.axes, axis=1) - 1.0).max() > _ROUNDED):
            raise InputError('arm: rotations must be rotation matrices, and axes unit vectors')

    @property
    def prismatic(self) -> np.ndarray:
        """Which joints are prismatic, shape (L,)."""
        return np.array([kind == 'prismatic' for kind in self.kinds])

    def torques(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the torque of each joint without friction and rotors, N·m or N, (N, L).

        Position, velocity and acceleration have the same shape; rad or m, and s.
        """
        from friction_comp.model.compiled import joint_torques

        q, v, a = (np.ascontiguousarray(values, dtype=float) for values in (q, v, a))
        result = np.empty(q.shape)
        joint_torques(self.parents, self.prismatic, self.rotations, self.places, self.axes,
                      self.parameters, self.gravity, q, v, a, result)
        return result

    def on(self, joint: str, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the torque of one joint, (N,), see `torques`; InputError if there is none."""
        if joint not in self.joints:
            raise InputError(f'joint {joint!r} is not part of the arm: '
                             f'{", ".join(map(repr, self.joints))}')
        return self.torques(q, v, a)[:, self.joints.index(joint)]

    def weight(self, position: np.ndarray) -> np.ndarray:
        """Return the torque that holds the arm at rest, shape (L,), at a position of shape (L,)."""
        postures = np.asarray(position, dtype=float)[None]
        return self.torques(postures, 0.0 * postures, 0.0 * postures)[0]

    def to_dict(self) -> dict[str, Any]:
        """Return the tree as the plain values of a model file."""
        parents = [self.joints[k] if k >= 0 else None for k in self.parents]
        columns = (self.joints, self.kinds, parents, *(getattr(self, name).tolist() for name in (
            'rotations', 'places', 'axes', 'parameters')))
        return {'gravity': self.gravity.tolist(),
                'links': [dict(zip(_OF_LINK, values)) for values in zip(*columns)]}

    @classmethod
    def from_dict(cls, document: Any) -> Tree:
        """Make a tree of the plain values of a model file."""
        try:
            joints, kinds, parents, *values = zip(*([link[name] for name in _OF_LINK]
                                                    for link in document['links']))
            parent = np.array([-1 if one is None else joints.index(one) for one in parents])
            arrays = [np.array(one, dtype=float) for one in (*values, document['gravity'])]
            return cls(tuple(map(str, joints)), tuple(map(str, kinds)), parent, *arrays)
        except InputError:
            raise
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise InputError(f'arm: not the links of an arm: {error}') from None


# Number of joints that each kind of group names besides those of its angles.
_JOINTS = {'weight': 0, 'kinetic': 3, 'friction': 0}


@dataclass(frozen=True)
class Group:
    """Terms that belong together.

    Of kind 'weight': cosine and sine of a sum of angles; 'kinetic': the torque of a kinetic energy
    of two velocities, alone or times cosine and sine; 'friction': Coulomb and viscous friction of
    the rate of the sum of two angles.
    """

    kind: str
    angles: tuple[tuple[str, int], ...] = ()    # joint and sign of each angle in the sum
    # Of kind 'kinetic': the joint on which the torque acts, and the two joints of the velocities.
    joints: tuple[str, ...] = ()
    # Of kind 'friction': the velocity over which it changes sign, rad/s.
    width: float = 0.0

    def columns(self, names: Sequence[str], q: np.ndarray, v: np.ndarray,
                a: np.ndarray) -> np.ndarray:
        """Return the terms, shape (N, 1) or (N, 2), for motion of J named joints, (N, J)."""
        column = {name: k for k, name in enumerate(names)}
        factor, slope = np.ones(len(q)), np.zeros(len(q))
        if self.kind == 'friction':
            rate = sum((side * v[:, column[name]] for name, side in self.angles), np.zeros(len(v)))
            return np.column_stack((np.tanh(rate / self.width), rate))
        if self.kind == 'kinetic':
            factor, slope = self._kinetic_factors(column, v, a)
        if not self.angles:
            return factor[:, None]
        total = sum(side * q[:, column[name]] for name, side in self.angles)
        cosine, sine = np.cos(total), np.sin(total)
        return np.column_stack((factor * cosine - slope * sine, factor * sine + slope * cosine))

    def _kinetic_factors(self, column: dict[str, int], v: np.ndarray, a: np.ndarray
                         ) -> tuple[np.ndarray, np.ndarray]:
        """Return the factors of f and f' in the torque of the energy f(angles)·v_one·v_two."""
        own, one, two = (column[name] for name in self.joints)
        turning = sum((side * v[:, column[name]] for name, side in self.angles), np.zeros(len(v)))
        momentum = (own == one) * v[:, two] + (own == two) * v[:, one]
        of_own = dict(self.angles).get(self.joints[0], 0)
        return ((own == one) * a[:, two] + (own == two) * a[:, one],
                turning * momentum - of_own * v[:, one] * v[:, two])

    @property
    def all_joints(self) -> set[str]:
        """Names of all joints in the group, of angles and of velocities."""
        return {name for name, _ in self.angles} | set(self.joints)

    def describe(self) -> str:
        """Return a description of the group."""
        total = ' '.join(('+' if side > 0 else '-') + name for name, side in self.angles)
        over = f' over the angle {total.removeprefix("+")}' if total else ''
        if self.kind == 'weight':
            return f'weight{over}'
        if self.kind == 'friction':
            (own, _), (other, side) = self.angles
            return (f'friction between {own} and {other}, which turns with the '
                    f'{"sum" if side > 0 else "difference"} of their velocities')
        if self.joints[0] in self.joints[1:]:
            return f'inertia of {" with ".join(dict.fromkeys(self.joints[1:]))}{over}'
        return f'velocities of {" and ".join(dict.fromkeys(self.joints[-2:]))}{over}'


@dataclass(frozen=True)
class Coupling:
    """A joint's current due to other joints, found without a URDF; coefficients in A per term."""

    signal = 'coupling'

    groups: tuple[Group, ...]
    coefficients: tuple[tuple[float, ...], ...]

    def on(self, joint: str, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the current in A, shape (N,), for motion of `joints`, (N, J); at rest a weight."""
        moves = bool(v.any() or a.any())
        return np.asarray(sum(
            (group.columns(self.joints, q, v, a) @ np.asarray(coefficients)
             for group, coefficients in zip(self.groups, self.coefficients)
             if moves or group.kind == 'weight'), np.zeros(len(q))))

    @property
    def joints(self) -> list[str]:
        """Names of the joints that matter, in order of appearance."""
        return list(dict.fromkeys(
            name for group in self.groups for name in sorted(group.all_joints)))

    def to_dict(self) -> dict[str, Any]:
        """Return the coupling as the plain values of a model file."""
        return {'groups': [
            {'kind': group.kind, 'angles': [[name, side] for name, side in group.angles],
             'joints': list(group.joints), 'coefficients': list(coefficients),
             **({'width': group.width} if group.width else {})}
            for group, coefficients in zip(self.groups, self.coefficients)]}

    @classmethod
    def from_dict(cls, document: Any) -> Coupling:
        """Make a coupling of the plain values of a model file."""
        found = listed(_group)(document['groups'], 'arm.groups')
        return cls(tuple(Group(one['kind'], one['angles'], one.get('joints') or (),
                               one.get('width') or 0.0) for one in found),
                   tuple(one['coefficients'] for one in found))


def _angle(value: Any, name: str) -> tuple[str, int]:
    if not isinstance(value, (list, tuple)) or len(value) != 2 or value[1] not in (1, -1):
        raise InputError(f'{name} must be a joint and its sign, 1 or -1, not {value!r}')
    return str(value[0]), int(value[1])


_ENTRIES = {'kind': lambda value, _: str(value), 'angles': listed(_angle),
            'joints': listed(lambda value, _: str(value)), 'width': number(above=0.0),
            'coefficients': listed(number())}


def _group(value: Any, name: str) -> dict[str, Any]:
    one = mapping(_ENTRIES)(value, name)
    angles, kind = one.get('angles') or (), one.get('kind')
    if (kind not in _JOINTS or len(one.get('joints') or ()) != _JOINTS[kind]
            or len(one.get('coefficients') or ()) != (2 if angles else 1)
            or len(dict(angles)) < len(angles)
            or (kind == 'friction') != bool(len(angles) == 2 and one.get('width'))):
        raise InputError(f'{name} of kind {kind!r} is not complete')
    return one


def friction_groups(names: Sequence[str], joint: str, widths: Sequence[float]) -> list[Group]:
    """Return friction of the sum and the difference of a joint's velocity and its neighbours'.

    `names` are in order along the arm; friction changes its sign over each of the `widths`, rad/s.
    """
    index = list(names).index(joint)
    neighbours = names[max(0, index - 1):index + 2]
    return [Group('friction', ((joint, 1), (name, side)), width=width)
            for name in neighbours if name != joint for side in (1, -1) for width in widths]


@functools.lru_cache(maxsize=8)
def groups_for(names: Sequence[str], joint: str) -> list[Group]:
    """Return the groups of terms through which other joints may affect a joint's current.

    `names` are all joints, usually in their order along the arm. The potential energy of a serial
    arm is a sum of harmonics of sums and differences of joint angles, its kinetic energy of such
    harmonics times two velocities; the torque of a joint follows from both by Lagrange's equations.
    Each harmonic is a group of columns. Two facts of mechanics rule out others: a joint's weight
    torque depends on its own angle, and its angle does not change the inertia of the links behind.
    """
    # Of each harmonic the angles that are added (1) or subtracted (-1).
    weights: list[tuple[tuple[str, int], ...]] = [
        ((first, 1), (second, side)) for first, second in combinations(names, 2)
        for side in (1, -1)]
    weights += [tuple((name, 1) for name in names[start:stop])
                for start in range(len(names)) for stop in range(start + 3, len(names) + 1)]
    groups = [Group('weight', angles) for angles in weights if joint in dict(angles)]
    neighbours = list(zip(names, names[1:]))
    inertias: list[tuple[tuple[str, int], ...]] = [
        (), *(((name, 1),) for name in names),
        *(((first, 1), (second, 1)) for first, second in neighbours)]
    moving = [(joint, name) for name in names] + [
        pair for pair in [(name, name) for name in names] + neighbours if joint not in pair]
    for first, second in moving:
        for angles in inertias:
            turning = {name for name, _ in angles}
            # The coupled inertia of two joints does not depend on the angle of the first, and a
            # term without the joint's own acceleration has to depend on its angle.
            possible = not {first, second} <= turning and (first != second or turning)
            if possible and (joint in (first, second) or joint in turning):
                groups.append(Group('kinetic', angles, (joint, first, second)))
    return groups


def moving_states(samples: Samples, joints: Sequence[str], settings: dict[str, Any]
                  ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position, velocity and acceleration of J joints, each (N, J), in rad and s.

    Settings are those of `differentiate`. Raises InputError if a joint was not recorded.
    """
    if samples.arm is not None:
        states = samples.arm.of(joints)
        positions, velocities = states.position, states.velocity
    elif list(joints) == [samples.joint]:
        positions, velocities = samples.position[:, None], samples.velocity
        velocities = None if velocities is None else velocities[:, None]
    else:
        raise InputError(f'the motion of joints {", ".join(map(repr, joints))} is needed, but '
                         f'only that of {samples.joint!r} is recorded')
    moved = [differentiate(Samples(
        time=samples.time, position=positions[:, k], current=samples.current,
        velocity=None if velocities is None else velocities[:, k],
        recording=samples.recording, joint=joint), settings) for k, joint in enumerate(joints)]
    position, velocity, acceleration = (
        np.column_stack([getattr(one, name) for one in moved])
        for name in ('position', 'velocity', 'acceleration'))
    return position, velocity, acceleration


@dataclass(frozen=True)
class Arm:
    """The rest of the arm, as part of the model of one of its joints."""

    source: Tree | Coupling     # rigid bodies, or terms found without a URDF
    # How velocity and acceleration of all joints are derived from a recording.
    differentiation: dict[str, Any] = field(default_factory=dict)
    # Beside rigid bodies: friction that turns with two joints. Nothing of it acts at rest.
    friction: Arm | None = None

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints whose motion is needed."""
        return tuple(self.source.joints)

    @property
    def signal(self) -> str:
        """The field of `Samples` that `with_signal` fills."""
        return self.source.signal

    def with_signal(self, samples: Samples, joint: str = '') -> Samples:
        """Return samples with `rigid_body` in N·m, or `coupling` in A, if it is not known yet.

        Raises InputError if one of `joints` was not recorded, or `joint` is not among them.
        """
        if self.friction is not None:
            samples = self.friction.with_signal(samples, joint)
        if getattr(samples, self.signal) is not None:
            return samples
        motion = moving_states(samples, self.joints, self.differentiation)
        return samples.with_(**{self.signal: self.source.on(joint or samples.joint, *motion)})

    def at_rest(self, positions: Mapping[str, float], joint: str) -> dict[str, float]:
        """Return what the arm adds to the signals of a joint at rest, N·m or A, by name.

        Nothing if a joint's position, rad, is not among `positions`. Friction is none at rest.
        """
        if not all(name in positions for name in self.joints):
            return {}
        q = np.array([[positions[name] for name in self.joints]], dtype=float)
        still = np.zeros_like(q)
        return {**({} if self.friction is None else {self.friction.signal: 0.0}),
                self.signal: float(self.source.on(joint, q, still, still)[0])}

    def to_dict(self) -> dict[str, Any]:
        """Return the arm as the plain values of a model file."""
        friction = {} if self.friction is None else {'friction': self.friction.to_dict()}
        return {**self.source.to_dict(), 'differentiation': dict(self.differentiation), **friction}

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> Arm:
        """Make an arm from the plain values of a model file."""
        settings = settings_of(document.get('differentiation'), 'arm.differentiation')
        kind = Coupling if 'groups' in document else Tree
        friction = document.get('friction')
        return cls(kind.from_dict(document), settings,
                   None if friction is None else cls.from_dict(friction))
