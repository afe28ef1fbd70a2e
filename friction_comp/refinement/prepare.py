# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""From recordings to rows: motion, target, and which samples show friction.

Velocity and acceleration come from one zero-phase filter. Its source and bandwidth, the time
between current and motion and the velocity over which friction changes sign are chosen by the
error of a plain drive (Eq. 6, inertia, weight, load) on blocks that were not fitted.
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
from friction_comp.model.differentiation import differentiate, earlier, METHOD
from friction_comp.model.effects import Scene
from friction_comp.refinement.sums import BlockSums
from friction_comp.refinement.thresholds import BLOCKS, FEWEST, ROWS, SAME
from friction_comp.samples import Samples

BANDWIDTHS = (5.0, 10.0, 20.0, 40.0, 80.0, 120.0, 200.0)
_SLOWEST_RATE = 100.0
_EXCERPT = 150_000
# Shares of the top speed over which friction may change sign.
_TURNS = (0.3, 0.1, 0.03, 0.01, 0.003)
_REGIONS = 3
# Beside a rest of this many s and for as long, motion slower than this share of the top speed.
_START, _SLOW = 0.1, 0.05
_SIGNALS = ('velocity', 'load', 'temperature')


@dataclass(frozen=True)
class Rows:
    """What a fit sees: averages over a few samples each, in blocks.

    Parameters
    ----------
    samples : Samples
        All samples, with velocity and acceleration.
    target : ndarray, shape (N,)
        Current that the motion has to explain.
    usable : ndarray of bool, shape (N,)
    clipped : ndarray of bool, shape (N,)
        Samples at a limit of the current, none of them usable.
    scene : Scene
    start : ndarray of int, shape (R,)
        First sample of each row.
    length : int
        Samples averaged in each row.
    block : ndarray of int, shape (R,)
        Which long piece of time each row is in.
    region : ndarray of int, shape (R,)
        Which region of posture each row is in, where several joints moved; zeros else.
    load_by_mechanics : float
        A per N·m of load, where the load is part of the target; else 0.
    motion : tuple of ndarray, shape (N, J), optional
        Position, velocity and acceleration of all joints of an arm.
    joints : tuple of str
        Their names.
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
        """The averages of position, velocity and load over each row."""
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
    """Return recordings as one `Samples`, without samples that are not finite.

    Raises
    ------
    InputError
        If there is too little to fit anything to.
    """
    # By what they hold, so that the order in which files are named makes no difference.
    recordings = sorted((part for part in recordings if len(part)), key=lambda part: (
        len(part), *map(float, part.position[:2]), *map(float, part.current[:2])))
    if not recordings:
        raise InputError('the recordings hold no samples')
    samples = Samples.concatenate(recordings) if len(recordings) > 1 else recordings[0]
    fine = np.isfinite(samples.time) & np.isfinite(samples.position)
    fine &= np.isfinite(samples.current)
    for name in _SIGNALS:
        values = getattr(samples, name)
        if values is None:
            continue
        if np.mean(np.isfinite(values)) < 0.5:
            samples = samples.with_(**{name: None})
        else:
            fine &= np.isfinite(values)
    samples = samples if fine.all() else samples.take(fine)
    if len(samples) < FEWEST:
        raise InputError(f'{len(samples)} usable samples are too few: at least {FEWEST:.0f} are '
                         'needed')
    if np.ptp(samples.position) == 0:
        raise InputError('the joint never moves in the recordings: there is no friction to fit')
    return samples


def clipped(current: np.ndarray) -> np.ndarray:
    """Return which samples sit at the limits of the current signal, shape (N,).

    A limit counts as one where its exact value is repeated in a run of samples, which a signal
    with noise does not do unless it is cut off.
    """
    mark = np.zeros(len(current), dtype=bool)
    span = float(np.ptp(current))
    if span == 0:
        return mark
    for extreme in (current.max(), current.min()):
        at = np.abs(current - extreme) <= 1e-6 * span
        runs = at[1:] & at[:-1]
        if at.sum() >= max(20, 1e-3 * len(current)) and runs.sum() >= 0.5 * at.sum():
            mark |= at
    return mark


def differentiations(samples: Samples) -> list[dict[str, Any]]:
    """Return the ways to differentiate that are compared."""
    rate = 1.0 / max(samples.sample_time, 1e-9)
    values = [*(value for value in BANDWIDTHS if value <= 0.3 * rate), None]
    sources = ['position']
    if samples.velocity is not None and np.any(samples.velocity):
        sources.append('velocity')
    return [{'method': METHOD, 'source': source, 'bandwidth': value}
            for source in sources for value in values]


def excerpt(samples: Samples, *masks: np.ndarray) -> tuple[Any, ...]:
    """Return pieces from all over the samples, not too many, and the same of masks."""
    size, pieces = len(samples), 15
    if size <= _EXCERPT:
        return (samples, *masks)
    length = _EXCERPT // pieces
    starts = np.linspace(0, size - length, pieces).astype(int)
    keep = np.concatenate([np.arange(start, start + length) for start in starts])
    return (samples.take(keep), *(mask[keep] for mask in masks))


def standstill_speed(samples: Samples) -> float:
    """Return the speed in rad/s below which the joint counts as standing still.

    That is a hundredth of the usual top speed, or more where the resolution of position does not
    let slower motion be told from rest.
    """
    speed = np.abs(np.asarray(samples.velocity))
    top = float(np.percentile(speed, 95))
    quiet = speed[speed < 0.02 * top]
    noise = 3.0 * float(np.sqrt(np.mean(quiet ** 2))) if quiet.size > 50 else 0.0
    return float(min(max(0.01 * top, noise), 0.05 * top))


def beside(mark: np.ndarray, width: int) -> np.ndarray:
    """Return which samples are within so many samples of marked ones, shape (N,)."""
    if width < 1:
        return mark
    sums = np.concatenate(([0], np.cumsum(mark)))
    place = np.arange(len(mark))
    low, high = np.maximum(place - width, 0), np.minimum(place + width + 1, len(mark))
    return sums[high] > sums[low]


def rests(still: np.ndarray, length: int) -> np.ndarray:
    """Return which samples are in a run of standstill of at least so many samples, shape (N,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], still, [False])).astype(int)))
    result = np.zeros(len(still), dtype=bool)
    for first, stop in zip(edges[::2], edges[1::2]):
        result[first:stop] = stop - first >= length
    return result


