# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the movements of a trial and measures each: its condition and its figures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from itertools import pairwise
import math
from pathlib import Path
from typing import Any

import numpy as np

from friction_comp.recordings.scan import Activity
from friction_comp.samples import HOLE, RecordingInfo, Samples
from friction_comp.statistics import gap_length, rms, top_speed

# Time by which a joint may start before the movement of the reference, s.
_EARLY = 0.5
# A false start, or a start, covers this share of the movement.
_START_SHARE = 0.01
# Tolerance for rounding errors of sums of sample times, s.
_ROUNDING = 1e-9
# Repetitions whose duration differs from the median by more than this share are left out, and
# conditions whose movements do are not tested against each other.
ODD = 0.25
# Of curves, s before a movement, and s between points.
_LEAD, _STEP = 1.0, 2e-3
NAMES = {1: 'positive', -1: 'negative'}
# The figures of a repetition with label and unit; the first one known is the leading figure.
FIGURES = {
    'peak_torque': ('peak torque', 'N·m'), 'peak_time': ('time of the peak', 's'),
    'rms_torque': ('RMS torque', 'N·m'),
    'constant_velocity_torque': ('torque at constant velocity', 'N·m'),
    'onset': ('onset after reference', 's')}


@dataclass(frozen=True)
class Movement:
    """One movement of a recording; times in s on the recording's clock."""

    begin: float  # of the reference's (else the joint's) motion
    end: float
    constant_begin: float  # of the phase of constant velocity
    constant_end: float
    rest_begin: float  # of the standstill before the movement
    # End of the standstill after it: a lagging joint may start as late.
    rest_end: float
    sign: int  # +1 for the positive direction, -1 for the negative
    direction: int  # announced direction d at the beginning of the movement
    travel: float  # rad

    @property
    def earliest(self) -> float:
        """Time from which the joint may have started, which may be before the reference, s."""
        return max(self.begin - _EARLY, self.rest_begin)


def find_movements(samples: Samples) -> list[Movement]:
    """Return the movements of one recording in order of time: the reference's, else the joint's."""
    if len(samples) < 2:
        return []
    velocity = samples.reference_velocity
    if velocity is None and samples.reference_position is not None:
        velocity = np.gradient(samples.reference_position, samples.time)
    # Shares of the top speed above which it counts as moving, and as moving constantly.
    moving, constant, shortest_travel = 0.01, 0.95, 0.0
    if velocity is None:
        # A measured velocity is noisy, and people overshoot.
        velocity, moving, constant = _measured_velocity(samples), 0.1, 0.75
        shortest_travel = 20 * samples.position_step
    top = top_speed(np.abs(velocity), 0.99)
    if not top > 0.0:
        return []
    time = samples.time
    # First index, end and distance of each run of motion in one direction.
    runs = [(start, stop, float(abs(np.sum(
        velocity[start:stop - 1] * np.diff(time[start:stop])))))
        for start, stop in _runs(np.sign(velocity) * (np.abs(velocity) > moving * top))
        if time[stop - 1] - time[start] >= 0.1]
    longest = max((travel for *_, travel in runs), default=0.0)
    # Much shorter ones are corrections, not repetitions.
    runs = [run for run in runs if run[2] >= max(0.3 * longest, shortest_travel)]
    rest_begins = [0, *(stop - 1 for _, stop, _ in runs)]
    rest_ends = [*(start for start, _, _ in runs[1:]), -1]
    movements = []
    for (start, stop, travel), rest_begin, rest_end in zip(runs, rest_begins, rest_ends):
        speed = np.abs(velocity[start:stop])
        fast = start + np.nonzero(speed >= constant * speed.max())[0]
        movements.append(Movement(
            begin=float(time[start]), end=float(time[stop - 1]),
            constant_begin=float(time[fast[0]]), constant_end=float(time[fast[-1]]),
            rest_begin=float(time[rest_begin]), rest_end=float(time[rest_end]),
            sign=int(np.sign(velocity[start])),
            direction=_announced_direction(samples, start, fast[0] + 1), travel=travel))
    return movements


