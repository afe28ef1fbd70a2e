# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates recorded trials by condition (note, section 2.6).

Repetitions are synchronised at the start of the movement and averaged for each condition: the
active law and model, the announced direction d, and the direction of the movement. Conditions are
compared with confidence intervals.

Repetitions are no independent draws: a person tires, and is for a while stronger or weaker. How
alike neighbours are a few repetitions cannot tell, so every correlation counts by its likelihood.
What fewer than `FEWEST` repetitions show has no interval, and is not tested.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
import csv
from dataclasses import asdict, dataclass, field, replace
import io
from itertools import combinations, pairwise, product
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
from friction_comp.recordings.reader import (
    Piece,
    pieces_of,
    read_recording_with_info,
    without_topic,
)
from friction_comp.samples import RecordingInfo, Samples
from friction_comp.statistics import CONFIDENCE, holm, rms, student_quantile, student_tail

if TYPE_CHECKING:
    # Few evaluations need it.
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.tables.columns import Layout

FEWEST = 5
"""Repetitions below which nothing is said of chance."""
# Compared where they are known; the first two need a torque sensor.
_COMPARED = ('peak_torque', 'rms_torque', 'residual_current', 'onset')
# A condition scatters no less than this share of both together.
_LEAST_SCATTER = 1e-3
# Correlations of neighbouring repetitions, and how likely they are before any was seen: strong ones
# are rare.
_CORRELATIONS = np.arange(0.0, 0.95, 0.1)
_PRIOR = (1.0 - _CORRELATIONS) ** 1.5
# Share of the values' RMS below which their scatter is rounding, and a square that counts where
# values do not scatter at all, as those of a dead sensor.
_ROUNDING, _NOTHING = 1e-9, 1e-100
# Movements by which two days lie apart, so that none is like one of the day before.
_DAYS_APART = 1000
# What is said of a movement that counts for no condition, by its `Compensation.law`.
_UNCOUNTED = {'identification': 'made by identification',
              'missing': 'with a gap in the joint states',
              'changed': 'during which the law, the model or the state of the compensator changed'}


@dataclass(frozen=True)
class Interval:
    """An estimate with the ends of its 95 % interval, None where it is not known."""

    mean: float
    low: float | None
    high: float | None
    count: int

    @property
    def half(self) -> float | None:
        """Half the width of the interval."""
        return None if self.low is None or self.high is None else 0.5 * (self.high - self.low)

    def as_dict(self) -> dict[str, float | int | None]:
        """Return the entry of report.json."""
        return asdict(self)


def mean_interval(values: Sequence[float], order: Sequence[float] | None = None) -> Interval:
    """Return the mean of one or more values with its interval, if they are enough.

    `order` are the values' places in time, ascending; they follow each other without it.
    """
    count, mean = len(values), float(np.mean(values))
    if count < FEWEST:
        return Interval(mean, None, None, count)
    place = np.arange(count) if order is None else np.asarray(order)
    error = standard_error(np.asarray(values), np.ones((count, 1)), place, np.ones(count))
    half = float(student_quantile(count - 1)) * error
    return Interval(mean, mean - half, mean + half, count)


def standard_error(values: np.ndarray, columns: np.ndarray, place: np.ndarray, scatter: np.ndarray
                   ) -> float:
    """Return the standard error of the first coefficient of a least-squares fit.

    `values` are of shape (N,), `columns` (N, P) with rank P < N. `place` (N,) are the values'
    places in time, ascending. Errors, in proportion to `scatter` (N,), are a process of first
    order, and the variance is its mean over all correlations, each by its restricted likelihood.
    """
    count, width = columns.shape
    weights = scatter * np.linalg.pinv(columns)[0]
    gaps = np.diff(place, prepend=-np.inf)
    even = np.column_stack((values, columns)) / scatter[:, np.newaxis]
    least = count * (_ROUNDING * float(np.sqrt(np.mean(even[:, 0] ** 2)))) ** 2 + _NOTHING
    likelihood, variance = [], []
    for correlation in _CORRELATIONS:
        # How alike a value is to the one before it: less that, in equal scale, they are white.
        alike = correlation ** gaps
        scale = 1.0 / np.sqrt(1.0 - alike ** 2)
        before = np.concatenate((np.zeros_like(even[:1]), even[:-1]))
        white = (even - alike[:, np.newaxis] * before) * scale[:, np.newaxis]
        # The last diagonal element is what the fit leaves.
        triangle = np.abs(np.diag(np.linalg.qr(np.roll(white, -1, axis=1), 'r')))
        square = max(float(triangle[-1] ** 2), least) / (count - width)
        likelihood.append(np.sum(np.log(scale)) - np.sum(np.log(triangle[:-1]))
                          - 0.5 * (count - width) * np.log(square))
        variance.append(square * _variance_of(weights, alike))
    share = _PRIOR * np.exp(np.array(likelihood) - max(likelihood))
    return float(np.sqrt(np.average(variance, weights=share)))


