# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Facts about recorded rows: times, rate and gaps, which were measured, and what cannot be."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from friction_comp.errors import InputError
from friction_comp.facts.current import wrong_sign
from friction_comp.facts.motion import glitches, impossible, turns_of, velocity_agreement
from friction_comp.samples import Samples
from friction_comp.statistics import gap_length

_SLOWEST = 1.0
"""Longest usual time from row to row of a joint in motion, s."""
_UNITS = {'s': 1.0, 'ms': 1e-3, 'µs': 1e-6, 'ns': 1e-9}


# Times.

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
        fault = f'holds values such as {time[0]:.4g}, which are no times in this unit'
    elif 0.0 < factor * mean < 1e-5:
        fault = f'has rows {mean:.3g} apart, too close for this unit'
    # Half of the rows or more share their time with others if times are rounded to seconds.
    elif not stated and factor * usual >= _SLOWEST:
        fault = f'has rows {usual:.3g} apart, which show no motion if these are seconds'
    else:
        return ''
    likely = next((unit for unit, factor in _UNITS.items() if factor * usual < _SLOWEST), 'ns')
    return f'{fault}: give its unit, for instance --unit time={likely}' + (
        ', or time=s' * (likely != 's')) + ', or the rows per second with --rate'


# Samples.

def usable(position: np.ndarray, current: np.ndarray, velocity: np.ndarray | None
           ) -> tuple[np.ndarray, np.ndarray | None]:
    """Return which rows, (N,), are finite, and the velocity: None if it is mostly missing."""
    rows = np.isfinite(position) & np.isfinite(current)
    if velocity is None or not rows.any() or np.isfinite(velocity[rows]).mean() < 0.5:
        return rows, None
    return rows & np.isfinite(velocity), velocity


def checked(samples: Samples, notes: list[str], where: object, others: Iterable[np.ndarray] = ()
            ) -> tuple[Samples, np.ndarray]:
    """Return the samples that were measured, with turns added, and their indices; notes say more.

    Raises InputError, with the name `where` of the recording, if they are physically impossible:
    results would look valid. Where no position of `others` moved, the weight depends on the
    position alone, and the motor's mean power must be positive.
    """
    rows = np.arange(len(samples))
    if (odd := glitches(samples.position)).any():
        notes.append(f'{np.count_nonzero(odd)} joint states left out: position jumps away and back '
                     'within one sample')
        rows, samples = rows[~odd], samples.take(~odd)
    _, gaps, longest, before = rhythm(samples.time)
    if gaps:
        notes.append(f'{gaps} gaps, the longest of {longest:.3g} s after {before:.3f} s')
    if (turns := turns_of(samples.time, samples.position)).any():
        notes.append(f'position wraps around {np.count_nonzero(np.diff(turns))} times: turns are '
                     'added')
        samples = samples.with_(position=samples.position + 2.0 * np.pi * turns)
    fault, velocity = impossible(samples), samples.velocity
    # Some drivers publish zeros where they measure no velocity.
    if not fault and velocity is not None and velocity.any():
        agreement = velocity_agreement(samples.time, samples.position, velocity)
        fault = agreement.cause and agreement.fault + (
            f' (--unit says it, such as position=turn or velocity={1.0 / agreement.ratio:.4g}rad/s;'
            ' --columns velocity= computes it from the position)')
    # Less than 0.01 rad or m is no motion.
    alone = not any(np.ptp(own[np.isfinite(own)]) > 0.01 for own in others
                    if np.isfinite(own).any())
    if fault := fault or wrong_sign(samples, alone):
        raise InputError(f'{where}: ' + f'joint {samples.joint!r}: ' * bool(samples.joint) + fault)
    return samples, rows
