# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded trials, evaluated as in the note's section 2.6, and compared with each other.

Repetitions are synchronised at the start of the movement, and averaged over each condition: what
was active (law, model), the announced direction d, and the way the movement goes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError
from friction_comp.evaluation.compare import compare, Comparison
from friction_comp.evaluation.intervals import Interval, mean_interval, share_interval
from friction_comp.evaluation.movements import find_movements
from friction_comp.evaluation.repetitions import (
    FIGURES,
    Help,
    LEAD,
    measure,
    NAMES,
    PEAK_LEAD,
    Repetition,
)
from friction_comp.evaluation.trend import Trend, trends

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.recordings import RecordingInfo
    from friction_comp.samples import Samples

# Repetitions that last much longer or shorter than the usual one, by this share, are odd.
_ODD = 0.25


@dataclass
class Condition:
    """Ensemble of the repetitions under one condition; torques are NaN where none was measured.

    Attributes
    ----------
    help : Help
        What was active.
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
    figures : dict of str to Interval
        Mean over repetitions of each one's own figures, by the names in `FIGURES`, with its
        95 % confidence interval.
    false_start_share : Interval
    time : ndarray
        s since the start of the movement, shape (N,).
    torque, torque_std, position, position_std, reference : ndarray
        Average and standard deviation over repetitions, shape (N,), in N·m and rad; reference is
        None where it was not recorded.
    """

    help: Help
    direction: int
    movement: str
    repetitions: int
    peak_torque: float
    peak_torque_std: float
    peak_time: float
    rms_torque: float
    mean_torque_constant_velocity: float
    false_starts: int
    figures: dict[str, Interval]
    false_start_share: Interval
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
        named = {name: _plain(getattr(self, name)) for name in (
            'direction', 'movement', 'repetitions', 'peak_torque', 'peak_torque_std',
            'peak_time', 'rms_torque', 'mean_torque_constant_velocity', 'false_starts')}
        return {
            **named, 'law': self.help.law or None, 'model': self.help.model or None,
            'figures': {name: value.as_dict() for name, value in self.figures.items()},
            'false_start_share': self.false_start_share.as_dict()}


@dataclass
class Evaluation:
    """All conditions of one joint and what the announced direction achieved.

    Attributes
    ----------
    joint : str
    conditions : list of Condition
    model : str or None
        Model files that were active.
    repetitions : list of Repetition
    comparisons : list of Comparison
        Paired tests between all conditions that share a movement.
    trends : list of Trend
        Where repetitions are of several days.
    notes : list of str
    """

    joint: str
    conditions: list[Condition]
    model: str | None = None
    repetitions: list[Repetition] = field(default_factory=list)
    comparisons: list[Comparison] = field(default_factory=list)
    trends: list[Trend] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def measured(self) -> bool:
        """Whether the back-driving torque was measured."""
        return any('peak_torque' in r.figures for r in self.repetitions)

    def pair(self) -> tuple[Help, Help] | None:
        """Return what d = ±1 is compared with: d = 0 under the same law and model.

        Where that is nowhere, and there is but one of either, these two; None where several
        could be meant. Of several laws or models, the one with the most repetitions counts.
        """
        counts: dict[Help, int] = {}
        for condition in self.conditions:
            counts[condition.help] = counts.get(condition.help, 0) + condition.repetitions
        plain = [known for known in counts if known.announced == 0]
        assisted = [known for known in counts if known.announced == 1]
        same = [(a, b) for a in plain for b in assisted if (a.law, a.model) == (b.law, b.model)]
        if same:
            return max(same, key=lambda two: (min(counts[two[0]], counts[two[1]]), two))
        return (plain[0], assisted[0]) if len(plain) == len(assisted) == 1 else None

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
        two = self.pair()
        if two is None:
            return None
        values = {(c.help, c.movement): getattr(c, name) for c in self.conditions}
        pairs = [(values[two[0], m], values[two[1], m]) for m in NAMES.values()
                 if (two[0], m) in values and (two[1], m) in values]
        pairs = [pair for pair in pairs if np.isfinite(pair).all()]
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
            'model': self.model, 'torque_measured': self.measured,
            'comparisons': [c.as_dict() for c in self.comparisons],
            'trends': [t.as_dict() for t in self.trends], 'notes': self.notes,
        }

    def table(self) -> list[list[Any]]:
        """Return one row per repetition, after a row of names."""
        rows: list[list[Any]] = [[
            'joint', 'recording', 'day', 'begin', 'duration', 'movement', 'direction', 'law',
            'model', *FIGURES, 'false_start']]
        for r in self.repetitions:
            rows.append([
                self.joint, r.recording, r.day, round(r.begin, 4), round(r.duration, 4),
                NAMES[r.movement.sign], r.movement.direction, r.help.law, r.help.model,
                *(f'{r.figures[name]:.6g}' if name in r.figures else '' for name in FIGURES),
                int(r.false_start)])
        return rows