def _variance_of(weights: np.ndarray, alike: np.ndarray) -> float:
    """Return the variance of a weighted sum of a process of first order with variance 1."""
    total = carried = 0.0
    for k, weight in enumerate(weights.tolist()):
        carried = alike[k] * (carried + (weights[k - 1] if k else 0.0))
        total += weight * (weight + 2.0 * carried)
    return max(float(total), 0.0)


@dataclass
class Comparison:
    """One figure under two conditions, by movements of the same day and direction."""

    figure: str  # a name in `FIGURES`
    first: Compensation
    second: Compensation
    pairs: int  # number of pairs that such movements can form
    mean_first: float  # over the days and directions of the pairs
    mean_second: float
    without_drift: Interval     # second minus first, beside a steady change over each day's session
    p_value: float | None  # of Student's t, with Holm's correction; None where `untested`
    # Whether either condition also came after the other on one day. Else what changed in between,
    # and not steadily, is part of the difference.
    in_turn: bool
    untested: str = ''  # why there is no p-value

    @property
    def difference(self) -> float:
        """Second mean minus first mean."""
        return self.mean_second - self.mean_first

    @property
    def significant(self) -> bool:
        """Whether the difference is statistically significant."""
        return self.p_value is not None and self.p_value < 1.0 - CONFIDENCE

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of report.json."""
        return {
            'figure': self.figure, 'unit': FIGURES[self.figure][1],
            'first': self.first.as_dict(), 'second': self.second.as_dict(), 'pairs': self.pairs,
            'mean_first': self.mean_first, 'mean_second': self.mean_second,
            'difference': self.difference, 'without_drift': self.without_drift.as_dict(),
            'p_value': self.p_value, 'in_turn': self.in_turn, 'untested': self.untested or None}


def _is_informative(first: Compensation, second: Compensation, baseline: Compensation) -> bool:
    """Return whether comparing two conditions answers a question.

    These are: what any condition changes against the baseline, if that has no direction; what any
    condition changes against kinetic compensation with the same model; and what law, model,
    settings or direction alone changes. Other differences in several respects answer no question.
    """
    compensated = 'none' not in (first.law, second.law)
    changes = (first.law != second.law, first.announced != second.announced,
               compensated and first.model != second.model,
               compensated and first.settings != second.settings)
    return ((first == baseline and not first.uses_direction)
            or (first.law == 'kinetic' and first.model == second.model) or sum(changes) == 1)


def compare(repetitions: Sequence[Repetition]) -> list[Comparison]:
    """Compare conditions with the same movements, where the comparison `_is_informative`.

    `repetitions` are in order of time. Conditions are ordered from no compensation over
    compensation without a direction to compensation with one; each is `first` against those that
    follow.
    """
    ordered = sorted({r.compensation for r in repetitions}, key=lambda condition: (
        condition.uses_direction, condition.law != 'none', condition))
    comparisons = []
    for figure in _COMPARED:
        own = []
        for first, second in combinations(ordered, 2):
            signs = [{r.movement.sign for r in repetitions if r.compensation == condition
                      and figure in r.figures} for condition in (first, second)]
            both = signs[0] & signs[1]
            if both and _is_informative(first, second, ordered[0]):
                own.append(_compare(figure, first, second, [
                    r for r in repetitions if r.compensation in (first, second)
                    and figure in r.figures and r.movement.sign in both]))
        tested = [c for c in own if c.p_value is not None]
        for one, p_value in zip(tested, holm([c.p_value or 0.0 for c in tested])):
            one.p_value = float(p_value)
        comparisons += own
    return comparisons


def _compare(figure: str, first: Compensation, second: Compensation, repetitions: list[Repetition]
             ) -> Comparison:
    """Compare one figure of repetitions, in order of time, under two conditions.

    Least squares with a mean for each day and direction, the difference of the conditions, and a
    change with every repetition within a day.
    """
    values = np.array([r.figures[figure] for r in repetitions])
    is_second = np.array([r.compensation == second for r in repetitions])
    kinds = [(r.day, r.movement.sign) for r in repetitions]
    of_kind = np.array([[kind == one for one in dict.fromkeys(kinds)] for kind in kinds])
    pairs = np.minimum(of_kind[is_second].sum(axis=0), of_kind[~is_second].sum(axis=0))
    before, after = (_mean(values, own, of_kind, pairs) for own in (~is_second, is_second))
    changes = {(a.compensation == second, b.compensation == second)
               for a, b in pairwise(repetitions) if a.day == b.day}
    count = int(pairs.sum())
    comparison = Comparison(
        figure, first, second, pairs=count, mean_first=before, mean_second=after,
        without_drift=Interval(after - before, None, None, count), p_value=None,
        in_turn={(True, False), (False, True)} <= changes)
    place = np.array([r.place for r in repetitions])
    # Within each day, since days lie apart.
    since = place - of_kind @ (place @ of_kind / of_kind.sum(axis=0))
    columns = np.column_stack([is_second, since, of_kind]).astype(float)
    comparison.untested = _obstacle(count, repetitions, columns)
    if comparison.untested:
        return comparison
    scatter, freedom = _scatter(values, columns, is_second)
    change = float(np.linalg.pinv(columns)[0] @ values)
    error = standard_error(values, columns, place, scatter)
    half = float(student_quantile(freedom)) * error
    comparison.without_drift = Interval(change, change - half, change + half, count)
    lower = second if change < 0.0 else first
    if figure == 'peak_torque' and any(
            not r.moved for r in repetitions if r.compensation == lower):
        comparison.untested = ('the joint did not always move where the torque is lower, so that '
                               'it may not be')
    else:
        comparison.p_value = student_tail(change / error, freedom)
    return comparison


def _mean(values: np.ndarray, own: np.ndarray, of_kind: np.ndarray, pairs: np.ndarray) -> float:
    """Return a condition's mean over the days and directions of the pairs, else over its own."""
    chosen = own[:, np.newaxis] & of_kind
    count = chosen.sum(axis=0)
    weights = pairs if pairs.any() else count
    return float(np.average(values @ chosen / np.maximum(count, 1), weights=weights))


