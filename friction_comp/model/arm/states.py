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
    """Return position, velocity and acceleration of all joints.

    Parameters
    ----------
    samples : Samples
        As recorded, with `arm`.
    joints : sequence of str, length J
    settings : dict
        As for `differentiate`.

    Returns
    -------
    tuple of ndarray, each of shape (N, J)
        rad, rad/s and rad/s².

    Raises
    ------
    InputError
        If a joint was not recorded.
    """
    if samples.arm is None:
        if list(joints) != [samples.joint]:
            raise InputError(f'the motion of joints {", ".join(map(repr, joints))} is needed, but '
                             f'only that of {samples.joint!r} is recorded')
        states_position, states_velocity = samples.position[:, None], samples.velocity
        states_velocity = None if states_velocity is None else states_velocity[:, None]
    else:
        states = samples.arm.of(joints)
        states_position, states_velocity = states.position, states.velocity
    moved = []
    for k, joint in enumerate(joints):
        one = Samples(
            time=samples.time, position=states_position[:, k], current=samples.current,
            velocity=None if states_velocity is None else states_velocity[:, k],
            recording=samples.recording, joint=joint)
        moved.append(differentiate(one, settings))
    position, velocity, acceleration = (
        np.column_stack([getattr(one, name) for one in moved])
        for name in ('position', 'velocity', 'acceleration'))
    return position, velocity, acceleration
