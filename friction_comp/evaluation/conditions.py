# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Backdriving torque of recorded trials, evaluated as in the note's section 2.6.

Repetitions are synchronised at the start of the movement, and averaged over each condition: the
announced direction d and the way the movement goes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError
from friction_comp.evaluation.movements import find_movements

if TYPE_CHECKING:
    from friction_comp.evaluation.movements import Movement
    from friction_comp.samples import Samples

# s before a movement that the figure shows, and that count for its peak.
_LEAD, _PEAK_LEAD = 1.0, 0.5
# A joint has started by itself when it covers this share of the movement while the person does
# not push that way, by this share of the torque's peak.
_STARTED, _PUSHED = 0.01, 0.1
# s for which the joint must have been still before; an oscillation is no start.
_STILL = 0.2
_NAMES = {1: 'positive', -1: 'negative'}


@dataclass
class Condition:
    """Ensemble of the repetitions under one condition.

    Attributes
    ----------
    direction : int
        Announced direction d.
    movement : str
        'positive' or 'negative'.
    repetitions : int
    peak_torque : float
        Largest magnitude of the ensemble average of τ_b in N·m, from 0.5 s before the movement
        until it slows down: what it takes to set the joint in motion and keep it there.
    peak_torque_std : float
        Standard deviation over repetitions of each one's own peak in N·m.
    peak_time : float
        When the average peaks, s after the start of the movement.
    rms_torque : float
        Root mean square of τ_b over all repetitions, from start to end of the movement, N·m.
    mean_torque_constant_velocity : float
        Mean of τ_b along the movement in the phase of constant velocity, N·m; negative where the
        joint pulls ahead of the person.
    false_starts : int
        Repetitions in which the joint set out before the movement and nobody pushed.
    time : ndarray
        s since the start of the movement, shape (N,).
    torque, torque_std, position, position_std, reference : ndarray
        Average and standard deviation over repetitions, shape (N,), in N·m and rad; reference is
        None where it was not recorded.
    """

    direction: int
    movement: str
    repetitions: int
    peak_torque: float
    peak_torque_std: float
    peak_time: float
    rms_torque: float
    mean_torque_constant_velocity: float
    false_starts: int
    time: np.ndarray
    torque: np.ndarray
    torque_std: np.ndarray
    position: np.ndarray
    position_std: np.ndarray
    reference: np.ndarray | None = None

    @property
    def assisted(self) -> bool:
        """True where the direction announced is that of the movement."""
        return self.direction == (1 if self.movement == 'positive' else -1)

    def as_dict(self) -> dict[str, Any]:
        """Return the figures without the curves."""
        return {name: getattr(self, name) for name in (
            'direction', 'movement', 'repetitions', 'peak_torque', 'peak_torque_std',
            'peak_time', 'rms_torque', 'mean_torque_constant_velocity', 'false_starts')}


@dataclass
class Evaluation:
    """All conditions of one joint and what the announced direction achieved.

    Attributes
    ----------
    peak_reduction, rms_reduction : float or None
        1 - torque with d = ±1 / torque with d = 0, each the mean over the movements for which both
        are there; None without such a pair.
    notes : list of str
    """

    joint: str
    conditions: list[Condition]
    model: str | None = None
    notes: list[str] = field(default_factory=list)

    def compared(self, name: str) -> tuple[float, float] | None:
        """Return a figure with d = 0 and with d = ±1, or None where nothing can be compared.

        Parameters
        ----------
        name : str
            'peak_torque' or 'rms_torque'.

        Returns
        -------
        tuple of float, or None
            Means over the movements for which both conditions are there, N·m.
        """
        pairs = []
        for movement in _NAMES.values():
            here = [c for c in self.conditions if c.movement == movement]
            plain = [getattr(c, name) for c in here if c.direction == 0]
            assisted = [getattr(c, name) for c in here if c.assisted]
            if plain and assisted:
                pairs.append((plain[0], assisted[0]))
        if not pairs:
            return None
        plain_mean, assisted_mean = np.mean(pairs, axis=0)
        return float(plain_mean), float(assisted_mean)

    def _reduction(self, name: str) -> float | None:
        pair = self.compared(name)
        return 1.0 - pair[1] / pair[0] if pair and pair[0] > 0 else None

    @property
    def peak_reduction(self) -> float | None:
        """Share by which the peak torque is smaller with d = ±1."""
        return self._reduction('peak_torque')

    @property
    def rms_reduction(self) -> float | None:
        """Share by which the RMS torque is smaller with d = ±1."""
        return self._reduction('rms_torque')

    def as_dict(self) -> dict[str, Any]:
        """Return the content of report.json."""
        return {
            'joint': self.joint, 'conditions': [c.as_dict() for c in self.conditions],
            'peak_reduction': self.peak_reduction, 'rms_reduction': self.rms_reduction,
            'model': self.model,
        }


