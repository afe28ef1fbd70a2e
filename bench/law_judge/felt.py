# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What of friction a hand no longer feels: (bare - law) / (bare - frictionless) of its torque."""

import numpy as np
from scipy.signal import butter, sosfiltfilt

BAND = 20.0      # Hz
LEAST = 0.05     # share of friction in what the hand feels, from which on there is a part to remove


def smooth(torque, sample_time=1e-3):
    """Return torques, shape (N, J), after a zero-phase low pass."""
    return sosfiltfilt(butter(2, BAND, fs=1.0 / sample_time, output='sos'), torque, axis=0)


def removed(bare, with_law, floor):
    """Return the share of friction's part that is removed, %; NaN where friction has no part."""
    return 100.0 * (bare - with_law) / np.where(bare - floor > LEAST * bare, bare - floor, np.nan)


def per_gear(joints, values):
    """Return the mean over the joints of each gear."""
    return np.bincount(joints.gear, values) / np.bincount(joints.gear)