def in_motion(samples: Samples, unusable: np.ndarray, slowest: float,
              bandwidth: float | None) -> np.ndarray:
    """Return which samples show friction: the joint moves, and filtering does not blur it.

    Beside standstill and beside gaps, the filter mixes in what is no motion over about the inverse
    of its bandwidth; slow motion beside a rest is presliding, where friction still builds up. Those
    samples are left out, unless little else would remain.

    Raises
    ------
    InputError
        If they are too few.
    """
    speed = np.abs(np.asarray(samples.velocity))
    still = speed <= slowest
    moving = ~still & ~unusable
    ends = np.zeros(len(samples), dtype=bool)
    for part in samples.segments():
        ends[[part.start, part.stop - 1]] = True
    blurred = round(0.5 / (bandwidth * samples.sample_time)) if bandwidth else 0
    near = round(_START / max(samples.sample_time, 1e-9))
    starts = beside(rests(still, near), near) & (speed < _SLOW * np.percentile(speed, 95))
    for mark in (beside(still, blurred), beside(ends, blurred), starts):
        inner = moving & ~mark
        if inner.sum() > 0.8 * moving.sum():
            moving = inner
    if moving.sum() < FEWEST:
        raise InputError('the joint hardly moves in the recordings: '
                         f'{int(moving.sum())} samples of motion are too few')
    return moving


def blocks_of(samples: Samples, start: np.ndarray, number: int = int(BLOCKS)) -> np.ndarray:
    """Return the block of each row, shape (R,): long pieces of time with as many rows each.

    An edge between two blocks is moved to the nearest edge between runs (recordings, or data with
    a gap between), where there is one within a third of a block.
    """
    gap = max(0.5, 20.0 * samples.sample_time)
    broken = (np.diff(samples.time) > gap) | (np.diff(samples.time) < 0)
    broken |= np.diff(samples.recording) != 0
    run = np.concatenate(([0], np.cumsum(broken)))[start]
    size = len(start)
    between = np.nonzero(np.diff(run))[0] + 1
    edges = []
    for place in np.linspace(0, size, number + 1)[1:-1]:
        near = between[np.argmin(np.abs(between - place))] if len(between) else -size
        edges.append(int(near if abs(near - place) < size / number / 3.0 else place))
    return np.searchsorted(np.unique(edges), np.arange(size), side='right')


