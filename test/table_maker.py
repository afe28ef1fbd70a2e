# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Small tables of a joint that swings."""

import numpy as np


def swing(count=2000, step=0.001):
    """Return time, position and velocity of a joint that swings."""
    time = step * np.arange(count)
    return time, 0.4 * np.sin(2.0 * time), 0.8 * np.cos(2.0 * time)


def write(path, **columns):
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=',', comments='',
               header=','.join(columns), fmt='%.12g')
    return path