def evaluate(recordings: Sequence[Samples], names: Sequence[str] | None = None,
             model: str | None = None, about: Sequence[RecordingInfo] | None = None,
             friction: FrictionModel | None = None) -> Evaluation:
    """Evaluate trials of one joint.

    Parameters
    ----------
    recordings : list of Samples
        One or more recordings; repetitions under the same condition are averaged.
    names : list of str, optional
        What to call the recordings in messages.
    model : str, optional
        The model file that was active.
    about : list of RecordingInfo, optional
        What `read_recording_with_info` says of each recording: what was active, and when.
    friction : FrictionModel, optional
        With it, the current is known that a movement asks for beyond what was commanded, also
        without a torque sensor.

    Returns
    -------
    Evaluation

    Raises
    ------
    InputError
        If no movement is found.
    """
    names = [str(name) for name in names or [f'recording {k}' for k in range(len(recordings))]]
    if not recordings:
        raise InputError('no recording to evaluate')
    notes: list[str] = []
    repetitions: list[Repetition] = []
    for k, (samples, name) in enumerate(zip(recordings, names)):
        info = about[k] if about else None
        found = repetitions_of(samples, name, info, friction, notes)
        if not found:
            raise InputError(f'{name}: no movement of joint {samples.joint!r} found in it')
        repetitions.extend(found)
    return evaluate_repetitions(recordings[0].joint, repetitions, model, notes)


def evaluate_repetitions(joint: str, repetitions: list[Repetition], model: str | None = None,
                         notes: list[str] | None = None) -> Evaluation:
    """Evaluate movements that were measured one by one.

    Parameters
    ----------
    joint : str
    repetitions : list of Repetition
        At least one.
    model : str, optional
        The model file that was active.
    notes : list of str, optional
        What is to be known of them already.

    Returns
    -------
    Evaluation
    """
    evaluation = Evaluation(joint, [], model, repetitions, notes=[] if notes is None else notes)
    groups: dict[tuple[Any, ...], list[Repetition]] = {}
    for repetition in evaluation.repetitions:
        movement = repetition.movement
        groups.setdefault((
            abs(movement.direction), repetition.help.law, repetition.help.model,
            movement.direction, -movement.sign), []).append(repetition)
    kept = []
    for key in sorted(groups):
        usual = _usual(groups[key], evaluation.notes)
        kept.extend(usual)
        evaluation.conditions.append(_condition(usual, evaluation.notes))
    evaluation.comparisons = compare(kept)
    evaluation.trends = trends(kept)
    return evaluation


def repetitions_of(samples: Samples, name: str, info: RecordingInfo | None,
                   friction: FrictionModel | None, notes: list[str],
                   whole: bool = True) -> list[Repetition]:
    """Find and measure the movements of a recording, or of a stretch of it.

    Parameters
    ----------
    samples : Samples
    name : str
        What to call the recording.
    info : RecordingInfo, optional
    friction : FrictionModel, optional
        As for `evaluate`.
    notes : list of str
        Gets what a reader of the results should know, each line once.
    whole : bool
        Whether the recording ends with the samples.

    Returns
    -------
    list of Repetition
        None that reaches the end, unless it is the only one of a whole recording.
    """
    movements = find_movements(samples)
    said = []
    if samples.load is None:
        said.append(f'{name}: no interaction_wrench of joint {samples.joint!r}: the back-driving '
                    'torque is not known, only what position and current tell')
    if samples.direction is None:
        said.append(f'{name}: no direction was recorded, d = 0 is assumed')
    if samples.reference_position is None and samples.reference_velocity is None:
        said.append(f'{name}: no reference was recorded, repetitions begin with the motion itself')
    residual = None
    if friction is not None and movements:
        applied = samples.current if samples.command is None else samples.command
        residual = friction.predict(samples) - applied
    found = []
    for movement in movements:
        if movement.end > samples.time[-1] - samples.sample_time and (
                len(movements) > 1 or not whole):
            if whole:
                said.append(f'{name}: the last movement is cut off and left out')
            continue
        found.append(measure(samples, movement, name, info, residual))
    notes.extend(note for note in said if note not in notes)
    return found


