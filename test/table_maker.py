# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Small tables of a joint that swings."""

import numpy as np


def swing(count=2000, step=0.001):
    """Return time, position and velocity of a joint that swings."""
    time = step * np.arange(count)
    return time, 0.4 * np.sin(2.0 * time), 0.8 * np.cos(2.0 * time)


def write(path, separator=',', **columns):
    """Write a table of columns by name; return its path."""
    np.savetxt(path, np.column_stack(list(columns.values())), '%.16g', separator,
               header=separator.join(columns), comments='')
    return path
