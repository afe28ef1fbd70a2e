# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What every reader asks of a joint's samples: the rows that were measured, and what cannot be."""

from __future__ import annotations

import numpy as np

from friction_comp.errors import InputError
from friction_comp.facts.current import wrong_sign
from friction_comp.facts.motion import glitches, impossible, turns_of, velocity_agreement
from friction_comp.facts.timing import held_rows, rhythm
from friction_comp.samples import Samples


def moves(position: np.ndarray) -> bool:
    """Return whether a joint moved by more than 0.01 rad or m; positions, (N,), may be NaN."""
    position = position[np.isfinite(position)]
    return len(position) > 0 and bool(np.ptp(position) > 0.01)


def usable(position: np.ndarray, current: np.ndarray, velocity: np.ndarray | None
           ) -> tuple[np.ndarray, np.ndarray | None]:
    """Return which rows, (N,), are finite, and the velocity: None if it is mostly missing."""
    rows = np.isfinite(position) & np.isfinite(current)
    if velocity is None or not rows.any() or np.isfinite(velocity[rows]).mean() < 0.5:
        return rows, None
    return rows & np.isfinite(velocity), velocity


def tidied(samples: Samples, notes: list[str]) -> tuple[Samples, np.ndarray]:
    """Return the samples that were measured, with turns added, and their indices; notes say more.

    Where a logger repeats a position over several rows, only new ones are used; during rests, rows
    at the same rate. A velocity that was computed from row to row tells no more than the position.
    """
    rows = np.arange(len(samples))
    if (held := held_rows(samples.position)) > 1:
        begin = np.concatenate(([0], np.flatnonzero(np.diff(samples.position)) + 1))
        fresh = (rows - begin[np.searchsorted(begin, rows, side='right') - 1]) % held == 0
        rate = np.count_nonzero(fresh) / max(float(np.ptp(samples.time)), 1e-9)
        notes.append(f'position is held over {held} rows: {np.count_nonzero(fresh)} of {len(rows)} '
                     f'rows are used, {rate:.3g} Hz is the rate at which it is measured')
        velocity = samples.velocity
        # It is zero where positions are held.
        if velocity is not None and np.count_nonzero(velocity[~fresh]) < 0.1 * np.count_nonzero(
                velocity[fresh]):
            notes.append('velocity was computed from row to row, and is not used')
            samples = samples.with_(velocity=None)
        rows = rows[fresh]
    odd = glitches(samples.position[rows])
    if odd.any():
        notes.append(f'{np.count_nonzero(odd)} joint states left out: position jumps away and back '
                     'within one sample')
        rows = rows[~odd]
    samples = samples if len(rows) == len(samples) else samples.take(rows)
    _, gaps, longest, before = rhythm(samples.time)
    if gaps:
        notes.append(f'{gaps} gaps, the longest of {longest:.3g} s after {before:.3f} s')
    turns = turns_of(samples.time, samples.position)
    if turns.any():
        notes.append(f'position wraps around {np.count_nonzero(np.diff(turns))} times: turns are '
                     'added')
        samples = samples.with_(position=samples.position + 2.0 * np.pi * turns)
    return samples, rows


def check_plausible(samples: Samples, where: object, alone: bool = True) -> None:
    """Raise InputError if samples are physically impossible; `where` names the recording.

    Results from such recordings would look valid. `alone` says that no other joint of the recording
    moved: then the weight depends on the position alone, and the motor's mean power must be
    positive.
    """
    fault, velocity = impossible(samples), samples.velocity
    # Some drivers publish zeros where they measure no velocity.
    if not fault and velocity is not None and velocity.any():
        agreement = velocity_agreement(samples.time, samples.position, velocity)
        fault = agreement.cause and agreement.fault + (
            ' (--unit says it, such as velocity=deg/s, velocity=turn/s or position=turn)')
    if fault := fault or wrong_sign(samples, alone):
        raise InputError(f'{where}: ' + f'joint {samples.joint!r}: ' * bool(samples.joint) + fault)
