# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings made ready for fitting: motion, what is usable, and what is held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import math
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.differentiation import METHOD
from friction_comp.model.effects import Scene
from friction_comp.refinement.prepare.folds import Folds
from friction_comp.samples import Samples

if TYPE_CHECKING:
    from friction_comp.drive import Drive

FEWEST = 200
# Rows that effects are searched on, and those that what was found is fitted to at last: how fast
# friction turns round shows the better the less the samples were averaged.
_MOST_ROWS, FINAL_ROWS = 12000, 24000
_SLOWEST_RATE = 100.0
_SIGNALS = ('time', 'position', 'velocity', 'acceleration', 'current', 'load', 'temperature',
            'rigid_body', 'coupling')


@dataclass(frozen=True)
class Measured:
    """Samples that a sum of effects is to explain.

    Parameters
    ----------
    samples : Samples
        Averaged over `window`, with velocity and acceleration.
    usable : ndarray of bool, shape (N,)
        Where the joint moves and the current is neither clipped nor missing.
    window : float
        Time in s over which samples were averaged; 0 where they were not.
    scene : Scene
    load_coefficient : float
        A per N·m of load by which the motor is spared, where mechanics is relied on for it: see
        `load_compensation.carried_by_a_person`.
    known : dict
        What was worked out on these data: see `remembered`.
    """

    samples: Samples
    usable: np.ndarray
    window: float
    scene: Scene
    load_coefficient: float = 0.0
    known: dict[Any, Any] = field(default_factory=dict, kw_only=True, repr=False, compare=False)

    @property
    def target(self) -> np.ndarray:
        """Current in A that the motion has to explain: without the share of the load, (N,)."""
        if not self.load_coefficient:
            return self.samples.current
        return self.samples.current - self.load_coefficient * self.samples.load


@dataclass(frozen=True)
class FitData(Measured):
    """Samples to choose effects on, and the folds they fall into.

    Parameters
    ----------
    folds : Folds
    origin : ndarray of int, shape (N,)
        Which of the original samples each one begins at.
    """

    folds: Folds = field(kw_only=True)
    origin: np.ndarray = field(kw_only=True)

    @property
    def fold(self) -> np.ndarray:
        """The fold of each sample, 0 or 1, shape (N,)."""
        return self.folds.fold

    def fit_rows(self, fold: int) -> np.ndarray:
        """Return which samples the model that predicts a fold is fitted on."""
        return self.usable & (self.fold != fold) & ~self.folds.guard


def join(recordings: Sequence[Samples]) -> Samples | None:
    """Return recordings as one `Samples`, non-finite samples dropped.

    Raises
    ------
    InputError
        If there is too little to fit anything on.
    """
    # By what they hold, so that the order in which files are named makes no difference.
    recordings = sorted((part for part in recordings if len(part)), key=lambda part: (
        len(part), *map(float, part.position[:2]), *map(float, part.current[:2])))
    if not recordings:
        raise InputError('the recordings hold no samples')
    samples = Samples.concatenate(recordings) if len(recordings) > 1 else recordings[0]
    fine = np.isfinite(samples.time) & np.isfinite(samples.position)
    fine &= np.isfinite(samples.current)
    for name in ('velocity', 'load', 'temperature'):
        values = getattr(samples, name)
        if values is None:
            continue
        share = np.mean(np.isfinite(values))
        if share < 0.5:
            samples = samples.with_(**{name: None})
        else:
            fine &= np.isfinite(values)
    samples = samples if fine.all() else samples.take(fine)
    if len(samples) < FEWEST:
        raise InputError(f'{len(samples)} usable samples are too few: at least {FEWEST} are needed')
    if np.ptp(samples.position) == 0:
        raise InputError('the joint never moves in the recordings: there is no friction to fit')
    return samples


