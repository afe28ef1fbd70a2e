# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Prepares recordings as rows of a fit, each in a long block of time.

The time between current and motion, and the velocity over which friction changes sign, are chosen
by how well a plain drive predicts blocks that were not fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import functools
import math
from typing import Any
import warnings

import numpy as np
from scipy.cluster.vq import kmeans2

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.arm.states import moving_states
from friction_comp.model.differentiation import differentiate, earlier
from friction_comp.model.effects import Scene
from friction_comp.refinement.plain_drive import held_out, plain_columns, sums_of, TRANSITIONS
from friction_comp.refinement.recorded_motion import (
    blocks_of,
    choose_motion,
    excerpt,
    in_motion,
    moving_joints,
    row_starts,
    settings_for_arm,
    smooth_motion,
    standstill_speed,
)
from friction_comp.refinement.thresholds import EQUIVALENT, FEWEST_SAMPLES, ROWS
from friction_comp.samples import Samples

_SLOWEST_RATE = 100.0
_REGIONS = 3
# Most rows that are searched, in multiples of `ROWS`; and how many consecutive rows are kept or
# left out together where there are more.
_MOST, _PIECE = 4.0, 100
_SIGNALS = ('velocity', 'load', 'temperature')


@dataclass(frozen=True)
class Rows:
    """The data of a fit: averages over a few samples each, in blocks.

    Parameters
    ----------
    samples : Samples
        All samples, with velocity and acceleration.
    target : ndarray, shape (N,)
        Current that the model has to explain, A.
    usable : ndarray of bool, shape (N,)
        Samples that are fitted.
    clipped : ndarray of bool, shape (N,)
        Samples at a limit of the current; none of them is usable.
    scene : Scene
    start : ndarray of int, shape (R,)
        First sample of each row.
    length : int
        Samples averaged in each row.
    block : ndarray of int, shape (R,)
        Block of time of each row.
    region : ndarray of int, shape (R,)
        Region of posture of each row where several joints moved; otherwise zeros.
    load_by_mechanics : float
        Current per load, A/(N·m), where the load is part of the target; otherwise 0.
    motion : tuple of ndarray, shape (N, J), optional
        Position, velocity and acceleration of all joints of an arm.
    joints : tuple of str
        Names of these joints.
    """

    samples: Samples
    target: np.ndarray
    usable: np.ndarray
    clipped: np.ndarray
    scene: Scene
    start: np.ndarray
    length: int
    block: np.ndarray
    region: np.ndarray
    load_by_mechanics: float = 0.0
    motion: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
    joints: tuple[str, ...] = ()

    @functools.cached_property
    def at_rows(self) -> Samples:
        """The averages of the signals over each row."""
        names = ('time', 'position', 'velocity', 'acceleration', 'load', 'temperature')
        known: Any = {name: self.averaged(getattr(self.samples, name)) for name in names
                      if getattr(self.samples, name) is not None}
        return Samples(current=self.averaged(self.samples.current), joint=self.samples.joint,
                       recording=self.samples.recording[self.start], **known)

    def averaged(self, values: np.ndarray) -> np.ndarray:
        """Return averages of values, shape (N,) or (N, M), over each row's samples."""
        if self.length == 1:
            return values[self.start]
        total = values[self.start].copy()
        for k in range(1, self.length):
            total += values[self.start + k]
        return total / self.length


def join(recordings: Sequence[Samples]) -> Samples:
    """Join recordings to one `Samples`, without samples that are not finite.

    Raises
    ------
    InputError
        If there are too few samples or no motion.
    """
    # Sorted by content, so that the order in which files are named makes no difference.
    recordings = sorted((part for part in recordings if len(part)), key=lambda part: (
        len(part), *map(float, part.position[:2]), *map(float, part.current[:2])))
    if not recordings:
        raise InputError('the recordings hold no samples')
    samples = Samples.concatenate(recordings) if len(recordings) > 1 else recordings[0]
    valid = np.isfinite(samples.time) & np.isfinite(samples.position)
    valid &= np.isfinite(samples.current)
    for name in _SIGNALS:
        values = getattr(samples, name)
        if values is None:
            continue
        if np.mean(np.isfinite(values)) < 0.5:
            samples = samples.with_(**{name: None})
        else:
            valid &= np.isfinite(values)
    samples = samples if valid.all() else samples.take(valid)
    if len(samples) < FEWEST_SAMPLES:
        raise InputError(f'{len(samples)} usable samples are too few: at least '
                         f'{FEWEST_SAMPLES:.0f} are needed')
    if np.ptp(samples.position) == 0:
        raise InputError('the joint never moves in the recordings: there is no friction to fit')
    return samples