def blocks_of_samples(rows: Rows) -> np.ndarray:
    """Return the block of every sample, shape (N,)."""
    first = np.nonzero(np.diff(rows.block, prepend=-1))[0]
    return np.clip(np.searchsorted(rows.start[first], np.arange(len(rows.samples)),
                                   side='right') - 1, 0, None)


def regions_of(position: np.ndarray) -> np.ndarray:
    """Return which of a few regions of posture each row is in, shape (R,).

    Parameters
    ----------
    position : ndarray, shape (R, J)
        rad.
    """
    spread = (position - position.mean(axis=0)) / (position.std(axis=0) + 1e-9)
    with warnings.catch_warnings():
        # A region without a row is none.
        warnings.simplefilter('ignore', UserWarning)
        return np.asarray(kmeans2(spread, _REGIONS, minit='++', seed=0)[1])


def row_starts(samples: Samples, usable: np.ndarray, length: int) -> np.ndarray:
    """Return the first sample of each row of so many consecutive usable samples."""
    starts = []
    for part in samples.segments():
        number = (part.stop - part.start) // length
        cut = usable[part.start:part.start + number * length].reshape(number, length).all(axis=1)
        starts.append(part.start + length * np.nonzero(cut)[0])
    return np.concatenate(starts) if starts else np.empty(0, dtype=int)


def averaging(samples: Samples, usable: int) -> int:
    """Return how many samples make a row: as few as keep rows manageable, at 100 Hz at least."""
    rate = 1.0 / max(samples.sample_time, 1e-9)
    return max(1, min(math.ceil(usable / ROWS), int(rate / _SLOWEST_RATE)))


def plain_columns(samples: Samples, transitions: Sequence[float],
                  motion: tuple[np.ndarray, ...] | None = None, own: int = 0) -> np.ndarray:
    """Return what the current of any drive depends on: friction, inertia, weight and load."""
    v, q = np.asarray(samples.velocity), samples.position
    columns = [np.ones_like(v), *(np.tanh(v / width) for width in transitions), v,
               samples.acceleration, np.cos(q), np.sin(q)]
    if np.ptp(q) < 2.0:
        columns.append(q)
    if samples.load is not None:
        columns += [samples.load, np.abs(samples.load) * np.tanh(v / transitions[-1])]
    if samples.rigid_body is not None:
        columns += [samples.rigid_body, np.abs(samples.rigid_body) * np.tanh(v / transitions[-1])]
    if motion is not None:
        angles, _, accelerations = motion
        for first in range(own + 1):
            for last in range(own, angles.shape[1]):
                if first < last:
                    total = angles[:, first:last + 1].sum(axis=1)
                    columns += [np.cos(total), np.sin(total)]
        columns += [one for k, one in enumerate(accelerations.T) if k != own]
    return np.column_stack(columns)


