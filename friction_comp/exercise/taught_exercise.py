# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Makes an exercise of a movement that a person guided: what was shown, in the same tempo.

A joint's reversals are where it turns by more than a hand trembles, its rests where it does not
leave a place; between them it moves one way. Waypoints stand at the reversals and at the ends of
the rests of any joint, and where a monotone curve through the others would leave the path.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.signal import butter, find_peaks, sosfiltfilt

from friction_comp.errors import InputError
from friction_comp.exercise.exercise_script import FORMAT, VERSION

RATE = 100.0
DEGREE = math.pi / 180.0
# A turn by less is no reversal, rad.
TURN = 1.0 * DEGREE
# A place is held if it is not left by more, rad, for so long, s.
_PLACE, _REST = 0.4 * DEGREE, 0.4
# s of rest before the first movement, so that it can be announced.
_FIRST_REST = 1.0
# Smallest angle in the file, rad.
_GRAIN = 0.01 * DEGREE


def teach(joints: Sequence[str], time: np.ndarray, position: np.ndarray
          ) -> tuple[dict[str, Any], float]:
    """Return the exercise file of a guided movement, and when in the recording it begins, s.

    Time is in s, (N,), position in rad, (N, J). Raises InputError if nothing moves.
    """
    if not time[-1] - time[0] > 2.0 * _REST:
        raise InputError(f'{time[-1] - time[0]:.2g} s are too short for an exercise')
    even = np.arange(time[0], time[-1], 1.0 / RATE)
    raw = np.column_stack([np.interp(even, time, column) for column in position.T])
    # Voluntary movement has little above 4 Hz, tremor begins there.
    path = sosfiltfilt(butter(2, 4.0, fs=RATE, output='sos'), raw, axis=0)
    shaped, keys = zip(*(_one_way(column) for column in path.T))
    shape = np.column_stack(shaped)
    shape = np.round((shape - shape[0]) / _GRAIN) * _GRAIN
    if np.abs(shape).max() < TURN:
        raise InputError(f'no joint moves by more than {TURN / DEGREE:.0f} degree')
    knots = _add_where_far(even, shape, sorted({0, len(even) - 1, *(k for own in keys
                                                                    for k in own)}))
    moving = np.flatnonzero(np.abs(np.diff(shape[knots], axis=0)).max(axis=1) > 0.0)
    # Without the time before the first movement and after the last one.
    knots = knots[moving[0]:moving[-1] + 2]
    steps: list[dict[str, Any]] = [{'hold': _FIRST_REST}]
    for before, after in zip(knots, knots[1:]):
        duration = round(float(even[after] - even[before]), 3)
        moved = shape[after] - shape[before]
        if not moved.any():
            steps.append({'hold': duration})
            continue
        steps.append({'to': {joint: round(float(shape[after, j] / DEGREE), 2)
                             for j, joint in enumerate(joints) if moved[j] != 0.0},
                      'time': duration})
    steps.append({'hold': _FIRST_REST})
    return {'format': FORMAT, 'version': VERSION, 'unit': 'deg', 'joints': list(joints),
            'announcement': 1.0, 'steps': steps}, float(even[knots[0]]) - _FIRST_REST


def _one_way(path: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Return a path that moves one way between its reversals and rests, and their indices."""
    # The extremes from which the path turns back by more than TURN.
    keys = [int(k) for sign in (1.0, -1.0) for k in find_peaks(sign * path, prominence=TURN)[0]]
    for begin, end in _rests(path):
        # A rest at a reversal stands in its place.
        keys = [k for k in keys if not begin < k < end] + [begin, end]
    keys = sorted({0, len(path) - 1, *keys})
    shaped = path.copy()
    for begin, end in _rests(path):
        shaped[begin:end + 1] = np.median(path[begin:end + 1])
    for first, last in zip(keys, keys[1:]):
        low, high = sorted((shaped[first], shaped[last]))
        part = np.clip(shaped[first:last + 1], low, high)
        up = shaped[last] >= shaped[first]
        shaped[first:last + 1] = (np.maximum if up else np.minimum).accumulate(part)
    return shaped, keys


def _rests(path: np.ndarray) -> list[tuple[int, int]]:
    """Return first and last index of each longest part that stays at a place."""
    rests, begin = [], 0
    while begin < len(path):
        inside = np.abs(path[begin:] - path[begin]) <= _PLACE
        end = begin + (int(np.argmin(inside)) if not inside.all() else len(inside)) - 1
        if end - begin >= _REST * RATE:
            # From when the joint is at the place, to when it leaves.
            there = begin + np.flatnonzero(
                np.abs(path[begin:end + 1] - np.median(path[begin:end + 1])) <= _PLACE / 4.0)
            rests.append((int(there[0]), int(there[-1])))
            begin = end + 1
        else:
            begin += 1
    return rests


def _add_where_far(time: np.ndarray, shape: np.ndarray, knots: list[int]) -> np.ndarray:
    """Return `knots` and as many more as bring the curve near to `shape` everywhere."""
    while True:
        curve = PchipInterpolator(time[knots], shape[knots])(time)
        far = np.abs(curve - shape).max(axis=1)
        added = [begin + int(np.argmax(far[begin:end])) for begin, end in zip(knots, knots[1:])
                 if far[begin:end].max() > 0.5 * TURN]
        if not added:
            return np.array(knots)
        knots = sorted({*knots, *added})