def sticking_speed(samples: Samples) -> float:
    """Return the speed in rad/s below which the joint counts as standing still.

    Where the joint sticks, current is whatever it happens to be and tells nothing of friction.
    The threshold is a hundredth of the usual top speed, or more where the resolution of position
    does not let slower motion be told from rest.
    """
    speed = np.abs(samples.velocity)
    top = float(np.percentile(speed, 95))
    quiet = speed[speed < 0.02 * top]
    noise = 3.0 * float(np.sqrt(np.mean(quiet ** 2))) if quiet.size > 50 else 0.0
    return float(min(max(0.01 * top, noise), 0.05 * top))


def in_motion(samples: Samples, slowest: float, settings: dict[str, Any]) -> np.ndarray:
    """Return which samples show friction: the joint moves, and has moved for a moment.

    Beside standstill, the smoothing of the positions blends rest and motion over about the
    inverse of its bandwidth. Those samples are left out as well, unless so much of the recording
    is near a reversal that little else would remain.
    """
    moving = np.abs(samples.velocity) > slowest
    bandwidth = settings.get('bandwidth')
    if not bandwidth:
        return moving
    width = round(0.5 / (bandwidth * samples.sample_time))
    sums = np.concatenate(([0], np.cumsum(~moving)))
    place = np.arange(len(moving))
    near = sums[np.minimum(place + width + 1, len(moving))] - sums[np.maximum(place - width, 0)]
    inner = moving & (near == 0)
    return inner if inner.sum() > 0.8 * moving.sum() else moving


def beside_gaps(samples: Samples, settings: dict[str, Any]) -> np.ndarray:
    """Return which samples are so near an end of unbroken data that smoothing knows one side only.

    There the positions' noise goes into velocity, and more so into acceleration, undamped.

    Parameters
    ----------
    samples : Samples
    settings : dict
        How velocity is derived from position.
    """
    mark = np.zeros(len(samples), dtype=bool)
    bandwidth = settings.get('bandwidth')
    if bandwidth and samples.sample_time > 0:
        width = max(1, round(0.5 / (bandwidth * samples.sample_time)))
        for part in samples.segments():
            mark[part.start:min(part.start + width, part.stop)] = True
            mark[max(part.stop - width, part.start):part.stop] = True
    return mark


def without_few(rows: np.ndarray, unwanted: np.ndarray) -> np.ndarray:
    """Return rows without the unwanted ones, unless these are more than a fifth of them."""
    wanted = rows & ~unwanted
    return wanted if wanted.sum() > 0.8 * rows.sum() else rows