def _measured_velocity(samples: Samples) -> np.ndarray:
    """Return the velocity from a zero-phase moving average of position, rad/s, shape (N,)."""
    width = max(round(0.05 / max(samples.sample_time, 1e-6)), 1)
    kernel = np.ones(width) / width
    padded = np.pad(samples.position, width, mode='edge')
    smooth = np.convolve(np.convolve(padded, kernel, 'same'), kernel, 'same')[width:-width]
    return np.gradient(smooth, samples.time)


def _runs(values: np.ndarray) -> Iterator[tuple[int, int]]:
    edges = np.concatenate(([0], np.nonzero(np.diff(values))[0] + 1, [len(values)]))
    for start, stop in pairwise(edges):
        if values[start] != 0:
            yield int(start), int(stop)


def _announced_direction(samples: Samples, start: int, stop: int) -> int:
    if samples.direction is None:
        return 0
    counts = np.bincount(samples.direction[start:stop].astype(int) + 1, minlength=3)
    return int(np.argmax(counts)) - 1


@dataclass(frozen=True, order=True)
class Compensation:
    """The compensation that was active during a movement."""

    # Compensation law; 'none' if no current was commanded, 'identification' if that node commanded
    # it, 'other' if another node than the compensator did, 'changed' if law, model or state changed
    # on the way, 'missing' if joint states are, '' if unknown.
    law: str
    model: str  # model file; '' where there was none or it is unknown
    announced: int  # 1: the movement's direction, -1: the opposite one, 0: none
    settings: str = ''  # of the law, where they are not the defaults

    @property
    def uses_direction(self) -> bool:
        """Whether a direction was announced to a law that uses it."""
        return self.announced != 0 and self.law not in ('none', 'kinetic')

    @property
    def label(self) -> str:
        """What is known of direction, law and model, in one line."""
        announced = {0: 'd = 0', 1: 'd = ±1', -1: 'd = ±1 (against)'}[self.announced]
        law = {'none': 'no compensation', 'other': 'another commander'}.get(self.law, self.law)
        named = announced, ', '.join(filter(None, (law, self.settings))), Path(self.model).name
        return ' · '.join(filter(None, named))

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of report.json."""
        return {'law': self.law or None, 'model': self.model or None, 'announced': self.announced,
                'settings': self.settings or None}


@dataclass
class Repetition:
    """One movement and its figures."""

    recording: str
    start: float  # stamp of the recording's beginning, s; 0 where it is not of a clock on the wall
    day: str  # ISO date; '' where unknown
    movement: Movement
    compensation: Compensation
    figures: dict[str, float]  # by the names in `FIGURES`, without those that are unknown
    # Whether the joint moved before the next movement began; else the peak torque was too small.
    moved: bool
    # Whether the joint started during the standstill, as far as known without being pushed.
    false_start: bool
    # 'load', 'position' and 'reference_position', where recorded, at `curve_times`; NaN beyond the
    # recording and before the standstill.
    curves: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def begin(self) -> float:
        """Time since the recording's first joint state, s."""
        return self.movement.begin

    @property
    def duration(self) -> float:
        """Duration of the movement, s."""
        return self.movement.end - self.movement.begin

    @property
    def shown_time(self) -> float:
        """Time from the movement's beginning to its end and until the joint has started, s."""
        return max(self.duration, self.figures.get('onset', -math.inf) + 0.25)


def curve_times(duration: float, beyond: float = 0.0) -> np.ndarray:
    """Return the times of a movement's curve points since its beginning, s, shape (N,)."""
    return np.arange(-round(_LEAD / _STEP), round((1.0 + beyond) * duration / _STEP) + 1) * _STEP


