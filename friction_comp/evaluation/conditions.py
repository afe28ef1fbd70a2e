# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates recorded trials by condition (note, section 2.6).

Repetitions are synchronised at the start of the movement and averaged for each condition: the
active law and model, the announced direction d, and the direction of the movement.

Repetitions are no independent draws: a person tires, and is for a while stronger or weaker. So
chance is judged only where two conditions were recorded in turn: by what changed from each run of
movements under one of them to the next run under the other.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
import csv
from dataclasses import asdict, dataclass, field, replace
import io
from itertools import groupby, product
import math
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError
from friction_comp.evaluation.repetitions import (
    Compensation,
    curve_times,
    FIGURES,
    find_movements,
    measure,
    NAMES,
    ODD,
    Repetition,
    torque_figures,
)
from friction_comp.recordings.reader import pieces_of, read_recording_with_info
from friction_comp.samples import RecordingInfo, Samples
from friction_comp.statistics import rms, student_quantile

if TYPE_CHECKING:
    from friction_comp.tables.columns import Layout

FEWEST = 5
"""Turns from one condition to another below which nothing is said of chance."""
# What is said of a movement that counts for no condition, by its `Compensation.law`.
_UNCOUNTED = {'identification': 'made by identification',
              'missing': 'with a gap in the joint states',
              'changed': 'during which the law, the model or the state of the compensator changed'}


@dataclass(frozen=True)
class Comparison:
    """A torque under two conditions, by movements of the same day and direction."""

    figure: str  # 'peak_torque' or 'rms_torque'
    first: Compensation
    second: Compensation
    pairs: int  # number of pairs that such movements can form
    mean_first: float  # over the days and directions of the pairs
    mean_second: float
    turns: int  # runs under one condition with a run under the other next to them, in pairs
    interval: tuple[float, float] | None  # 95 %, of second minus first in these; None if `untested`
    untested: str  # why there is no interval; '' if there is

    @property
    def difference(self) -> float:
        """Second mean minus first mean."""
        return self.mean_second - self.mean_first

    @property
    def significant(self) -> bool:
        """Whether the difference is more than chance."""
        return self.interval is not None and self.interval[0] * self.interval[1] > 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of report.json."""
        return {**asdict(self), 'first': self.first.as_dict(), 'second': self.second.as_dict(),
                'unit': FIGURES[self.figure][1], 'difference': self.difference,
                'untested': self.untested or None}


def compare(figure: str, first: Compensation, second: Compensation,
            repetitions: Sequence[Repetition]) -> Comparison | None:
    """Compare a figure of repetitions, in order of time, under two conditions.

    None if they have no direction of movement in common.
    """
    ways = [{r.movement.sign for r in repetitions if r.compensation == condition
             and figure in r.figures} for condition in (first, second)]
    chosen = [r for r in repetitions if r.compensation in (first, second)
              and figure in r.figures and r.movement.sign in ways[0] & ways[1]]
    if not chosen:
        return None
    values = np.array([r.figures[figure] for r in chosen])
    is_second = np.array([r.compensation == second for r in chosen])
    kinds = [(r.day, r.movement.sign) for r in chosen]
    of_kind = np.array([[kind == one for one in dict.fromkeys(kinds)] for kind in kinds])
    pairs = np.minimum(of_kind[is_second].sum(axis=0), of_kind[~is_second].sum(axis=0))
    before, after = (_mean(values, own, of_kind, pairs) for own in (~is_second, is_second))
    turns = _turns(figure, second, chosen)
    untested = _obstacle(int(pairs.sum()), chosen, is_second, len(turns))
    interval = None
    if not untested:
        half = float(student_quantile(len(turns) - 1) * np.std(turns, ddof=1)) / math.sqrt(
            len(turns))
        interval = float(np.mean(turns)) - half, float(np.mean(turns)) + half
    return Comparison(figure, first, second, int(pairs.sum()), before, after, len(turns), interval,
                      untested)


def _mean(values: np.ndarray, own: np.ndarray, of_kind: np.ndarray, pairs: np.ndarray) -> float:
    """Return a condition's mean over the days and directions of the pairs, else over its own."""
    chosen = own[:, np.newaxis] & of_kind
    count = chosen.sum(axis=0)
    weights = pairs if pairs.any() else count
    return float(np.average(values @ chosen / np.maximum(count, 1), weights=weights))