def clipped(current: np.ndarray) -> np.ndarray:
    """Return which samples sit at the very limits of the current signal, shape (N,).

    A limit counts as one where its exact value (to a millionth of the range) is met in a run of
    samples, which a signal with noise does not do unless it is cut off.
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


def bandwidths(samples: Samples) -> list[Any]:
    """Return the differentiation settings worth comparing."""
    rate = 1.0 / max(samples.sample_time, 1e-9)
    choices = [value for value in (5.0, 10.0, 20.0, 40.0, 80.0, 120.0, 200.0)
               if value <= 0.3 * rate]
    sources = ['position']
    if samples.velocity is not None and np.any(samples.velocity):
        sources.append('velocity')
    return [{'method': METHOD, 'source': source, 'bandwidth': value}
            for source in sources for value in [*choices, None]]


def thinned(samples: Samples, usable: np.ndarray, most: int = _MOST_ROWS
            ) -> tuple[Samples, np.ndarray, float, np.ndarray]:
    """Return samples averaged, and if need be sampled in stretches, to a manageable number.

    Parameters
    ----------
    samples : Samples
    usable : ndarray of bool, shape (N,)
    most : int
        Samples that are manageable; up to twice as many where they came slowly.

    Returns
    -------
    Samples, ndarray of bool, float, ndarray of int
        What is left, which of it is usable, the averaging time in s, and where in the original
        each sample begins.
    """
    factor = math.ceil(len(samples) / most)
    rate = 1.0 / max(samples.sample_time, 1e-9)
    factor = max(1, min(factor, int(rate / _SLOWEST_RATE)))
    origin = np.arange(len(samples))
    if factor > 1:
        samples, usable, origin = _averaged(samples, usable, factor)
    if len(samples) > 2 * most:
        chunk = 400
        every = math.ceil(len(samples) / (2 * most))
        keep = (np.arange(len(samples)) // chunk) % every == 0
        samples, usable, origin = samples.take(keep), usable[keep], origin[keep]
    return samples, usable, factor / rate if factor > 1 else 0.0, origin


def _averaged(samples: Samples, usable: np.ndarray,
              factor: int) -> tuple[Samples, np.ndarray, np.ndarray]:
    pieces: dict[str, Any] = {name: [] for name in _SIGNALS if getattr(samples, name) is not None}
    kept, numbers, origin = [], [], []
    for part in samples.segments():
        rows = (part.stop - part.start) // factor
        if rows == 0:
            continue
        cut = slice(part.start, part.start + rows * factor)
        for name, values in pieces.items():
            values.append(getattr(samples, name)[cut].reshape(rows, factor).mean(axis=1))
        kept.append(usable[cut].reshape(rows, factor).all(axis=1))
        numbers.append(samples.recording[cut][::factor])
        origin.append(np.arange(cut.start, cut.stop, factor))
    joined: dict[str, Any] = {name: np.concatenate(values) for name, values in pieces.items()}
    result = Samples(recording=np.concatenate(numbers), joint=samples.joint, **joined)
    return result, np.concatenate(kept), np.concatenate(origin)


def scene_of(samples: Samples, usable: np.ndarray, drive: Drive, slowest: float) -> Scene:
    """Return the `Scene` of samples as they were recorded, with velocity and acceleration."""
    moving = samples.take(usable)
    # The longest recording alone tells how far time constants can be seen.
    duration = max(float(np.ptp(samples.time[samples.recording == r]))
                   for r in np.unique(samples.recording))
    steps = np.abs(np.diff(samples.position[:20000]))
    steps = steps[steps > 1e-12]
    lowest, highest = np.percentile(moving.position, (1, 99))
    slow, speed = np.percentile(np.abs(moving.velocity), (5, 95))
    side = np.sign(moving.velocity)
    moves = np.abs(moving.velocity)
    return Scene(
        transition=0.05 * float(speed), speed=float(speed),
        slowest=slowest, lowest=float(lowest), highest=float(highest), duration=duration,
        sample_time=samples.sample_time,
        temperature=(25.0 if samples.temperature is None
                     else float(np.median(samples.temperature))),
        gear_ratio=drive.gear_ratio,
        resolution=float(steps.min()) if steps.size else 0.0,
        both_directions=0.02 < float(np.mean(moving.velocity > 0)) < 0.98,
        slow=float(slow), reversals=float(np.count_nonzero(np.diff(side))),
        rested=float(np.sum(np.abs(samples.velocity) < slowest)) * samples.sample_time,
        positions=distinct(moving.position),
        usual_speed=float(np.median(moves)),
        speed_spread=float(np.std(moves) / np.mean(moves)),
        temperature_span=(0.0 if moving.temperature is None else
                          float(np.ptp(np.percentile(moving.temperature, (1, 99))))))


def distinct(position: np.ndarray) -> float:
    """Return how many positions the encoder tells apart over the range that was moved.

    That is how many different values there are: few samples on a fine encoder have few values
    too, but hardly any twice.
    """
    values = np.unique(np.round(position / max(float(np.ptp(position)), 1e-300), 9))
    return math.inf if len(values) > 0.5 * len(position) else float(len(values))


def with_transition(scene: Scene, transition: float, sample_time: float) -> Scene:
    """Return a scene with the velocity over which friction was seen to change its sign."""
    return replace(scene, transition=transition, sample_time=sample_time)