def _obstacle(pairs: int, repetitions: list[Repetition], columns: np.ndarray) -> str:
    """Return why two conditions cannot be tested against each other, '' if they can.

    `columns`, (N, M), are those fitted to the N values; the first is 1 for the second condition.
    """
    if not pairs:
        return ('they were recorded on different days, and what else changed from day to day is '
                'not known')
    # Durations and distances.
    sizes = np.log([(r.duration, r.movement.travel) for r in repetitions])
    is_second = columns[:, 0] > 0.0
    change = np.median(sizes[is_second], axis=0) - np.median(sizes[~is_second], axis=0)
    if (np.abs(change) > math.log(1.0 + ODD)).any():
        return "movements of one took longer or went farther than the other's"
    if (min(is_second.sum(), (~is_second).sum()) < FEWEST
            or np.linalg.matrix_rank(columns) < columns.shape[1]):
        return f'fewer than {FEWEST} repetitions of each may differ by chance'
    return ''


def _scatter(values: np.ndarray, columns: np.ndarray, is_second: np.ndarray
             ) -> tuple[np.ndarray, float]:
    """Return each value's scatter by its condition, (N,), and the freedom of the first coefficient.

    After Welch and Satterthwaite: of two conditions that scatter differently, a mean over both
    would trust the one with few repetitions too much.
    """
    weights = np.linalg.pinv(columns)
    square = (values - columns @ (weights @ values)) ** 2
    # Each condition loses degrees of freedom to the coefficients in proportion to its repetitions.
    share = 1.0 - columns.shape[1] / len(values)
    least = _LEAST_SCATTER ** 2 * float(square.mean()) + _NOTHING
    scatter, parts, freedoms = np.empty(len(values)), [], []
    for own in (is_second, ~is_second):
        freedoms.append(share * float(own.sum()))
        scatter[own] = math.sqrt(max(float(square[own].sum()) / freedoms[-1], least))
        parts.append(float(np.sum((weights[0] * scatter)[own] ** 2)))
    return scatter, sum(parts) ** 2 / sum(
        part ** 2 / freedom for part, freedom in zip(parts, freedoms))


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
    figures: dict[str, Interval]  # means over the repetitions, by `FIGURES`
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
            'figures': {name: value.as_dict() for name, value in self.figures.items()}}