def _turns(figure: str, second: Compensation, repetitions: Sequence[Repetition]) -> list[float]:
    """Return second minus first of runs next to each other on a day, none in two pairs."""
    changes: list[float] = []
    last: tuple[str, dict[int, float]] | None = None
    for (day, condition), run in groupby(repetitions, key=lambda r: (r.day, r.compensation)):
        listed = list(run)
        means = {sign: float(np.mean([r.figures[figure] for r in listed
                                      if r.movement.sign == sign]))
                 for sign in {r.movement.sign for r in listed}}
        before = last[1] if last is not None and last[0] == day else {}
        if both := set(means) & set(before):
            change = float(np.mean([means[sign] - before[sign] for sign in both]))
            changes.append(change if condition == second else -change)
            last = None
        else:
            last = day, means
    return changes


def _obstacle(pairs: int, repetitions: Sequence[Repetition], is_second: np.ndarray, turns: int
              ) -> str:
    """Return why chance cannot be judged, '' if it can; `is_second`, (R,), is of repetitions."""
    if not pairs:
        return ('they were recorded on different days, and what else changed from day to day is '
                'not known')
    # Durations and distances.
    sizes = np.log([(r.duration, r.movement.travel) for r in repetitions])
    change = np.median(sizes[is_second], axis=0) - np.median(sizes[~is_second], axis=0)
    if (np.abs(change) > math.log(1.0 + ODD)).any():
        return "movements of one took longer or went farther than the other's"
    if turns < FEWEST:
        return (f'it takes {FEWEST} turns of one and the other to tell a difference from what else '
                f'changes with time, and there are no more than {turns}')
    return ''


@dataclass
class Condition:
    """The repetitions under one condition; torques in N·m, NaN where none was measured."""

    compensation: Compensation
    direction: int  # announced direction d
    movement: str  # 'positive' or 'negative'
    repetitions: int  # their number
    # Those in which the joint did not start moving: the peak torque is then a lower bound.
    stuck: int
    peak_torque: float  # largest magnitude of the mean of τ_b while `torque_figures` counts it
    peak_torque_std: float  # standard deviation of the repetitions' peaks
    peak_time: float  # of the peak of the mean, s after the start of the movement
    rms_torque: float  # over all repetitions, from start to end of the movement
    mean_torque_constant_velocity: float  # negative where the joint pulls the person along
    false_starts: int  # number of repetitions in which it started without being pushed
    # By name: mean over the repetitions, standard deviation, and their number.
    figures: dict[str, tuple[float, float, int]]
    # Each (N,): s since the start of the movement; means and standard deviations, N·m and rad.
    time: np.ndarray
    torque: np.ndarray
    torque_std: np.ndarray
    position: np.ndarray
    position_std: np.ndarray
    reference: np.ndarray | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the figures without the curves."""
        named = {name: getattr(self, name) for name in (
            'direction', 'movement', 'repetitions', 'stuck', 'peak_torque', 'peak_torque_std',
            'peak_time', 'rms_torque', 'mean_torque_constant_velocity', 'false_starts')}
        return {
            **named, 'law': self.compensation.law or None, 'model': self.compensation.model or None,
            'settings': self.compensation.settings or None,
            'figures': {name: dict(zip(('mean', 'std', 'count'), found))
                        for name, found in self.figures.items()}}


@dataclass
class Evaluation:
    """All conditions of one joint and their comparisons."""

    joint: str
    conditions: list[Condition]
    model: str | None  # model files that were active
    repetitions: list[Repetition]
    comparisons: list[Comparison]  # of torques with a direction and without
    notes: list[str]

    @property
    def measured(self) -> bool:
        """Whether the back-driving torque was measured."""
        return any('peak_torque' in r.figures for r in self.repetitions)

    def label(self, condition: Compensation) -> str:
        """Return the names of a condition in one line; the model only if there are several."""
        models = {c.compensation.model for c in self.conditions if c.compensation.model}
        return condition.label if len(models) > 1 else replace(condition, model='').label

    def stuck(self, condition: Compensation) -> int:
        """Return the number of movements under a condition in which the joint did not move."""
        return sum(r.compensation == condition and not r.moved for r in self.repetitions)

    def comparison(self, name: str) -> Comparison | None:
        """Return the comparison of one of `FIGURES`, if any."""
        return next((one for one in self.comparisons if one.figure == name), None)

    @property
    def is_bound(self) -> bool:
        """Whether the peak's reduction is a lower bound: the joint did not start without d."""
        test, change = self.comparison('peak_torque'), self.reduction('peak_torque')
        return (test is not None and change is not None and change >= 0.0
                and bool(self.stuck(test.first)) and not self.stuck(test.second))

    def reduction(self, name: str) -> float | None:
        """Return the relative reduction of a torque with d = ±1; None where it is unknown."""
        found = self.comparison(name)
        return None if found is None or not found.mean_first > 0.0 else (
            1.0 - found.mean_second / found.mean_first)

    def as_dict(self) -> dict[str, Any]:
        """Return the content of report.json."""
        return {
            'joint': self.joint, 'conditions': [c.as_dict() for c in self.conditions],
            'peak_reduction': self.reduction('peak_torque'),
            'rms_reduction': self.reduction('rms_torque'),
            'reduction_is_bound': self.is_bound, 'model': self.model,
            'torque_measured': self.measured,
            'comparisons': [c.as_dict() for c in self.comparisons],
            'notes': self.notes}


