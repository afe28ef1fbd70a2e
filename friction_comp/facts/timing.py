# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Facts about times: rate and gaps, and whether each row was measured when it says."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from friction_comp.statistics import gap_length, smallest_step

_SLOWEST = 1.0
"""Longest usual time from row to row of a joint in motion, s."""
_UNITS = {'s': 1.0, 'ms': 1e-3, 'µs': 1e-6, 'ns': 1e-9}


class Rhythm(NamedTuple):
    """How samples follow each other."""

    rate: float     # Hz, on average; 0 for fewer than two samples
    gaps: int       # steps longer than `gap_length`
    longest: float  # the longest step, s
    before: float   # time since the first sample at which it begins, s


def rhythm(time: np.ndarray) -> Rhythm:
    """Return the rate and the gaps of samples; times in s, not descending, shape (N,)."""
    steps = np.diff(time)
    if not len(steps) or not time[-1] > time[0]:
        return Rhythm(0.0, 0, 0.0, 0.0)
    longest = int(np.argmax(steps))
    return Rhythm(len(steps) / float(time[-1] - time[0]),
                  int(np.count_nonzero(steps > gap_length(steps))), float(steps[longest]),
                  float(time[longest] - time[0]))


def not_in_seconds(time: np.ndarray, factor: float = 1.0, stated: bool = False) -> str:
    """Return what tells that times, shape (N,), are not in the unit of `factor` s; '' if nothing.

    Friction in a wrong unit of time fits a recording as well as in the right one. If the unit is
    `stated`, rows may be seconds apart.
    """
    time = time[np.isfinite(time)]
    steps = np.diff(time)
    if not len(steps):
        return ''
    usual, mean = float(np.median(steps)), float(np.ptp(time)) / len(steps)
    # The latest time that 64 bits hold in ns.
    if np.abs(factor * time).min() >= 9e9:
        return f'holds values such as {time[0]:.4g}, which are no times in this unit'
    if 0.0 < factor * mean < 1e-5:
        return f'has rows {mean:.3g} apart, too close for this unit'
    # Half of the rows or more share their time with others if times are rounded to seconds.
    if not stated and factor * usual >= _SLOWEST:
        return f'has rows {usual:.3g} apart, which show no motion if these are seconds'
    return ''


def unit_for(time: np.ndarray) -> str:
    """Return the unit in which times, shape (N,), would be of a recording, as an example."""
    steps = np.diff(time[np.isfinite(time)])
    usual = float(np.median(steps)) if len(steps) else 0.0
    return next((unit for unit, factor in _UNITS.items() if factor * usual < _SLOWEST), 'ns')


def lost_rows(time: np.ndarray, position: np.ndarray, step: float) -> float:
    """Return the share of rows before which others are missing in spite of their times; else 0.

    Between two rates that are alike the position, in steps of `step` rad, then moves a whole number
    of times as far, and seldom one and a half times, as it does by noise. Motion of five steps and
    more from row to row tells.
    """
    change = np.diff(time)
    rate = np.divide(np.diff(position), change, out=np.zeros(len(change)), where=change > 0.0)
    before, own, after = rate[:-2], rate[1:-1], rate[2:]
    size = np.abs((before, after))
    steady = (before * after > 0.0) & (size.max(axis=0) < 1.5 * size.min(axis=0)) & (
        size.min(axis=0) * change[1:-1] > 5.0 * step)
    if not steady.any():
        return 0.0
    ratio = 2.0 * own[steady] / (before + after)[steady]
    far, between = np.mean(ratio > 1.8), np.mean((ratio > 1.4) & (ratio < 1.8))
    return float(far) if far > 0.01 and between < 0.2 * far else 0.0


def held_rows(position: np.ndarray) -> int:
    """Return over how many rows a logger holds each position, 1 if it does not; shape (N,).

    A slow motion repeats positions too, up to the next step of the encoder. Values are held if they
    then change by more than such a step.
    """
    change = np.diff(position)
    changed = np.flatnonzero(change) + 1
    if len(changed) < 50:
        return 1
    coarse = np.mean(np.abs(change[changed - 1]) < 1.5 * smallest_step(position))
    return 1 if coarse > 0.5 else max(int(np.median(np.diff(changed))), 1)