def _usual(repetitions: list[Repetition], notes: list[str]) -> list[Repetition]:
    durations = np.array([r.duration for r in repetitions])
    usual = float(np.median(durations))
    kept = [r for r, d in zip(repetitions, durations) if abs(d - usual) <= _ODD * usual]
    if len(kept) < len(repetitions):
        notes.append(
            f'{len(repetitions) - len(kept)} repetitions with {repetitions[0].help.label} lasted '
            'much longer or shorter than the others and are left out')
    # With an even number, the median itself may be far from all.
    return kept or repetitions


def _condition(kept: list[Repetition], notes: list[str]) -> Condition:
    first = kept[0]
    time, curves = _ensemble(kept)
    mean, spread = _mean_and_std(curves['load'])
    middle, deviation = _mean_and_std(curves['position'])
    peak, rms, constant = _of_average(kept, time, curves['load'], mean)
    peaks = [r.figures['peak_torque'] for r in kept if 'peak_torque' in r.figures]
    restless = sum(r.restless for r in kept)
    if restless:
        notes.append(
            f'the joint did not come to rest before {restless} of {len(kept)} movements with '
            f'{first.help.label} in the {NAMES[first.movement.sign]} direction')
    starts = sum(r.false_start for r in kept)
    return Condition(
        help=first.help, direction=first.movement.direction,
        movement=NAMES[first.movement.sign], repetitions=len(kept),
        peak_torque=float(abs(mean[peak])),
        peak_torque_std=float(np.std(peaks, ddof=1)) if len(peaks) > 1 else (
            0.0 if peaks else float('nan')),
        peak_time=float(time[peak]) if peaks else float('nan'), rms_torque=rms,
        mean_torque_constant_velocity=constant, false_starts=starts,
        figures={name: mean_interval(values) for name in FIGURES if (values := [
            r.figures[name] for r in kept if name in r.figures])},
        false_start_share=share_interval(starts, len(kept)),
        time=time, torque=mean, torque_std=spread, position=middle, position_std=deviation,
        reference=np.mean(curves['reference_position'], axis=0)
        if np.isfinite(curves['reference_position']).all() else None)


def _ensemble(kept: list[Repetition]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the curves of all repetitions on one time base, each of shape (R, N).

    It ends where the first of them ends: an average over fewer would jump there.
    """
    step = max(float(np.median(np.diff(r.time))) for r in kept)
    usual = float(np.median([r.duration for r in kept]))
    time = np.arange(-round(LEAD / step), round(usual / step) + 1) * step
    curves = {}
    for name in ('load', 'position', 'reference_position'):
        curves[name] = np.array([
            np.interp(time, r.time, r.curves[name], left=np.nan, right=np.nan)
            if name in r.curves else np.full(len(time), np.nan) for r in kept])
    whole = np.isfinite(curves['position']).all(axis=0)
    if not (whole & (time >= 0)).any():
        whole = np.isfinite(curves['position']).any(axis=0)
    return time[whole], {name: values[:, whole] for name, values in curves.items()}


def _of_average(kept: list[Repetition], time: np.ndarray, torque: np.ndarray,
                mean: np.ndarray) -> tuple[int, float, float]:
    """Return where the averaged torque peaks, its RMS and its mean at constant velocity."""
    slowing = np.median([r.movement.constant_end - r.movement.begin for r in kept])
    steady = np.median([r.movement.constant_begin - r.movement.begin for r in kept])
    counted = (time >= -PEAK_LEAD) & (time <= slowing)
    peak = int(np.argmax(np.where(counted, np.nan_to_num(np.abs(mean), nan=-1.0), -1.0)))
    moving, constant = time >= 0.0, (time <= slowing) & (time >= steady)
    known = np.isfinite(torque).all(axis=1)
    if not known.any():
        return peak, float('nan'), float('nan')
    rms = float(np.sqrt(np.mean(torque[known][:, moving] ** 2)))
    along = float(kept[0].movement.sign * np.mean(mean[constant])) if constant.any() \
        else float('nan')
    return peak, rms, along


def _mean_and_std(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    known = values[np.isfinite(values).all(axis=1)]
    if not len(known):
        nothing = np.full(values.shape[1], np.nan)
        return nothing, nothing
    spread = np.std(known, axis=0, ddof=1) if len(known) > 1 else np.zeros(values.shape[1])
    return np.mean(known, axis=0), spread


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value


def models_of(evaluation: Evaluation) -> list[str]:
    """Return the model files that were active, by name."""
    return sorted({Path(r.help.model).name for r in evaluation.repetitions if r.help.model})
