# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Velocity and acceleration of a recording, and which samples show friction.

Both come from one zero-phase filter. Its source and bandwidth are chosen by how well a plain drive
predicts blocks that were not fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.arm.states import moving_states
from friction_comp.model.differentiation import differentiate, METHOD
from friction_comp.refinement.plain_drive import held_out, plain_columns, TRANSITIONS
from friction_comp.refinement.thresholds import BLOCKS, EQUIVALENT, FEWEST_SAMPLES
from friction_comp.samples import Samples

BANDWIDTHS = (5.0, 10.0, 20.0, 40.0, 80.0, 120.0, 200.0)
_EXCERPT = 150_000
# Beside a rest of this many s and for as long, motion slower than this share of the top speed.
_START, _SLOW = 0.1, 0.05


def differentiations(samples: Samples) -> list[dict[str, Any]]:
    """Return the differentiation settings that are compared."""
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


def dilate(mark: np.ndarray, width: int) -> np.ndarray:
    """Return which samples are within so many samples of marked ones, shape (N,)."""
    if width < 1:
        return mark
    sums = np.concatenate(([0], np.cumsum(mark)))
    row = np.arange(len(mark))
    low, high = np.maximum(row - width, 0), np.minimum(row + width + 1, len(mark))
    return sums[high] > sums[low]


def long_rests(still: np.ndarray, length: int) -> np.ndarray:
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
    starts = dilate(long_rests(still, near), near) & (speed < _SLOW * np.percentile(speed, 95))
    for mark in (dilate(still, blurred), dilate(ends, blurred), starts):
        inner = moving & ~mark
        if inner.sum() > 0.8 * moving.sum():
            moving = inner
    if moving.sum() < FEWEST_SAMPLES:
        raise InputError('the joint hardly moves in the recordings: '
                         f'{int(moving.sum())} samples of motion are too few')
    return moving


def blocks_of(samples: Samples, start: np.ndarray, count: int = int(BLOCKS)) -> np.ndarray:
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
    for edge in np.linspace(0, size, count + 1)[1:-1]:
        near = between[np.argmin(np.abs(between - edge))] if len(between) else -size
        edges.append(int(near if abs(near - edge) < size / count / 3.0 else edge))
    return np.searchsorted(np.unique(edges), np.arange(size), side='right')


def row_starts(samples: Samples, usable: np.ndarray, length: int) -> np.ndarray:
    """Return the first sample of each row of so many consecutive usable samples."""
    starts = []
    for part in samples.segments():
        count = (part.stop - part.start) // length
        cut = usable[part.start:part.start + count * length].reshape(count, length).all(axis=1)
        starts.append(part.start + length * np.nonzero(cut)[0])
    return np.concatenate(starts) if starts else np.empty(0, dtype=int)


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
    fast = usable & (speed > TRANSITIONS[1] * np.percentile(speed[usable], 95))
    # Where friction changes its sign a smooth velocity hides what happens.
    usable = fast if fast.sum() > 0.5 * usable.sum() else usable
    return moved, row_starts(samples, usable, 1)[::max(1, int(usable.sum()) // 12000)]


def choose_motion(samples: Samples, unusable: np.ndarray, joints: Sequence[str], load: float
                  ) -> dict[str, Any]:
    """Return the differentiation settings with which a plain drive predicts other blocks best.

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
            motion = tuple(one[start] for one in moving_states(samples, joints, settings_for_arm(
                samples, choice)))
        part = moved.take(start)
        columns = plain_columns(part, [share * top for share in TRANSITIONS], motion,
                                list(joints).index(samples.joint) if joints else 0)
        errors.append((float(held_out(columns, part.current, block).sum()), len(errors), choice))
    least = min(error for error, *_ in errors)
    # Narrower than needed blunts reversals: the widest of those that are as good. What explains
    # little of the current says little of a bandwidth.
    open_share = least / max(float(np.sum((samples.current[start]) ** 2)), 1e-300)
    return max(((choice['bandwidth'] or math.inf, order, choice) for error, order, choice in errors
                if error <= ((1.0 + EQUIVALENT) ** 2 + 0.4 * open_share) * least))[-1]


def settings_for_arm(samples: Samples, settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings for the motion of all joints, whose velocity may not be recorded."""
    if samples.arm is not None and samples.arm.velocity is None:
        return {**settings, 'source': 'position'}
    return dict(settings)


def moving_joints(samples: Samples) -> list[str]:
    """Return all joints that moved, where no rigid bodies are known; or none."""
    known = samples.rigid_body is not None or samples.coupling is not None
    if samples.arm is None or known or samples.joint not in samples.arm.joints:
        return []
    span = np.ptp(samples.arm.position, axis=0)
    names = [name for name, moved in zip(samples.arm.joints, span)
             if moved > 1e-3 or name == samples.joint]
    return names if len(names) > 1 else []