def repetitions_csv(evaluations: Sequence[Evaluation]) -> str:
    """Return a table with a row for each repetition."""
    stream = io.StringIO()
    csv.writer(stream, lineterminator='\n').writerows([
        ['joint', 'recording', 'day', 'begin', 'duration', 'movement', 'direction', 'law', 'model',
         *FIGURES, 'moved', 'false_start', 'settings'], *([
             one.joint, r.recording, r.day, round(r.begin, 4), round(r.duration, 4),
             NAMES[r.movement.sign], r.movement.direction, r.compensation.law,
             r.compensation.model,
             *(f'{r.figures[name]:.6g}' if name in r.figures else '' for name in FIGURES),
             int(r.moved), int(r.false_start), r.compensation.settings]
             for one in evaluations for r in one.repetitions)])
    return stream.getvalue()


def evaluate(recordings: Sequence[Samples], names: Sequence[str] | None = None,
             about: Sequence[RecordingInfo] | None = None) -> Evaluation:
    """Evaluate trials of one joint; repetitions under the same condition are averaged.

    `names` of the recordings are for messages, and `about` is the info of each recording, with
    active laws and models. Raises InputError if no movement is found.
    """
    names = [str(name) for name in names or [f'recording {k}' for k in range(len(recordings))]]
    if not recordings:
        raise InputError('no recording to evaluate')
    measured = MeasuredJoint(recordings[0].joint)
    for k, (samples, name) in enumerate(zip(recordings, names)):
        measured.add(samples, name, about[k] if about else RecordingInfo(Path()))
    return measured.evaluate()


def evaluate_recordings(paths: Sequence[str | Path], joint: str | None = None,
                        layout: Layout | None = None,
                        progress: Callable[[float], None] = lambda share: None
                        ) -> list[Evaluation]:
    """Evaluate recordings, or folders of them; return one evaluation for each joint.

    Recordings that cannot be used are named in the notes. `layout` has the columns of tables.
    `progress` is called with the share 0..1 that is done. Raises InputError if no recording can be
    used, with the first one's reason.
    """
    joints: dict[str, MeasuredJoint] = {}
    pieces, left_out = pieces_of(paths, joint, layout)
    for done, piece in enumerate(pieces):
        progress(done / len(pieces))
        try:
            (samples, info), = read_recording_with_info(
                piece.path, piece.joint, 1.0, layout=layout)
            # Joints of one name in several topics are different drives.
            name = piece.joint or info.joint
            measured = joints.setdefault(name, MeasuredJoint(name))
            measured.say(piece.path, info.notes)
            measured.add(samples, str(piece.path), info)
        except InputError as error:
            left_out.append(str(error))
    found = [measured for measured in joints.values() if measured.repetitions]
    if not found:
        raise InputError(left_out[0])
    for measured in found:
        measured.notes += [f'left out: {reason}' for reason in left_out]
    return [measured.evaluate() for measured in found]