@dataclass
class Evaluation:
    """All conditions of one joint and their comparisons."""

    joint: str
    conditions: list[Condition]
    model: str | None  # model files that were active
    repetitions: list[Repetition]
    comparisons: list[Comparison]  # between conditions with the same movements
    notes: list[str]

    @property
    def measured(self) -> bool:
        """Whether the back-driving torque was measured."""
        return any('peak_torque' in r.figures for r in self.repetitions)

    def names_of(self, condition: Compensation) -> tuple[str, ...]:
        """Return the names of a condition; the model only if there are several."""
        models = {c.compensation.model for c in self.conditions if c.compensation.model}
        return tuple(filter(None, condition.names if len(models) > 1 else condition.names[:2]))

    def label(self, condition: Compensation) -> str:
        """Return the names of a condition in one line."""
        return ' · '.join(self.names_of(condition))

    def pair(self) -> tuple[Compensation, Compensation] | None:
        """Return the conditions without and with direction whose comparison is reported first.

        In this order: both with the same law and model; kinetic compensation and a law with the
        same model; no compensation and any law. Of several pairs of one kind, that with the most
        repetitions.
        """
        counts: Counter[Compensation] = Counter()
        for condition in self.conditions:
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

    def stuck(self, condition: Compensation) -> int:
        """Return the number of movements under a condition in which the joint did not move."""
        return sum(r.compensation == condition and not r.moved for r in self.repetitions)

    def comparison(self, name: str) -> Comparison | None:
        """Return the comparison of one of `FIGURES` under the conditions of `pair`, if any."""
        return next((one for one in self.comparisons
                     if one.figure == name and (one.first, one.second) == self.pair()), None)

    @property
    def is_bound(self) -> bool:
        """Whether the peak's reduction is a lower bound: the joint did not start without d."""
        conditions, change = self.pair(), self.reduction('peak_torque')
        return (conditions is not None and change is not None and change >= 0.0
                and bool(self.stuck(conditions[0])) and not self.stuck(conditions[1]))

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
             model: str | None = None, about: Sequence[RecordingInfo] | None = None,
             friction: FrictionModel | None = None) -> Evaluation:
    """Evaluate trials of one joint; repetitions under the same condition are averaged.

    `names` of the recordings are for messages, `model` is the file that was active, and `about` the
    info of each recording, with active laws and models. `friction` tells the current that a
    movement needs beyond the commanded one. Raises InputError if no movement is found.
    """
    names = [str(name) for name in names or [f'recording {k}' for k in range(len(recordings))]]
    if not recordings:
        raise InputError('no recording to evaluate')
    measured = MeasuredJoint(recordings[0].joint)
    for k, (samples, name) in enumerate(zip(recordings, names)):
        measured.add(samples, name, about[k] if about else RecordingInfo(Path()), friction)
    return measured.evaluate(model)


def evaluate_recordings(paths: Sequence[str | Path], joint: str | None = None,
                        layout: Layout | None = None, model: str | Path | None = None,
                        progress: Callable[[float], None] = lambda share: None
                        ) -> list[Evaluation]:
    """Evaluate recordings, or folders of them; return one evaluation for each joint.

    Recordings that cannot be used are named in the notes. `layout` has the columns of tables;
    `model` is the file of one joint or of an arm, for the missing current (see `evaluate`): joints
    that it does not hold are left out. `progress` is called with the share 0..1 that is done.
    Raises InputError if no recording can be used, with the first one's reason.
    """
    joints: dict[str, MeasuredJoint] = {}
    pieces, left_out = pieces_of(paths, joint, layout)
    for done, piece in enumerate(pieces):
        progress(done / len(pieces))
        try:
            _add_piece(joints, piece, model)
        except InputError as error:
            left_out.append(str(error))
    found = [measured for measured in joints.values() if measured.repetitions]
    if not found:
        raise InputError(left_out[0])
    active = ', '.join(dict.fromkeys(name for one in found for name in one.models)) or None
    for measured in found:
        measured.notes += [f'left out: {reason}' for reason in left_out]
    return [measured.evaluate(active) for measured in found]


