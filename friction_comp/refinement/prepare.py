# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Prepares recordings as rows of a fit, each in a regime of motion.

The velocity over which friction changes sign is chosen by how well a plain drive predicts regimes
that were not fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import functools
import math
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.facts.motion import positions
from friction_comp.model.differentiation import differentiate
from friction_comp.model.effects import Coverage
from friction_comp.refinement import recorded_motion, thresholds
from friction_comp.refinement.block_sums import held_out_error
from friction_comp.samples import Samples
from friction_comp.statistics import evenly_spread

_SLOWEST_RATE = 100.0
# A limit occurs more often than this multiple of the value next to it. At its turning points, a
# sine in coarse steps has 2.4 times as many samples in the outermost step.
_MORE_OFTEN = 3.0
# As many different currents, or fewer, are a command: both directions, and none.
_LEVELS = 3
# Most rows that are searched, in multiples of `ROWS`, and how many are kept or left out together.
_MOST, _PIECE = 4.0, 100


@dataclass(frozen=True)
class Rows:
    """The data of a fit: N samples, and R averages over a few of them each, in blocks."""

    samples: Samples  # with velocity and acceleration
    target: np.ndarray  # (N,): current that the model has to explain, A
    usable: np.ndarray  # (N,): which samples are fitted
    clipped: np.ndarray  # (N,): which are at a limit of the current; none of them is usable
    coverage: Coverage
    start: np.ndarray  # (R,): first sample of each row
    length: int  # samples averaged in each row
    block: np.ndarray  # (R,): regime of motion, which is left out of a fit as a whole
    # Current per load, A/(N·m), where the load is part of the target; otherwise 0.
    load_coefficient: float = 0.0
    # Position, velocity and acceleration, each (N, J), of all joints where others moved too.
    motion: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
    joints: tuple[str, ...] = ()  # names of these joints
    torque_per_current: float = 1.0  # N·m/A at the joint, 1 where it is not known

    @property
    def blocks(self) -> int:
        """Number of regimes."""
        return int(self.block.max()) + 1

    @functools.cached_property
    def parts(self) -> list[slice]:
        """The rows of each regime, which follow each other."""
        edges = np.searchsorted(self.block, np.arange(self.blocks + 1)).tolist()
        return [slice(*ends) for ends in zip(edges, edges[1:])]

    @functools.cached_property
    def at_rows(self) -> Samples:
        """The averages of the signals over each row."""
        names = ('time', 'position', 'velocity', 'acceleration', 'load', 'temperature',
                 'rigid_body', 'coupling')
        known: Any = {name: self.averaged(getattr(self.samples, name)) for name in names
                      if getattr(self.samples, name) is not None}
        return Samples(current=self.averaged(self.samples.current), joint=self.samples.joint,
                       recording=self.samples.recording[self.start], **known)

    @property
    def block_of_sample(self) -> np.ndarray:
        """The regime of each sample, that of the row before it, shape (N,)."""
        order = np.argsort(self.start)
        before = np.searchsorted(self.start[order], np.arange(len(self.samples)), side='right') - 1
        return np.asarray(self.block[order][np.clip(before, 0, None)])

    def with_settings(self, raw: Samples, settings: dict[str, Any]) -> Rows:
        """Return the rows with the motion of other differentiation settings."""
        return replace(self, samples=differentiate(raw, settings),
                       motion=recorded_motion.arm_motion(raw, self.joints, settings))

    def averaged(self, values: np.ndarray) -> np.ndarray:
        """Return averages of values, shape (N,) or (N, M), over each row's samples."""
        # Columns are contiguous in memory, and taken from that way for less.
        total = values.T.take(self.start, axis=-1)
        for k in range(1, self.length):
            total += values.T.take(self.start + k, axis=-1)
        total /= self.length
        return np.asarray(total.T)