@dataclass
class MeasuredJoint:
    """The repetitions of one joint, in any order."""

    joint: str
    repetitions: list[Repetition] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    models: list[str] = field(default_factory=list)

    def say(self, name: str | Path, notes: Sequence[str]) -> None:
        """Add notes on a recording that were not made before."""
        self.notes += [text for note in notes if (text := f'{name}: {note}') not in self.notes]

    def add(self, samples: Samples, name: str, info: RecordingInfo) -> None:
        """Add the movements of a recording; raises InputError if there is none."""
        movements, notes = find_movements(samples), []
        if not movements:
            raise InputError(f'{name}: no movement of joint {samples.joint!r} found in it')
        if samples.load is None:
            notes.append(f'no interaction_wrench of joint {samples.joint!r}: the back-driving '
                         'torque is not known, only when the joint started')
        if samples.direction is None:
            notes.append('no direction was recorded, d = 0 is assumed')
        if samples.reference_position is None and samples.reference_velocity is None:
            notes.append('no reference was recorded, repetitions begin with the motion itself')
        if len(movements) > 1 and movements[-1].end > samples.time[-1] - samples.sample_time:
            notes.append('the last movement is cut off and left out')
            movements.pop()
        self.repetitions += [measure(samples, movement, name, info) for movement in movements]
        self.say(name, notes)
        self.models += [info.model] if info.model else []

    def evaluate(self) -> Evaluation:
        """Evaluate one or more repetitions."""
        notes = list(self.notes)
        in_order = sorted(self.repetitions, key=lambda r: (r.day, r.start))
        repetitions = _of_one_condition(in_order, notes)
        in_order_of_time = list(dict.fromkeys(r.compensation for r in repetitions))
        # A group for each condition and direction of movement, first without direction and law.
        groups: dict[tuple[Any, ...], list[Repetition]] = {}
        for r in repetitions:
            key = (abs(r.movement.direction), r.compensation.law != 'none',
                   in_order_of_time.index(r.compensation), -r.movement.sign, r.movement.direction)
            groups.setdefault(key, []).append(r)
        kept = [_without_odd_durations(groups[key], notes) for key in sorted(groups)]
        conditions = [_condition(group) for group in kept]
        counted = {id(r) for group in kept for r in group}
        pair = _pair(conditions)
        compared = [compare(figure, *pair, [r for r in repetitions if id(r) in counted])
                    for figure in ('peak_torque', 'rms_torque')] if pair else []
        return Evaluation(
            self.joint, conditions, ', '.join(dict.fromkeys(self.models)) or None, repetitions,
            [one for one in compared if one], notes)


def _pair(conditions: Sequence[Condition]) -> tuple[Compensation, Compensation] | None:
    """Return the conditions without and with direction that are compared.

    In this order: both with the same law and model; kinetic compensation and a law with the same
    model; no compensation and any law. Of several pairs of one kind, that with the most
    repetitions.
    """
    counts: Counter[Compensation] = Counter()
    for condition in conditions:
        counts[condition.compensation] += condition.repetitions
    plain = [c for c in counts if c.announced >= 0 and not c.uses_direction]
    assisted = [c for c in counts if c.announced == 1 and c.uses_direction]
    pairs = list(product(plain, assisted))
    for comparable in (
            [(a, b) for a, b in pairs if replace(a, announced=1) == b],
            [(a, b) for a, b in pairs if (a.law, a.model) == ('kinetic', b.model)],
            [(a, b) for a, b in pairs if a.law == 'none']):
        if comparable:
            return max(comparable, key=lambda pair: (
                min(counts[c] for c in pair), sum(counts[c] for c in pair), pair))
    return None


def _of_one_condition(repetitions: list[Repetition], notes: list[str]) -> list[Repetition]:
    """Leave out movements that tell nothing about a compensation, unless there are no others."""
    kept = [r for r in repetitions if r.compensation.law not in _UNCOUNTED]
    if not kept:
        return repetitions
    for law, what in _UNCOUNTED.items():
        if count := sum(r.compensation.law == law for r in repetitions):
            notes.append(f'{count} movement{"s" if count > 1 else ""} {what}: left out')
    return kept


