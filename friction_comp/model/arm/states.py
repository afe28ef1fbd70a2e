# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of all joints of an arm on one time base."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from friction_comp.errors import InputError
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