def clipped(current: np.ndarray) -> np.ndarray:
    """Return which samples sit at the limits of the current signal, shape (N,).

    An extreme value is a limit where runs of samples repeat it exactly, which a noisy signal does
    only when it is clipped.
    """
    mark = np.zeros(len(current), dtype=bool)
    span = float(np.ptp(current))
    if span == 0:
        return mark
    for extreme in (current.max(), current.min()):
        at_limit = np.abs(current - extreme) <= 1e-6 * span
        runs = at_limit[1:] & at_limit[:-1]
        if at_limit.sum() >= max(20, 1e-3 * len(current)) and runs.sum() >= 0.5 * at_limit.sum():
            mark |= at_limit
    return mark


def blocks_of_samples(rows: Rows) -> np.ndarray:
    """Return the block of each sample, shape (N,)."""
    first = np.nonzero(np.diff(rows.block, prepend=-1))[0]
    return np.clip(np.searchsorted(rows.start[first], np.arange(len(rows.samples)),
                                   side='right') - 1, 0, None)


def regions_of(position: np.ndarray) -> np.ndarray:
    """Return the region of posture of each row, shape (R,).

    Parameters
    ----------
    position : ndarray, shape (R, J)
        Joint positions, rad.
    """
    scaled = (position - position.mean(axis=0)) / (position.std(axis=0) + 1e-9)
    with warnings.catch_warnings():
        # Regions may be empty.
        warnings.simplefilter('ignore', UserWarning)
        return np.asarray(kmeans2(scaled, _REGIONS, minit='++', seed=0)[1])


def samples_per_row(samples: Samples, usable: int) -> int:
    """Return the fewest samples per row for which at most `ROWS` remain, at 100 Hz or more."""
    rate = 1.0 / max(samples.sample_time, 1e-9)
    return max(1, min(math.ceil(usable / ROWS), int(rate / _SLOWEST_RATE)))


