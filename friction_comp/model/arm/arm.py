# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The other joints in a model: rigid bodies of a URDF, or terms found without one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.arm.coupling import Coupling
from friction_comp.model.arm.tree import Tree
from friction_comp.model.differentiation import differentiate, settings_of
from friction_comp.samples import Samples


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
    _largest: dict[str, float] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints whose motion is needed."""
        return tuple(self.source.joints)

    @property
    def signal(self) -> str:
        """The field of `Samples` that `with_signal` fills."""
        return 'coupling' if isinstance(self.source, Coupling) else 'rigid_body'

    def with_signal(self, samples: Samples, joint: str = '') -> Samples:
        """Return samples with `rigid_body` in N·m, or `coupling` in A, if it is not known yet.

        Raises InputError if one of `joints` was not recorded, or `joint` is not among them.
        """
        if self.friction is not None:
            samples = self.friction.with_signal(samples, joint)
        if getattr(samples, self.signal) is not None:
            return samples
        motion = moving_states(samples, self.joints, self.differentiation)
        if isinstance(self.source, Coupling):
            return samples.with_(coupling=self.source.current(self.joints, *motion))
        return samples.with_(
            rigid_body=self.source.torques(*motion)[:, self._index(joint or samples.joint)])

    def _index(self, joint: str) -> int:
        if joint not in self.joints:
            raise InputError(f'joint {joint!r} is not part of the arm: '
                             f'{", ".join(map(repr, self.joints))}')
        return self.joints.index(joint)

    def at_rest(self, position: np.ndarray, joint: str) -> float:
        """Return the arm's torque on a joint at rest, N·m or A; positions as `joints`, rad."""
        if isinstance(self.source, Tree):
            return float(self.source.weight(position)[self._index(joint)])
        return self.source.weight(self.joints, np.asarray(position, dtype=float))

    def largest_at_rest(self, joint: str) -> float:
        """Return the largest magnitude of `at_rest` over all postures; the first call takes ms."""
        if joint not in self._largest:
            self._largest[joint] = (
                self.source.largest_weight(self._index(joint)) if isinstance(self.source, Tree)
                else self.source.largest_weight())
        return self._largest[joint]

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
