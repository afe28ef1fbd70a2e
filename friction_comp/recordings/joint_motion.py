# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Interpolates the motion of all joints of a recording at the times of one of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from friction_comp.samples import JointStates, Samples


class Started(Protocol):
    """What knows when a recording's time zero was, in s."""

    start: float


def beside(samples: Samples, info: Started,
           everyone: Mapping[str, tuple[Samples, Started]]) -> JointStates:
    """Return the motion of all joints at the times of one of them.

    Parameters
    ----------
    samples : Samples
        Of the one.
    info : RecordingInfo
        Of the same; topics may begin at different times.
    everyone : dict of str to (Samples, RecordingInfo)

    Returns
    -------
    JointStates
        Between joint states interpolated; beyond the ends the nearest value.
    """
    places, speeds = [], []
    for other, other_info in everyone.values():
        time = samples.time + (info.start - other_info.start)
        places.append(np.interp(time, other.time, other.position))
        if other.velocity is not None:
            speeds.append(np.interp(time, other.time, other.velocity))
    known = len(speeds) == len(places)
    return JointStates(tuple(everyone), np.column_stack(places),
                       np.column_stack(speeds) if known else None)
