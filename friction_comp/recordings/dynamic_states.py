# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Joint states with any interfaces, as ros2_control's joint_state_broadcaster publishes them.

They may hold current and temperature, and are used where the usual joint states have no effort.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from friction_comp.recordings.scan import Track

SIGNAL = 'dynamic_joint_states'
# Column of a track to the names of an interface, the first that is there.
_INTERFACES = (('position',), ('velocity',), ('effort', 'torque'), ('current',),
               ('temperature', 'motor_temperature'))
_EFFORT, _CURRENT, _TEMPERATURE = 2, 3, 4


def interface_values(names: Sequence[str], fields: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the values of each joint, shape (N, 5), in the order of `_INTERFACES`; NaN if none."""
    values: dict[str, np.ndarray] = {}
    column: dict[str, int] = {}
    for name in names:
        joint, _, interface = name.rpartition('/')
        k = column[joint] = column.get(joint, -1) + 1
        own = values.setdefault(joint, np.full((len(fields[joint]), len(_INTERFACES)), np.nan))
        for place, known in enumerate(_INTERFACES):
            if interface in known and k < fields[joint].shape[1]:
                own[:, place] = fields[joint][:, k]
    return {joint: own for joint, own in values.items() if np.isfinite(own[:, 0]).any()}


def resolved(tracks: Sequence[Track]) -> tuple[list[Track], bool, list[str]]:
    """Replace joint states without effort by dynamic ones.

    Returns the tracks, whether efforts are currents in A, and notes.
    """
    usual = [track for track in tracks if track.signal != SIGNAL]
    dynamic = [track for track in tracks if track.signal == SIGNAL]
    known = any(np.isfinite(values[:, 2]).any() for track in usual
                if track.signal == 'joint_states' for values in track.values.values())
    if not dynamic or known:
        return usual, False, []
    in_ampere = not any(np.isfinite(values[:, _EFFORT]).any() for track in dynamic
                        for values in track.values.values())
    effort = _CURRENT if in_ampere else _EFFORT
    kept = [track for track in usual if track.signal != 'joint_states']
    for track in dynamic:
        kept.append(replace(track, signal='joint_states', values={
            joint: values[:, [0, 1, effort]] for joint, values in track.values.items()}))
        warm = {joint: values[:, [_TEMPERATURE]] for joint, values in track.values.items()
                if np.isfinite(values[:, _TEMPERATURE]).any()}
        if warm and not any(one.signal == 'motor_temperature' for one in usual):
            kept.append(replace(track, topic=f'{track.topic}, temperature',
                                signal='motor_temperature', values=warm))
    return kept, in_ampere, [f'{dynamic[0].topic} is used, since no joint_states hold an effort']