def join(recordings: Sequence[Samples] | Samples) -> Samples:
    """Join recordings, without samples that are not finite; raises `InputError` if too few."""
    if isinstance(recordings, Samples):
        recordings = [recordings]
    if not all(isinstance(r, Samples) for r in recordings):
        raise InputError('recordings must be a list of Samples, as read_recording returns it')
    # Sorted by content, so that neither the order in which files are named makes a difference, nor
    # a sign or an origin; the last digits may be rounding.
    recordings = sorted((part for part in recordings if len(part)), key=lambda part: (
        len(part), f'{np.ptp(part.position):.6e}', float(np.std(part.current))))
    if not recordings:
        raise InputError('the recordings hold no samples')
    samples = Samples.concatenate(recordings) if len(recordings) > 1 else recordings[0]
    valid = np.isfinite(samples.time) & np.isfinite(samples.position)
    valid &= np.isfinite(samples.current)
    for name in ('velocity', 'load', 'temperature'):
        values = getattr(samples, name)
        if values is None:
            continue
        if np.mean(np.isfinite(values)) < 0.5:
            samples = samples.with_(**{name: None})
        else:
            valid &= np.isfinite(values)
    samples = samples if valid.all() else samples.take(valid)
    if len(samples) < thresholds.FEWEST_SAMPLES:
        raise InputError(f'{len(samples)} usable samples are too few: at least '
                         f'{thresholds.FEWEST_SAMPLES:.0f} are needed')
    if not samples.sample_time > 0.0:
        raise InputError('all time stamps of the recordings are equal')
    if np.ptp(samples.position) == 0:
        raise InputError('the joint never moves in the recordings: there is no friction to fit')
    return samples


def clipped(current: np.ndarray) -> np.ndarray:
    """Return which samples sit at the limits of the current signal, shape (N,).

    Runs of samples repeat a limit exactly, and much more often than the value next to it: neither a
    noisy signal nor one in coarse steps does so. A current of a level each way was commanded so.
    """
    mark = np.zeros(len(current), dtype=bool)
    span = float(np.ptp(current))
    if span == 0:
        return mark
    for extreme in (current.max(), current.min()):
        distance = np.abs(current - extreme) / span
        at_limit = distance <= 1e-6
        inner = distance[(distance > 1e-6) & (distance < 1.0 - 1e-6)]
        beside = np.sum(inner <= inner.min() + 1e-6) if inner.size else 0
        runs, count = at_limit[1:] & at_limit[:-1], at_limit.sum()
        if (count >= max(20, 1e-3 * len(current)) and runs.sum() >= 0.5 * count
                and count > _MORE_OFTEN * beside):
            mark |= at_limit
    if mark.any() and current.min() < 0.0 < current.max() and len(np.unique(current)) <= _LEVELS:
        mark[:] = False
    return mark


def samples_per_row(samples: Samples, usable: int) -> int:
    """Return the fewest samples per row for which at most `ROWS` remain, at 100 Hz or more."""
    return max(1, min(math.ceil(usable / thresholds.ROWS),
                      int(1.0 / samples.sample_time / _SLOWEST_RATE)))


