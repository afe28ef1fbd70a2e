# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Rows of the table: what an experiment returns."""

import numpy as np

DEGREE = np.pi / 180.0


def share_row(floor, kind, law, fails, wanted=0, **detail):
    """Return a row for a floor that no joint may miss.

    Parameters
    ----------
    floor, kind, law : str
    fails : ndarray of bool
        One a joint.
    wanted : int
        How many may.
    **detail
        Plain figures to keep with it.
    """
    fails = np.asarray(fails, dtype=bool)
    return {'floor': floor, 'kind': str(kind), 'law': law,
            'measured': f'{int(fails.sum())} of {fails.size}', 'wanted': f'{wanted}',
            'met': bool(fails.sum() <= wanted), 'fails': int(fails.sum()), 'joints': fails.size,
            **{name: plain(value) for name, value in detail.items()}}


def figure_row(floor, kind, law, value, met, wanted, unit='', **detail):
    """Return a row for a floor that is a figure."""
    measured = f'{value:.3g}{unit}' if np.isfinite(value) else 'not known'
    return {'floor': floor, 'kind': str(kind), 'law': law, 'measured': measured,
            'wanted': wanted, 'met': bool(met), 'value': plain(value),
            **{name: plain(v) for name, v in detail.items()}}


def plain(value):
    """Return a number or list as JSON takes it; None for what is not finite."""
    if isinstance(value, (np.ndarray, list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, (np.floating, float)):
        if not np.isfinite(value):
            return None
        return float(f'{float(value):.5g}')
    if isinstance(value, (np.integer, np.bool_)):
        return value.item()
    return value
