# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of all joints of an arm on one time base."""

from __future__ import annotations

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.differentiation import differentiate


def moving_states(joints, settings):
    """Return position, velocity and acceleration of all joints.

    Parameters
    ----------
    joints : list of Samples, length J
        As recorded, on one time base.
    settings : dict
        As for `differentiate`.

    Returns
    -------
    tuple of ndarray, each of shape (N, J)
        rad, rad/s and rad/s².

    Raises
    ------
    InputError
        If the joints are not on one time base.
    """
    first = joints[0]
    if any(len(one) != len(first) or np.any(one.time != first.time) for one in joints):
        raise InputError('the joints of an arm must be on one time base')
    moved = [differentiate(one, settings) for one in joints]
    return tuple(np.column_stack([getattr(one, name) for one in moved])
                 for name in ('position', 'velocity', 'acceleration'))