def held_out(columns: np.ndarray, target: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Return the squared error of each block by least squares on all others, shape (K,)."""
    return sums_of(columns, target, block).left_out(range(columns.shape[1]))


def sums_of(columns: np.ndarray, target: np.ndarray, block: np.ndarray,
            signs: np.ndarray | None = None, weights: np.ndarray | None = None) -> BlockSums:
    """Return the block sums of columns, shape (R, P), and a target, shape (R,).

    Rows of a block follow each other.
    """
    matrix = np.column_stack((columns, target))
    weighted = matrix if weights is None else matrix * weights[:, None]
    number = int(block.max()) + 1
    edges = np.searchsorted(block, np.arange(number + 1))
    gram = np.array([weighted[a:b].T @ matrix[a:b] for a, b in zip(edges[:-1], edges[1:])])
    if signs is None:
        signs = np.zeros(columns.shape[1], dtype=int)
    return BlockSums(gram, np.diff(edges), signs)


def smooth_motion(samples: Samples, unusable: np.ndarray) -> tuple[Samples, np.ndarray]:
    """Return samples with smooth velocity, and the samples in motion by it, (some of) them.

    What moves is decided by a smooth velocity: unfiltered, an encoder's steps are standstill and
    bursts.
    """
    choices = differentiations(samples)
    smooth = max((one for one in choices if (one['bandwidth'] or np.inf) <= 20.0),
                 key=lambda one: (one['bandwidth'], one['source']), default=choices[-1])
    moved = differentiate(samples, smooth)
    usable = in_motion(moved, unusable, standstill_speed(moved), smooth['bandwidth'])
    speed = np.abs(np.asarray(moved.velocity))
    fast = usable & (speed > _TURNS[1] * np.percentile(speed[usable], 95))
    # Where friction changes its sign a smooth velocity hides what happens.
    usable = fast if fast.sum() > 0.5 * usable.sum() else usable
    return moved, row_starts(samples, usable, 1)[::max(1, int(usable.sum()) // 12000)]


def choose_motion(samples: Samples, unusable: np.ndarray, joints: Sequence[str], load: float
                  ) -> dict[str, Any]:
    """Return the way to differentiate by which a plain drive predicts other blocks best.

    Parameters
    ----------
    samples : Samples
    unusable : ndarray of bool, shape (N,)
    joints : sequence of str
        Joints that moved beside it, its own among them; empty where there are none.
    load : float
        A per N·m, where the load is part of what is predicted.
    """
    samples, unusable = excerpt(samples, unusable)
    if load:
        samples = samples.with_(current=samples.current - load * np.asarray(samples.load),
                                load=None)
    choices = differentiations(samples)
    _, start = smooth_motion(samples, unusable)
    block = blocks_of(samples, start)
    errors: list[tuple[float, int, dict[str, Any]]] = []
    for choice in choices:
        moved = differentiate(samples, choice)
        top = float(np.percentile(np.abs(np.asarray(moved.velocity)[start]), 95))
        if not top > 0.0:
            # Unfiltered, a coarse encoder stands still in nearly all samples.
            continue
        motion = None
        if joints:
            motion = tuple(one[start] for one in moving_states(samples, joints, for_all(
                samples, choice)))
        part = moved.take(start)
        columns = plain_columns(part, [share * top for share in _TURNS], motion,
                                list(joints).index(samples.joint) if joints else 0)
        errors.append((float(held_out(columns, part.current, block).sum()), len(errors), choice))
    least = min(error for error, *_ in errors)
    # Narrower than needed blunts reversals: the widest of those that are as good. What explains
    # little of the current says little of a bandwidth.
    open_share = least / max(float(np.sum((samples.current[start]) ** 2)), 1e-300)
    return max(((choice['bandwidth'] or math.inf, place, choice) for error, place, choice in errors
                if error <= ((1.0 + SAME) ** 2 + 0.4 * open_share) * least))[-1]


def for_all(samples: Samples, settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings for the motion of all joints, whose velocity may not be recorded."""
    if samples.arm is not None and samples.arm.velocity is None:
        return {**settings, 'source': 'position'}
    return dict(settings)


def moved_beside(samples: Samples) -> list[str]:
    """Return all joints that moved, where no links say what they ask of this one; or none."""
    known = samples.rigid_body is not None or samples.coupling is not None
    if samples.arm is None or known or samples.joint not in samples.arm.joints:
        return []
    span = np.ptp(samples.arm.position, axis=0)
    names = [name for name, moved in zip(samples.arm.joints, span)
             if moved > 1e-3 or name == samples.joint]
    return names if len(names) > 1 else []


def prepare(samples: Samples, drive: Drive, settings: dict[str, Any] | None = None,
            declared: bool = True) -> tuple[Rows, dict[str, Any]]:
    """Return the rows that effects are fitted to, and how motion was computed.

    Parameters
    ----------
    samples : Samples
        As recorded, joined.
    drive : Drive
    settings : dict, optional
        How to differentiate; chosen when omitted.
    declared : bool
        Whether the drive's torque constant and gear ratio are known.
    """
    unusable = clipped(samples.current)
    joints = moved_beside(samples)
    load = load_by_mechanics(samples, unusable, drive) if declared else 0.0
    settings = settings or choose_motion(samples, unusable, joints, load)
    moved = differentiate(samples, settings)
    slowest = standstill_speed(moved)
    usable = in_motion(moved, unusable, slowest, settings['bandwidth'])
    motion = None
    if joints:
        motion = moving_states(samples, joints, for_all(samples, settings))
    length = averaging(moved, int(usable.sum()))
    start = row_starts(moved, usable, length)
    block = blocks_of(moved, start)
    target = moved.current - load * np.asarray(moved.load) if load else moved.current
    scene = scene_of(moved, usable, drive, slowest)
    region = regions_of(motion[0][start]) if motion else np.zeros_like(block)
    rows = Rows(moved, target, usable, unusable, scene, start, length, block, region, load, motion,
                tuple(joints))
    transition = choose_transition(rows)
    return replace(rows, scene=replace(scene, transition=transition)), settings


def moved_again(rows: Rows, raw: Samples, settings: dict[str, Any]) -> Rows:
    """Return the same rows with motion computed in another way."""
    motion = None
    if rows.joints:
        motion = moving_states(raw, list(rows.joints), for_all(raw, settings))
    return replace(rows, samples=differentiate(raw, settings), motion=motion)


def shifted(values: np.ndarray, samples: Samples, lag: float) -> np.ndarray:
    """Return values as they will be at the time t + lag."""
    return earlier(values, samples, lag) if lag else values


def load_by_mechanics(samples: Samples, unusable: np.ndarray, drive: Drive) -> float:
    """Return A per N·m of load where the person, and not the motor, carries it; else 0.

    By J·a = k_t·n·i + τ_b - F, friction shows in i + τ_b/(k_t·n). Where the motor carries the load,
    a fit of the current finds a coefficient near -1/(k_t·n) by itself. Where the current is a
    function of the motion, as under a compensation law or with none at all, it finds next to
    nothing, and mechanics has to say what the load is.
    """
    if samples.load is None or not np.any(samples.load):
        return 0.0
    mechanics = -1.0 / drive.torque_per_current
    moved, start = smooth_motion(*excerpt(samples, unusable))
    part = moved.take(start)
    top = float(np.percentile(np.abs(np.asarray(part.velocity)), 95))
    columns = plain_columns(part.with_(load=None), [share * top for share in _TURNS])
    columns = np.column_stack((columns, np.asarray(part.load)))
    found = sums_of(columns, part.current, blocks_of(moved, start)).fit(
        range(columns.shape[1]))[-1]
    return 0.0 if found / mechanics > 0.5 else mechanics


def choose_transition(rows: Rows) -> float:
    """Return the velocity in rad/s over which friction changes sign: tanh(v/transition)."""
    speed = rows.scene.speed
    part = rows.samples.take(rows.start)
    target = rows.averaged(rows.target)
    best = (math.inf, speed)
    for width in np.geomspace(0.001, 0.25, 12) * speed:
        columns = plain_columns(part.with_(load=None) if rows.load_by_mechanics else part, [width])
        error = held_out(columns, target, rows.block).sum()
        if error < (1.0 - SAME) * best[0]:
            best = (float(error), float(width))
    return best[1]


def scene_of(samples: Samples, usable: np.ndarray, drive: Drive, slowest: float) -> Scene:
    """Return what recordings cover."""
    moving = samples.take(usable)
    # The longest recording alone tells how far time constants can be seen.
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
        positions=distinct(moving.position),
        usual_speed=float(np.median(moves)),
        speed_spread=float(np.std(moves) / np.mean(moves)),
        temperature_span=(0.0 if moving.temperature is None else
                          float(np.ptp(np.percentile(moving.temperature, (1, 99))))))


def distinct(position: np.ndarray) -> float:
    """Return how many positions the encoder tells apart over the range that was moved.

    Few samples on a fine encoder have few values too, but hardly any twice: infinite then.
    """
    values = np.unique(np.round(position / max(float(np.ptp(position)), 1e-300), 9))
    return math.inf if len(values) > 0.5 * len(position) else float(len(values))
