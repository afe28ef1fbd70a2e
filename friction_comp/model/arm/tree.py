# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An arm as a tree of rigid bodies: inertial and gravity torques of each joint.

They are computed in `friction_comp.model.arm.rigid_bodies`, compiled, and imported when needed.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from friction_comp.errors import InputError

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
        from friction_comp.model.arm.rigid_bodies import joint_torques

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