def _add_piece(joints: dict[str, MeasuredJoint], piece: Piece, model: str | Path | None) -> None:
    friction = None
    if model is not None:
        from friction_comp.model.friction_model import FrictionModel

        name = without_topic(piece.path, piece.joint)
        friction = FrictionModel.load(model, name)
        friction.check_joint(name, model)
    (samples, info), = read_recording_with_info(
        piece.path, piece.joint, 1.0 if friction is None else friction.drive.torque_per_current,
        layout=piece.layout, others=friction is not None and friction.arm is not None)
    # Joints of one name in several topics are different drives.
    name = piece.joint or info.joint
    measured = joints.setdefault(name, MeasuredJoint(name))
    measured.notes += [text for note in info.notes
                       if (text := f'{piece.path}: {note}') not in measured.notes]
    measured.add(samples, str(piece.path), info, friction)


@dataclass
class MeasuredJoint:
    """The repetitions of one joint, in any order."""

    joint: str
    repetitions: list[Repetition] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    models: list[str] = field(default_factory=list)

    def add(self, samples: Samples, name: str, info: RecordingInfo,
            friction: FrictionModel | None = None) -> None:
        """Add the movements of a recording; raises InputError if there is none."""
        movements, notes = find_movements(samples), []
        if not movements:
            raise InputError(f'{name}: no movement of joint {samples.joint!r} found in it')
        if samples.load is None:
            notes.append(f'no interaction_wrench of joint {samples.joint!r}: the back-driving '
                         'torque is not known, only what position and current show')
        if samples.direction is None:
            notes.append('no direction was recorded, d = 0 is assumed')
        if samples.reference_position is None and samples.reference_velocity is None:
            notes.append('no reference was recorded, repetitions begin with the motion itself')
        if len(movements) > 1 and movements[-1].end > samples.time[-1] - samples.sample_time:
            notes.append('the last movement is cut off and left out')
            movements.pop()
        residual = None
        if friction is not None:
            sent = np.nan if samples.command is None else samples.command
            residual = friction.predict(samples) - np.where(np.isnan(sent), samples.current, sent)
        self.repetitions += [measure(samples, movement, name, info, residual)
                             for movement in movements]
        self.notes += [text for note in notes if (text := f'{name}: {note}') not in self.notes]
        self.models += [info.model] if info.model else []

    def evaluate(self, model: str | None) -> Evaluation:
        """Evaluate one or more repetitions; `model` are the files that were active."""
        notes = list(self.notes)
        in_order = sorted(self.repetitions, key=lambda r: (r.day, r.start))
        days = list(dict.fromkeys(r.day for r in in_order))
        for place, r in enumerate(in_order):
            r.place = place + _DAYS_APART * days.index(r.day)
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
        notes += _reversed_torque(conditions)
        all_kept = sorted((r for group in kept for r in group), key=lambda r: (r.day, r.place))
        return Evaluation(self.joint, conditions, model, repetitions, compare(all_kept), notes)


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
        peak_torque_std=float(np.std(peaks, ddof=1)) if len(peaks) > 1 else (
            0.0 if peaks else math.nan),
        rms_torque=rms(loads[np.isfinite(loads)]),
        false_starts=sum(r.false_start for r in repetitions),
        figures={name: mean_interval([r.figures[name] for r in known], [r.place for r in known])
                 for name in FIGURES if (known := [r for r in repetitions if name in r.figures])},
        time=time, torque=torque, torque_std=torque_std,
        position=position, position_std=position_std,
        reference=reference if np.isfinite(curves['reference_position']).all() else None)


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


def _reversed_torque(conditions: list[Condition]) -> list[str]:
    """Return a note where a joint moved without compensation against the person's torque."""
    highest = [known.high if known.high is not None else known.mean for c in conditions
               if c.compensation.law == 'none'
               and (known := c.figures.get('constant_velocity_torque'))]
    # Weight and an offset of the sensor act against one direction, friction against both.
    return ['without compensation the torque at constant velocity is against the movement: the '
            'sign of interaction_wrench may be wrong'] * (len(highest) > 1 and sum(highest) < 0.0)


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