def thinned(start: np.ndarray) -> np.ndarray:
    """Return the starts of at most as many rows as are searched, in pieces from everywhere."""
    share = _MOST * thresholds.ROWS / max(len(start), 1)
    if share >= 1.0:
        return start
    return start[evenly_spread(np.arange(len(start)) // _PIECE) < share]


def prepare(samples: Samples, drive: Drive, settings: dict[str, Any] | None = None,
            declared: bool = True, linear: bool = False) -> tuple[Rows, dict[str, Any]]:
    """Return the rows that effects are fitted to, and the settings, chosen when omitted.

    `samples` are joined; `declared` says that torque constant and gear ratio are known, `linear`
    that positions are in m.
    """
    at_limit, reach = clipped(samples.current), round(thresholds.NEAR_LIMIT / samples.sample_time)
    # Their neighbours are below the limit if their noise is: a fit to these alone would be bent.
    unusable = recorded_motion.widened(at_limit, reach)
    if at_limit.any():
        at_limit = recorded_motion.beyond_limit(samples, at_limit, unusable)
        unusable = recorded_motion.widened(at_limit, reach)
    joints = recorded_motion.moving_joints(samples)
    load = recorded_motion.load_coefficient(samples, unusable, drive) if declared else 0.0
    settings = settings or recorded_motion.choose_differentiation(samples, unusable, joints, load)
    moved = differentiate(samples, settings)
    slowest = recorded_motion.standstill_speed(moved)
    usable = recorded_motion.in_motion(moved, unusable, slowest, settings['bandwidth'])
    motion = recorded_motion.arm_motion(samples, joints, settings)
    length = samples_per_row(moved, int(usable.sum()))
    start = thinned(recorded_motion.row_starts(moved, usable, length))
    # Rigid bodies are the same in all postures.
    others = list(motion[0].T) if motion and samples.rigid_body is None else []
    block = recorded_motion.regimes_in(moved, start, length, others)
    order = np.argsort(block, kind='stable')
    target = moved.current - load * np.asarray(moved.load) if load else moved.current
    # Squares of smaller numbers are 0; an effort that was never set can hold such numbers.
    if not np.abs(target[usable]).max() > math.sqrt(np.finfo(float).tiny):
        why = '; the motor has to move the joint' if samples.load is None or declared else (
            ' without torque constant and gear ratio, which say how much of the recorded load it '
            'is; 1 for both gives friction in N·m')
        raise InputError('the current is zero throughout the motion: there is no friction to fit'
                         + why)
    coverage = replace(coverage_of(moved, usable, slowest, samples), linear=linear)
    rows = Rows(
        samples=moved, target=target, usable=usable, clipped=at_limit, coverage=coverage,
        start=start[order], length=length, block=block[order], load_coefficient=load,
        motion=motion, joints=joints, torque_per_current=drive.torque_per_current)
    return replace(rows, coverage=replace(coverage, transition=choose_transition(rows))), settings


def choose_transition(rows: Rows) -> float:
    """Return the velocity in rad/s over which friction changes sign: tanh(v/transition)."""
    speed = rows.coverage.speed
    part, target = rows.samples.take(rows.start), rows.averaged(rows.target)
    if rows.load_coefficient:
        part = part.with_(load=None)
    best = (math.inf, speed)
    for width in np.geomspace(0.001, 0.25, 12) * speed:
        error = held_out_error(recorded_motion.plain_columns(part, [width]), target, rows.block)
        if error < (1.0 - thresholds.EQUIVALENT) * best[0]:
            best = (error, float(width))
    return best[1]


def coverage_of(samples: Samples, usable: np.ndarray, slowest: float, raw: Samples) -> Coverage:
    """Return the ranges that recordings cover; only the raw positions show the encoder's counts."""
    moving = samples.take(usable)
    # Only within one recording can a time constant be observed.
    duration = max(float(np.ptp(samples.time[samples.recording == r]))
                   for r in np.unique(samples.recording))
    lowest, highest = np.percentile(moving.position, (1, 99))
    velocity = np.asarray(moving.velocity)
    moves = np.abs(velocity)
    # How far the joint moved, against its range, of a turn at most.
    path, span = float(moves.sum()) * samples.sample_time, float(np.ptp(moving.position))
    slow, speed = np.percentile(moves, (5, 95))
    resting = np.abs(np.asarray(samples.velocity)) < slowest
    temperature, temperature_span = 25.0, 0.0
    if samples.temperature is not None:
        temperature = float(np.median(samples.temperature))
        temperature_span = float(np.ptp(np.percentile(samples.temperature[usable], (1, 99))))
    return Coverage(
        transition=0.05 * float(speed), speed=float(speed), slowest=slowest, lowest=float(lowest),
        highest=float(highest), duration=duration, temperature=temperature,
        resolution=raw.position_step,
        both_directions=0.02 < float(np.mean(velocity > 0)) < 0.98,
        passed_again=1.0 - 1.0 / max(path / min(span, 2.0 * math.pi), 1.0), slow=float(slow),
        reversals=float(np.count_nonzero(np.diff(np.sign(velocity)))),
        rest_duration=float(np.sum(resting)) * samples.sample_time,
        distinct_positions=positions(raw.position[usable]),
        median_speed=float(np.median(moves)), temperature_span=temperature_span,
        speed_spread=float(np.std(moves) / np.mean(moves)))