def measure(samples: Samples, movement: Movement, name: str, info: RecordingInfo) -> Repetition:
    """Measure one movement of a recording called `name`."""
    part = _between(samples.time, movement.begin, movement.end)
    has_reference = samples.reference_position is not None or samples.reference_velocity is not None
    onset = _onset(samples, movement) if has_reference else None
    figures = {}
    if samples.load is not None:
        whole = _between(samples.time, movement.earliest, movement.rest_end)
        figures['rms_torque'] = rms(samples.load[part])
        figures |= torque_figures(samples.time[whole], samples.load[whole], movement, onset,
                                  has_reference)
    if onset is not None:
        figures['onset'] = onset - movement.begin
    moved = onset is not None or not has_reference
    repetition = Repetition(
        recording=name, start=_wall_time(info), day=_date_of(info), movement=movement,
        compensation=_missing(samples, movement, onset) or _active_compensation(
            samples, movement, info, onset, moved),
        figures={key: value for key, value in figures.items() if np.isfinite(value)}, moved=moved,
        false_start=_is_false_start(samples, movement, figures.get('peak_torque')))
    repetition.curves = _curves(samples, movement, repetition.shown_time)
    return repetition


def _between(time: np.ndarray, begin: float, end: float) -> slice:
    """Return the samples from one time to another, at least one."""
    first, last = np.searchsorted(time, [begin, end])
    return slice(int(first), max(int(last), int(first) + 1))


def torque_figures(time: np.ndarray, load: np.ndarray, movement: Movement, onset: float | None,
                   has_reference: bool) -> dict[str, float]:
    """Return peak, its time, and torque at constant velocity, those that are known, by `FIGURES`.

    For the peak counts the torque that moves the joint: from the beginning of the movement until it
    decelerates, or until the joint starts moving if that is later. Earlier torque belongs to the
    previous movement, unless the joint started early, or the movement begins with the joint's
    motion, for lack of a reference. Before the joint moves, only torque along the movement counts;
    afterwards torque in either direction.

    `time`, s on the clock of `movement`, and `load`, τ_b in N·m, are of shape (N,). `onset` is when
    the joint started moving, s; None if it did not, or without a reference.
    """
    first, last = movement.begin, movement.constant_end
    if has_reference and onset is None:
        start, last = np.inf, movement.end
    else:
        start = movement.begin if onset is None else onset
        last = max(last, start)
        if not has_reference or start < first:
            first = movement.earliest
    counts = (time >= first - _ROUNDING) & (time <= last + _ROUNDING)
    torque = np.where(time >= start, np.abs(load), np.maximum(movement.sign * load, 0.0))
    figures = {}
    # Where the torque is not known throughout, its peak may be missing.
    if counts.any() and np.isfinite(load[counts]).all():
        peak = int(np.argmax(np.where(counts, torque, -1.0)))
        figures = {'peak_torque': float(torque[peak]),
                   'peak_time': float(time[peak] - movement.begin)}
    constant = load[_between(time, movement.constant_begin, movement.constant_end)]
    if len(constant):
        figures['constant_velocity_torque'] = float(movement.sign * np.mean(constant))
    return figures


def _onset(samples: Samples, movement: Movement) -> float | None:
    """Return the time at which the joint started, s; None if not before the next movement."""
    part = _between(samples.time, movement.earliest, movement.rest_end)
    displacement = movement.sign * (samples.position[part] - samples.position[part.start])
    beyond = np.nonzero(displacement > max(
        _START_SHARE * movement.travel, 3 * samples.position_step))[0]
    return float(samples.time[part.start + beyond[0]]) if len(beyond) else None


def _missing(samples: Samples, movement: Movement, onset: float | None) -> Compensation | None:
    """Return what a movement counts as while joint states are missing."""
    part = _between(samples.time, movement.earliest, max(movement.end, onset or -math.inf))
    # A gap before or after may have taken a part of the movement.
    steps = np.diff(samples.time[max(part.start - 1, 0):part.stop + 2])
    longest = max(HOLE, gap_length(np.diff(samples.time)))
    return Compensation('missing', '', movement.direction * movement.sign) if (
        steps > longest).any() else None


