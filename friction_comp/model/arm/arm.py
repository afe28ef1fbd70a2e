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
from friction_comp.model.differentiation import differentiate
from friction_comp.samples import Samples


def moving_states(samples: Samples, joints: Sequence[str], settings: dict[str, Any]
                  ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position, velocity and acceleration of J joints of recorded samples, each (N, J).

    In rad, rad/s and rad/s²; settings are those of `differentiate`. Raises InputError if a joint
    was not recorded.
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
    """The rest of the arm, as the model of one of its joints holds it.

    Parameters
    ----------
    tree : Tree, optional
        Rigid bodies; gives the samples' `rigid_body`.
    coupling : Coupling, optional
        Terms found without a URDF; gives the samples' `coupling`.
    differentiation : dict
        How velocity and acceleration of all joints are derived from a recording.
    """

    tree: Tree | None = None
    coupling: Coupling | None = None
    differentiation: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if (self.tree is None) == (self.coupling is None):
            raise InputError('arm: either links or groups are needed')

    @property
    def _part(self) -> Tree | Coupling:
        part = self.coupling if self.tree is None else self.tree
        assert part is not None, 'checked when the arm was made'
        return part

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints whose motion is needed."""
        return tuple(self._part.joints)

    def on(self, samples: Samples, joint: str = '') -> Samples:
        """Return recorded samples, with `arm`, with `rigid_body` or `coupling` for a joint.

        The joint is theirs when omitted. Raises InputError if a joint was not recorded, or the
        joint is not one of the arm's.
        """
        motion = moving_states(samples, self.joints, self.differentiation)
        part = self._part
        if isinstance(part, Coupling):
            return samples.with_(coupling=part.current(self.joints, *motion))
        return samples.with_(
            rigid_body=part.torques(*motion)[:, self._index(joint or samples.joint)])

    def _index(self, joint: str) -> int:
        if joint not in self.joints:
            raise InputError(f'joint {joint!r} is none of the arm: '
                             f'{", ".join(map(repr, self.joints))}')
        return self.joints.index(joint)

    def at_rest(self, position: np.ndarray, joint: str) -> float:
        """Return the arm's torque on a joint at rest: `rigid_body` N·m, or `coupling` A.

        Positions are in rad, in the order of `joints`.
        """
        part = self._part
        if isinstance(part, Tree):
            return float(part.weight(position)[self._index(joint)])
        return part.weight(self.joints, np.asarray(position, dtype=float))

    def to_dict(self) -> dict[str, Any]:
        """Return the arm as the plain values of a model file."""
        return {**self._part.to_dict(), 'differentiation': dict(self.differentiation)}

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> Arm:
        """Make an arm of the plain values of a model file."""
        if not isinstance(document, dict):
            raise InputError('arm is not a mapping')
        settings = document.get('differentiation')
        if not isinstance(settings, dict):
            raise InputError('arm.differentiation is missing or not a mapping')
        if 'groups' in document:
            return cls(coupling=Coupling.from_dict(document), differentiation=settings)
        return cls(tree=Tree.from_dict(document), differentiation=settings)