def thin_out(start: np.ndarray) -> np.ndarray:
    """Return the starts of at most as many rows as are searched, in pieces from all over.

    Parameters
    ----------
    start : ndarray of int, shape (R,)
    """
    share = _MOST * ROWS / max(len(start), 1)
    if share >= 1.0:
        return start
    # Multiples of the golden ratio, modulo 1, are evenly distributed without a period.
    return start[(np.arange(len(start)) // _PIECE * 0.5 * (math.sqrt(5.0) - 1.0)) % 1.0 < share]


def prepare(samples: Samples, drive: Drive, settings: dict[str, Any] | None = None,
            declared: bool = True) -> tuple[Rows, dict[str, Any]]:
    """Return the rows that effects are fitted to, and the differentiation settings.

    Parameters
    ----------
    samples : Samples
        As recorded, joined.
    drive : Drive
    settings : dict, optional
        Differentiation settings; chosen when omitted.
    declared : bool
        Whether the drive's torque constant and gear ratio are known.
    """
    unusable = clipped(samples.current)
    joints = moving_joints(samples)
    load = load_by_mechanics(samples, unusable, drive) if declared else 0.0
    settings = settings or choose_motion(samples, unusable, joints, load)
    moved = differentiate(samples, settings)
    slowest = standstill_speed(moved)
    usable = in_motion(moved, unusable, slowest, settings['bandwidth'])
    motion = None
    if joints:
        motion = moving_states(samples, joints, settings_for_arm(samples, settings))
    length = samples_per_row(moved, int(usable.sum()))
    start = thin_out(row_starts(moved, usable, length))
    block = blocks_of(moved, start)
    target = moved.current - load * np.asarray(moved.load) if load else moved.current
    scene = scene_of(moved, usable, drive, slowest)
    region = regions_of(motion[0][start]) if motion else np.zeros_like(block)
    rows = Rows(moved, target, usable, unusable, scene, start, length, block, region, load, motion,
                tuple(joints))
    transition = choose_transition(rows)
    return replace(rows, scene=replace(scene, transition=transition)), settings


def with_settings(rows: Rows, raw: Samples, settings: dict[str, Any]) -> Rows:
    """Return the rows with the motion of other differentiation settings."""
    motion = None
    if rows.joints:
        motion = moving_states(raw, list(rows.joints), settings_for_arm(raw, settings))
    return replace(rows, samples=differentiate(raw, settings), motion=motion)


def shifted(values: np.ndarray, samples: Samples, lag: float) -> np.ndarray:
    """Return the values at the time t + lag."""
    return earlier(values, samples, lag) if lag else values


def load_by_mechanics(samples: Samples, unusable: np.ndarray, drive: Drive) -> float:
    """Return the current per load, A/(N·m), where it cannot be fitted; otherwise 0.

    By J·a = k_t·n·i + τ_b - F, friction shows in i + τ_b/(k_t·n). Where the motor carries the load,
    a fit of the current gives a coefficient near -1/(k_t·n). Where the person carries it, and the
    current is a function of the motion (a compensation law) or zero, the fit gives a coefficient
    near zero, and the load enters with -1/(k_t·n) instead.
    """
    if samples.load is None or not np.any(samples.load):
        return 0.0
    mechanics = -1.0 / drive.torque_per_current
    moved, start = smooth_motion(*excerpt(samples, unusable))
    part = moved.take(start)
    top_speed = float(np.percentile(np.abs(np.asarray(part.velocity)), 95))
    columns = plain_columns(part.with_(load=None), [share * top_speed for share in TRANSITIONS])
    columns = np.column_stack((columns, np.asarray(part.load)))
    coefficient = sums_of(columns, part.current, blocks_of(moved, start)).fit(
        range(columns.shape[1]))[-1]
    return 0.0 if coefficient / mechanics > 0.5 else mechanics


def choose_transition(rows: Rows) -> float:
    """Return the velocity in rad/s over which friction changes sign: tanh(v/transition)."""
    speed = rows.scene.speed
    part = rows.samples.take(rows.start)
    target = rows.averaged(rows.target)
    best = (math.inf, speed)
    for width in np.geomspace(0.001, 0.25, 12) * speed:
        columns = plain_columns(part.with_(load=None) if rows.load_by_mechanics else part, [width])
        error = held_out(columns, target, rows.block).sum()
        if error < (1.0 - EQUIVALENT) * best[0]:
            best = (float(error), float(width))
    return best[1]


def scene_of(samples: Samples, usable: np.ndarray, drive: Drive, slowest: float) -> Scene:
    """Return the ranges that recordings cover."""
    moving = samples.take(usable)
    # Only within one recording can a time constant be observed.
    duration = max(float(np.ptp(samples.time[samples.recording == r]))
                   for r in np.unique(samples.recording))
    steps = np.abs(np.diff(samples.position[:20000]))
    steps = steps[steps > 1e-12]
    lowest, highest = np.percentile(moving.position, (1, 99))
    velocity = np.asarray(moving.velocity)
    moves = np.abs(velocity)
    slow, speed = np.percentile(moves, (5, 95))
    return Scene(
        transition=0.05 * float(speed), speed=float(speed),
        slowest=slowest, lowest=float(lowest), highest=float(highest), duration=duration,
        sample_time=samples.sample_time,
        temperature=(25.0 if samples.temperature is None
                     else float(np.median(samples.temperature))),
        gear_ratio=drive.gear_ratio,
        resolution=float(steps.min()) if steps.size else 0.0,
        both_directions=0.02 < float(np.mean(velocity > 0)) < 0.98,
        slow=float(slow), reversals=float(np.count_nonzero(np.diff(np.sign(velocity)))),
        rested=float(np.sum(np.abs(np.asarray(samples.velocity)) < slowest))
        * samples.sample_time,
        positions=count_positions(moving.position),
        usual_speed=float(np.median(moves)),
        speed_spread=float(np.std(moves) / np.mean(moves)),
        temperature_span=(0.0 if moving.temperature is None else
                          float(np.ptp(np.percentile(moving.temperature, (1, 99))))))


def count_positions(position: np.ndarray) -> float:
    """Return the number of positions that the encoder resolves over the range of motion.

    Infinite where hardly any value occurs twice: the encoder is finer than the samples show.
    """
    values = np.unique(np.round(position / max(float(np.ptp(position)), 1e-300), 9))
    return math.inf if len(values) > 0.5 * len(position) else float(len(values))