def _without_odd_durations(repetitions: list[Repetition], notes: list[str]) -> list[Repetition]:
    median = float(np.median([r.duration for r in repetitions]))
    kept = [r for r in repetitions if abs(r.duration - median) <= ODD * median]
    # With an even number, the median may be far from all of them.
    if kept and len(kept) < len(repetitions):
        notes.append(
            f'{len(repetitions) - len(kept)} of {len(repetitions)} repetitions with '
            f'{repetitions[0].compensation.label} lasted much longer or shorter than the others '
            'and are left out')
    return kept or repetitions


def _condition(repetitions: list[Repetition]) -> Condition:
    first = repetitions[0]
    time = curve_times(float(np.median([r.shown_time for r in repetitions])))
    curves = {name: np.array([_at(r.curves.get(name), len(time)) for r in repetitions])
              for name in ('load', 'position', 'reference_position')}
    # A mean over fewer curves would jump where one of them begins or ends.
    whole = np.isfinite(curves['position']).all(axis=0)
    if (whole & (time >= 0.0)).any():
        time, curves = time[whole], {name: own[:, whole] for name, own in curves.items()}
    (torque, torque_std), (position, position_std), (reference, _) = map(
        _mean_and_std, curves.values())
    average = _average_torque_figures(repetitions, time, torque)
    moves = (time >= 0.0) & (time <= np.median([r.duration for r in repetitions]))
    loads = curves['load'][:, moves]
    peaks = [r.figures['peak_torque'] for r in repetitions if 'peak_torque' in r.figures]
    return Condition(
        compensation=first.compensation, direction=first.movement.direction,
        movement=NAMES[first.movement.sign], repetitions=len(repetitions),
        stuck=sum(not r.moved for r in repetitions),
        peak_torque=average.get('peak_torque', math.nan),
        peak_time=average.get('peak_time', math.nan),
        mean_torque_constant_velocity=average.get('constant_velocity_torque', math.nan),
        peak_torque_std=_std(peaks) if peaks else math.nan,
        rms_torque=rms(loads[np.isfinite(loads)]),
        false_starts=sum(r.false_start for r in repetitions),
        figures={name: (float(np.mean(known)), _std(known), len(known)) for name in FIGURES
                 if (known := [r.figures[name] for r in repetitions if name in r.figures])},
        time=time, torque=torque, torque_std=torque_std,
        position=position, position_std=position_std,
        reference=reference if np.isfinite(curves['reference_position']).all() else None)


def _std(values: list[float]) -> float:
    return float(np.std(values, ddof=1)) if len(values) > 1 else 0.0


def _at(curve: np.ndarray | None, size: int) -> np.ndarray:
    """Return a curve at the first `size` points, NaN beyond its end, (size,)."""
    known = np.full(size, np.nan)
    if curve is not None:
        known[:len(curve)] = curve[:size]
    return known


def _mean_and_std(curves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and standard deviation over curves, (R, N), NaN where none is known."""
    known, values = np.isfinite(curves).sum(axis=0), np.nan_to_num(curves)
    with np.errstate(invalid='ignore', divide='ignore'):
        mean = values.sum(axis=0) / known
        square = (np.where(np.isfinite(curves), curves - mean, 0.0) ** 2).sum(axis=0)
    return mean, np.where(known > 0, np.sqrt(square / np.maximum(known - 1, 1)), np.nan)


def _average_torque_figures(repetitions: list[Repetition], time: np.ndarray,
                            mean: np.ndarray) -> dict[str, float]:
    """Return the `torque_figures` of the averaged torque, with the medians of the phases."""
    movement = repetitions[0].movement
    medians: dict[str, Any] = {
        name: float(np.median([getattr(r.movement, name) - r.movement.begin for r in repetitions]))
        for name in ('begin', 'end', 'constant_begin', 'constant_end', 'rest_begin', 'rest_end')}
    onset = float(np.median([r.figures.get('onset', math.inf) for r in repetitions]))
    has_reference = any('onset' in r.figures or not r.moved for r in repetitions)
    return torque_figures(time, mean, replace(movement, **medians),
                          onset if math.isfinite(onset) else None, has_reference)