def evaluate(recordings: list[Samples], names: list[str] | None = None,
             model: str | None = None) -> Evaluation:
    """Evaluate trials of one joint.

    Parameters
    ----------
    recordings : list of Samples
        One or more recordings; those under the same condition are merged.
    names : list of str, optional
        What to call the recordings in messages.
    model : str, optional
        The model file that was active.

    Returns
    -------
    Evaluation

    Raises
    ------
    InputError
        If a recording lacks the back-driving torque, or no movement is found.
    """
    names = [str(name) for name in names or [f'recording {k}' for k in range(len(recordings))]]
    if not recordings:
        raise InputError('no recording to evaluate')
    evaluation = Evaluation(recordings[0].joint, [], model)
    groups: dict[tuple[int, int, int], list[tuple[Samples, Movement]]] = {}
    for samples, name in zip(recordings, names):
        if samples.load is None:
            raise InputError(
                f'{name}: no interaction_wrench of joint {samples.joint!r} in it: the back-driving '
                'torque is needed')
        movements = find_movements(samples)
        if not movements:
            raise InputError(f'{name}: no movement of joint {samples.joint!r} found in it')
        if samples.direction is None:
            evaluation.notes.append(f'{name}: no direction was recorded, d = 0 is assumed')
        if samples.reference_position is None and samples.reference_velocity is None:
            evaluation.notes.append(
                f'{name}: no reference was recorded, repetitions begin with the motion itself')
        for movement in movements:
            if movement.end > samples.time[-1] - samples.sample_time and len(movements) > 1:
                evaluation.notes.append(f'{name}: the last movement is cut off and left out')
                continue
            groups.setdefault((abs(movement.direction), movement.direction, -movement.sign),
                              []).append((samples, movement))
    for key in sorted(groups):
        evaluation.conditions.append(_condition(groups[key], evaluation.notes))
    return evaluation


def _condition(repetitions: list[tuple[Samples, Movement]], notes: list[str]) -> Condition:
    durations = np.array([m.end - m.begin for _, m in repetitions])
    usual = float(np.median(durations))
    kept = [r for r, d in zip(repetitions, durations) if abs(d - usual) <= 0.25 * usual]
    first = kept[0][1]
    if len(kept) < len(repetitions):
        notes.append(
            f'{len(repetitions) - len(kept)} repetitions with d = {first.direction} lasted much '
            'longer or shorter than the others and are left out')
    step = max(np.median([s.sample_time for s, _ in kept]), 1e-3)
    time = np.arange(-round(_LEAD / step), round(usual / step) + 1) * step
    torque = _ensemble(kept, 'load', time)
    # The standstill is shown only as far back as every other repetition has it.
    seen = np.isfinite(torque).mean(axis=0) >= 0.5
    time, torque = time[seen], torque[:, seen]
    position = _ensemble(kept, 'position', time)
    reference = None
    if all(s.reference_position is not None for s, _ in kept):
        reference = np.nanmean(_ensemble(kept, 'reference_position', time), axis=0)
    mean, spread = _mean_and_std(torque)
    slowing = np.median([m.constant_end - m.begin for _, m in kept])
    counted = (time >= -_PEAK_LEAD) & (time <= slowing)
    peak = int(np.argmax(np.where(counted, np.abs(mean), -1.0)))
    own_peaks = np.nanmax(np.abs(torque[:, counted]), axis=1)
    moving = torque[:, time >= 0.0]
    constant = (time <= slowing) & (
        time >= np.median([m.constant_begin - m.begin for _, m in kept]))
    middle, deviation = _mean_and_std(position)
    restless = sum(_restless(s, m) for s, m in kept)
    if restless:
        notes.append(
            f'the joint did not come to rest before {restless} of {len(kept)} movements with '
            f'd = {first.direction} in the {_NAMES[first.sign]} direction')
    return Condition(
        direction=first.direction, movement=_NAMES[first.sign], repetitions=len(kept),
        peak_torque=float(abs(mean[peak])),
        peak_torque_std=float(np.std(own_peaks, ddof=1)) if len(kept) > 1 else 0.0,
        peak_time=float(time[peak]), rms_torque=float(np.sqrt(np.nanmean(moving ** 2))),
        mean_torque_constant_velocity=float(first.sign * np.nanmean(mean[constant])),
        false_starts=sum(_started_by_itself(s, m, peak) for (s, m), peak in zip(kept, own_peaks)),
        time=time, torque=mean, torque_std=spread, position=middle, position_std=deviation,
        reference=reference)


def _ensemble(repetitions: list[tuple[Samples, Movement]], name: str,
              time: np.ndarray) -> np.ndarray:
    """Return a signal of every repetition on one time base, shape (R, N); NaN where it has none."""
    rows = []
    for samples, movement in repetitions:
        at = movement.begin + time
        values = np.interp(at, samples.time, getattr(samples, name), left=np.nan, right=np.nan)
        rows.append(np.where(at >= movement.rest_begin, values, np.nan))
    return np.array(rows)


def _mean_and_std(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    spread = np.nanstd(values, axis=0, ddof=1) if len(values) > 1 else np.zeros(values.shape[1])
    return np.nanmean(values, axis=0), np.nan_to_num(spread)


def _restless(samples: Samples, movement: Movement) -> bool:
    """Return whether the joint kept moving to and fro right before the movement."""
    first, last = np.searchsorted(
        samples.time, [max(movement.begin - _PEAK_LEAD, movement.rest_begin), movement.begin])
    travelled = np.abs(np.diff(samples.position[first:last])).sum()
    return bool(travelled > 2.0 * _STARTED * movement.travel)


def _started_by_itself(samples: Samples, movement: Movement, peak: float) -> bool:
    """Return whether the joint set out during the standstill although nobody pushed it."""
    settled = 0.5 * (movement.rest_begin + movement.begin)
    begin = max(settled, movement.begin - _LEAD)
    first, last = np.searchsorted(samples.time, [begin, movement.begin])
    still = np.searchsorted(samples.time, begin + _STILL)
    if not first < still < last:
        return False
    way = samples.position[first:last] - samples.position[first]
    if np.abs(way[:still - first]).max() > 0.2 * _STARTED * movement.travel:
        return False
    gone = np.nonzero(np.abs(way) > _STARTED * movement.travel)[0]
    if not len(gone):
        return False
    onset = first + gone[0]
    before = np.searchsorted(samples.time, samples.time[onset] - 0.1)
    assert samples.load is not None, 'recordings without it were refused'
    push = np.mean(samples.load[before:onset + 1]) * np.sign(way[gone[0]])
    return bool(push < _PUSHED * peak)