def _active_compensation(samples: Samples, movement: Movement, info: RecordingInfo,
                         onset: float | None, moved: bool) -> Compensation:
    """Return the law and model of a movement: by the compensator's reports and its commands.

    Reports count from when the joint may have started until it has, and the movement has ended.
    """
    announced = movement.direction * movement.sign
    command = None if samples.command is None else (
        samples.command[_between(samples.time, movement.begin, movement.end)])
    loaded, reports = info.model or '', info.activity
    # A report is valid from the sample to which it is dated.
    first = sum(since <= movement.earliest + samples.sample_time for since, _ in reports)
    last = sum(since <= max(movement.end, onset or -math.inf) for since, _ in reports)
    # Before the first report, nothing is known.
    during = {_compensation(command, report, loaded, announced, moved) for report in (
        [None] * (not first) + [report for _, report in reports[max(first - 1, 0):last]])}
    return during.pop() if len(during) == 1 else Compensation('changed', '', announced)


def _compensation(command: np.ndarray | None, report: Activity | None, loaded: str, announced: int,
                  moved: bool) -> Compensation:
    """Return what one report and the commands of a movement, A, (N,), say."""
    law, model, settings, active = '', loaded, '', True
    if report is not None:
        if report.state == 'identification':
            return Compensation('identification', '', announced)
        active = report.state in ('', 'active')
        law, model, settings = report.law, report.model or loaded, report.settings
    if command is not None:
        # Without commands, a compensator may have died that had reported to be active.
        sent = command[np.isfinite(command)]
        idle = not sent.any()
        # A law may command no current while the joint stands still.
        if (idle and (moved or not law or not len(sent))) or not active:
            law = 'none' if idle else 'other'
        elif len(sent) < len(command):
            law = 'changed'
    elif not active:
        law = 'none'
    # Without a law, neither a loaded model nor settings are in use.
    return Compensation(law, '', announced) if law in ('none', 'other', 'changed') else (
        Compensation(law, model, announced, settings))


def _date_of(info: RecordingInfo) -> str:
    """Return a recording's ISO date here by its stamps, '' for simulated time."""
    return datetime.fromtimestamp(info.start).date().isoformat() if _wall_time(info) else ''


def _wall_time(info: RecordingInfo) -> float:
    """Return when a recording began, s; 0 for stamps before 2000, which are of no clock."""
    return info.start if info.start > 946_684_800 else 0.0


def _curves(samples: Samples, movement: Movement, shown_time: float) -> dict[str, np.ndarray]:
    """Return load, position and reference at even times, NaN where they are not known."""
    time = movement.begin + curve_times(shown_time, 0.25)
    curves = {}
    for name in ('load', 'position', 'reference_position'):
        values = getattr(samples, name)
        if values is not None:
            curve = np.interp(time, samples.time, values, left=np.nan, right=np.nan)
            known = np.isfinite(values[_between(samples.time, movement.begin, movement.end)]).all()
            curves[name] = np.where(known & (time >= movement.rest_begin), curve, np.nan).astype(
                np.float32)
    return curves


def _is_false_start(samples: Samples, movement: Movement, peak: float | None) -> bool:
    middle_of_rest = 0.5 * (movement.rest_begin + movement.begin)
    begin = max(middle_of_rest, movement.begin - _LEAD)
    part = _between(samples.time, begin, movement.begin)
    # The joint is still before: an oscillation is no start.
    still = int(np.searchsorted(samples.time[part], begin + 0.2))
    displacement = samples.position[part] - samples.position[part.start]
    beyond = np.abs(displacement) > _START_SHARE * movement.travel
    if not 0 < still < len(beyond) or not beyond.any() or (
            np.abs(displacement[:still]).max() > 0.2 * _START_SHARE * movement.travel):
        return False
    if samples.load is None or peak is None:
        return True
    start = int(np.argmax(beyond))
    moment = samples.time[part.start + start]
    push = np.mean(samples.load[_between(samples.time, moment - 0.1, np.nextafter(moment, np.inf))])
    return bool(push * np.sign(displacement[start]) < 0.1 * peak)
