# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An arm as a tree of rigid bodies: inertial and gravity torques of each joint.

They are computed by the recursive Newton-Euler algorithm (Luh, Walker and Paul, J. Dyn. Sys.,
Meas., Control 102(2), 1980), compiled, with all vectors in the frame of the base.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any

from numba import njit
import numpy as np

from friction_comp.errors import InputError

# Three numbers in a tuple, which needs no heap memory.
Vector = tuple[float, float, float]
# Numbers of each link: see `Tree`.
PARAMETERS = 10
FREE_FALL = (0.0, 0.0, -9.81)
# Rotation matrices in a file are rounded, by less than this in any product.
_ROUNDED = 1e-6
# The search of the largest weight: postures at its start, most passes over the joints, last gain.
_STARTS, _SWEEPS, _CLOSE = 16, 20, 1e-6
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_KINDS = ('revolute', 'prismatic')


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

    def __post_init__(self) -> None:
        size = len(self.joints)
        shapes = {'rotations': (size, 3, 3), 'places': (size, 3), 'axes': (size, 3),
                  'parameters': (size, PARAMETERS), 'gravity': (3,)}
        for name, shape in shapes.items():
            value = np.ascontiguousarray(getattr(self, name), dtype=float)
            if value.shape != shape or not np.isfinite(value).all():
                raise InputError(f'arm.{name} must be finite numbers of shape {shape}')
            object.__setattr__(self, name, value)
        parents = np.ascontiguousarray(self.parents, dtype=np.int64)
        object.__setattr__(self, 'parents', parents)
        if size == 0 or len(set(self.joints)) != size:
            raise InputError('arm.joints must have different names')
        if len(self.kinds) != size or any(kind not in _KINDS for kind in self.kinds):
            raise InputError(f'each joint of an arm is one of {", ".join(_KINDS)}')
        if parents.shape != (size,) or (parents >= np.arange(size)).any() or (parents < -1).any():
            raise InputError('each joint of an arm is carried by an earlier one, or by the base')
        products = self.rotations @ self.rotations.transpose(0, 2, 1)
        if np.abs(products - np.eye(3)).max() > _ROUNDED or (
                np.linalg.det(self.rotations) < 0.0).any():
            raise InputError('arm.rotations must be rotation matrices')
        if np.abs(np.linalg.norm(self.axes, axis=1) - 1.0).max() > _ROUNDED:
            raise InputError('arm.axes must be unit vectors')

    @property
    def prismatic(self) -> np.ndarray:
        """Which joints are prismatic, shape (L,)."""
        return np.array([kind == 'prismatic' for kind in self.kinds])

    def torques(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the torque of each joint without friction and rotors, N·m or N, (N, L).

        Position, velocity and acceleration have the same shape; rad or m, and s.
        """
        q, v, a = (np.ascontiguousarray(values, dtype=float) for values in (q, v, a))
        result = np.empty(q.shape)
        joint_torques(self.parents, self.prismatic, self.rotations, self.places, self.axes,
                      self.parameters, self.gravity, q, v, a, result)
        return result

    def weight(self, position: np.ndarray) -> np.ndarray:
        """Return the torque that holds the arm at rest, shape (L,), at a position of shape (L,)."""
        return self._at_rest(np.asarray(position, dtype=float)[None])[0]

    def largest_weight(self, index: int) -> float:
        """Return the largest torque that holds a joint at rest over all postures, N·m or N.

        Prismatic joints stay at zero. At rest the torque is a constant plus one harmonic of each
        angle, so that three postures give the best angle of a joint while the others stay; repeated
        for all joints, from many postures.
        """
        size = len(self.joints)
        # Evenly distributed postures, each for a torque in both directions.
        q = math.tau * np.modf(np.outer(np.arange(_STARTS) + 0.5, _GOLDEN ** np.arange(1, size + 1))
                               )[0].repeat(2, axis=0)
        q[:, self.prismatic] = 0.0
        signs = np.tile([1.0, -1.0], _STARTS)
        largest = self._at_rest(q)[:, index] * signs
        for _ in range(_SWEEPS):
            before = largest
            for k in np.flatnonzero(~self.prismatic):
                q[:, k], largest = self._best_angles(index, signs, q, int(k))
            if largest.max() <= before.max() * (1.0 + _CLOSE):
                break
        return float(max(0.0, largest.max()))

    def _best_angles(self, index: int, signs: np.ndarray, q: np.ndarray, k: int
                     ) -> tuple[np.ndarray, np.ndarray]:
        """Return the angle of joint `k`, rad, at which joint `index` holds the most, and that, N·m.

        Both are of shape (P,), for postures `q`, (P, J); `signs`, (P,), say which way it is held.
        """
        angles = math.tau / 3.0 * np.arange(3.0)
        postures = q.repeat(3, axis=0)
        postures[:, k] = np.tile(angles, len(q))
        torques = signs[:, None] * self._at_rest(postures)[:, index].reshape(-1, 3)
        cosine, sine = (2.0 / 3.0 * torques @ wave(angles) for wave in (np.cos, np.sin))
        return np.arctan2(sine, cosine), torques.mean(axis=1) + np.hypot(cosine, sine)

    def _at_rest(self, postures: np.ndarray) -> np.ndarray:
        still = np.zeros_like(postures)
        return self.torques(postures, still, still)

    def to_dict(self) -> dict[str, Any]:
        """Return the tree as the plain values of a model file."""
        return {
            'gravity': self.gravity.tolist(),
            'links': [{
                'joint': self.joints[k], 'kind': self.kinds[k],
                'parent': self.joints[self.parents[k]] if self.parents[k] >= 0 else None,
                'rotation': self.rotations[k].tolist(), 'place': self.places[k].tolist(),
                'axis': self.axes[k].tolist(), 'inertial_parameters': self.parameters[k].tolist(),
            } for k in range(len(self.joints))]}

    @classmethod
    def from_dict(cls, document: Any) -> Tree:
        """Make a tree of the plain values of a model file."""
        try:
            links = document['links']
            joints = tuple(str(link['joint']) for link in links)
            index = {name: k for k, name in enumerate(joints)}
            parents = [-1 if link['parent'] is None else index[str(link['parent'])]
                       for link in links]
            rotations, places, axes, parameters = (
                np.array([link[name] for link in links], dtype=float)
                for name in ('rotation', 'place', 'axis', 'inertial_parameters'))
            return cls(
                joints, tuple(str(link['kind']) for link in links), np.array(parents, dtype=int),
                rotations, places, axes, parameters, np.array(document['gravity'], dtype=float))
        except InputError:
            raise
        except KeyError as error:
            raise InputError(f'arm: {error.args[0]} is missing') from None
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f'arm: {error}') from None


@njit(cache=True)
def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@njit(cache=True)
def plus(a: Vector, b: Vector) -> Vector:
    """Return the sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@njit(cache=True)
def times(factor: float, a: Vector) -> Vector:
    """Return a vector times a number."""
    return (factor * a[0], factor * a[1], factor * a[2])


@njit(cache=True)
def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def row(values: np.ndarray, k: int) -> Vector:
    """Return a row of an array, shape (L, 3), as a vector."""
    return (values[k, 0], values[k, 1], values[k, 2])


@njit(cache=True)
def set_row(values: np.ndarray, k: int, a: Vector) -> None:
    """Write a vector into a row of an array, shape (L, 3)."""
    values[k, 0], values[k, 1], values[k, 2] = a[0], a[1], a[2]


@njit(cache=True)
def in_base(frame: np.ndarray, a: Vector) -> Vector:
    """Return a vector of a frame in the base; the rows of `frame` are its unit vectors there."""
    return plus(plus(times(a[0], row(frame, 0)), times(a[1], row(frame, 1))),
                times(a[2], row(frame, 2)))


@njit(cache=True)
def turned(axis: Vector, angle: float, a: Vector) -> Vector:
    """Return a vector turned about a unit axis (Rodrigues)."""
    c, s = np.cos(angle), np.sin(angle)
    return plus(plus(times(c, a), times(s, cross(axis, a))), times(dot(axis, a) * (1.0 - c), axis))


@njit(cache=True)
def angular_momentum(frame: np.ndarray, p: np.ndarray, w: Vector) -> Vector:
    """Return the product of a link's inertia about its joint's origin with a vector."""
    a, b, c = dot(row(frame, 0), w), dot(row(frame, 1), w), dot(row(frame, 2), w)
    return in_base(frame, (p[4] * a + p[5] * b + p[7] * c, p[5] * a + p[6] * b + p[8] * c,
                           p[7] * a + p[8] * b + p[9] * c))


@njit(cache=True)
def joint_torques(parents: np.ndarray, prismatic: np.ndarray, rotations: np.ndarray,
                  places: np.ndarray, axes: np.ndarray, parameters: np.ndarray,
                  gravity: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray,
                  torques: np.ndarray) -> None:
    """Write the torque that every joint has to supply, N·m or N, (N, L); arguments as of `Tree`."""
    # A parent of -1 is the base, the last frame, which accelerates upwards instead of gravity.
    size = len(parents)
    frames = np.zeros((size + 1, 3, 3))
    frames[size] = np.eye(3)
    levers, directions = np.zeros((size, 3)), np.zeros((size, 3))
    spins, spin_rates = np.zeros((size + 1, 3)), np.zeros((size + 1, 3))
    accelerations = np.zeros((size + 1, 3))
    accelerations[size] = -gravity
    for n in range(len(q)):
        forces, moments = np.zeros((size + 1, 3)), np.zeros((size + 1, 3))
        for k in range(size):
            up, frame, parent = frames[parents[k]], frames[k], parents[k]
            w, dw = row(spins, parent), row(spin_rates, parent)
            lever = in_base(up, row(places, k))
            for i in range(3):
                r = rotations[k]
                set_row(frame, i, in_base(up, (r[0, i], r[1, i], r[2, i])))
            axis = in_base(frame, row(axes, k))
            if prismatic[k]:
                lever = plus(lever, times(q[n, k], axis))
            acceleration = plus(row(accelerations, parent),
                                plus(cross(dw, lever), cross(w, cross(w, lever))))
            if prismatic[k]:
                acceleration = plus(acceleration, plus(
                    times(a[n, k], axis), times(2.0 * v[n, k], cross(w, axis))))
            else:
                for i in range(3):
                    set_row(frame, i, turned(axis, q[n, k], row(frame, i)))
                dw = plus(dw, plus(times(a[n, k], axis), times(v[n, k], cross(w, axis))))
                w = plus(w, times(v[n, k], axis))
            set_row(levers, k, lever)
            set_row(directions, k, axis)
            set_row(spins, k, w)
            set_row(spin_rates, k, dw)
            set_row(accelerations, k, acceleration)
            link = parameters[k]
            h = in_base(frame, (link[1], link[2], link[3]))
            set_row(forces, k, plus(times(link[0], acceleration),
                                    plus(cross(dw, h), cross(w, cross(w, h)))))
            set_row(moments, k, plus(cross(h, acceleration), plus(
                angular_momentum(frame, link, dw), cross(w, angular_momentum(frame, link, w)))))
        for k in range(size - 1, -1, -1):
            force, moment, parent = row(forces, k), row(moments, k), parents[k]
            torques[n, k] = dot(row(directions, k), force if prismatic[k] else moment)
            set_row(forces, parent, plus(row(forces, parent), force))
            set_row(moments, parent, plus(row(moments, parent), plus(
                moment, cross(row(levers, k), force))))
