# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A table as samples: units that cannot be are refused, times put in order, rows made whole."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from friction_comp.errors import InputError, one_of
from friction_comp.facts.motion import at_times, not_in_radians, whole_numbers
from friction_comp.facts.recorded import checked, not_in_seconds, usable
from friction_comp.samples import JointStates, RecordingInfo, Samples
from friction_comp.statistics import gap_length
from friction_comp.tables.columns import assign, Assignment, Layout, SIGNALS, STATES, unit_to_give
from friction_comp.tables.table_files import Columns, is_table, parts_of, Table

_SIGNALS = [name for name in SIGNALS if name not in ('time', 'current', 'link_torque')]
_HELD = ('command', 'direction')    # signals that hold their value until the next


class TableRecording:
    """The joints of a table: of a file, or of the columns of a data `frame`.

    The `layout` is what the user declares; a `plan` needs no effort. Raises InputError if a column
    cannot be used.
    """

    def __init__(self, path: Path, layout: Layout | None = None, frame: Any = None,
                 plan: bool = False) -> None:
        self.path = path
        self._table = Table(path, [*layout.columns.values()] if layout else (), frame)
        try:
            self._use = assign(self._table.names, layout, path, plan)
        except InputError as error:
            raise InputError('; '.join((str(error), *self._table.notes))) from None
        self._use.notes += self._table.notes
        self._layout, self._time = self._use.layout, np.empty(0)
        self._columns: Columns = {}

    @property
    def joints(self) -> list[str]:
        """Names of the joints; a single joint without a name is ''."""
        return self._use.joints

    @property
    def choices(self) -> list[str]:
        """Names of the joints that may be read; one if the user named its columns."""
        return self._use.joints if self._use.chosen is None else [self._use.chosen]

    def siblings(self, joint: str | None) -> list[str]:
        """Return the joints that were recorded with one, and itself."""
        return self._use.joints

    def samples(self, joint: str | None = None, torque_per_current: float = 1.0
                ) -> tuple[Samples, RecordingInfo]:
        """Return the samples of one joint, the only one by default.

        `torque_per_current` is k_t · n in N·m/A. Raises InputError if the joint is not clear or not
        in the table, or if its values are none of a joint.
        """
        use = self._use
        self._load()
        joint = use.chosen if joint is None else joint
        key = '' if use.joints == [''] else one_of(use.joints, joint, self.path)
        time, notes = self._time, list(use.notes)
        signals = self._signals(key, torque_per_current, notes)
        finite, signals['velocity'] = usable(signals['position'], signals['current'] + time,
                                             signals.get('velocity'))
        rows = np.flatnonzero(finite)
        if not len(rows):
            raise InputError(f'{self.path}: no row has time, position and effort')
        fresh = np.diff(time[rows], prepend=-np.inf) > 0.0
        for reason, count in (('not finite', len(time) - len(rows)),
                              ('the time of the row before', np.count_nonzero(~fresh))):
            notes += [f'{count} rows left out: {reason}'] if count else []
        rows = rows[fresh]
        start = float(time[rows[0]])
        others = (self._of('position', name) for name in use.joints if name != key)
        samples, kept = checked(Samples(time[rows] - start, joint=joint or key, **{
            name: values[rows] for name, values in signals.items() if values is not None}),
            notes, self.path, (own for own in others if own is not None))
        effort = use.of('effort', key)
        return samples, RecordingInfo(
            self.path, joint or key, start=start, stamps=time - start, rows=rows[kept], notes=notes,
            effort_is_current=use.effort_is_current, linear=use.linear, assumed=self._assumed(),
            effort_unit=effort.unit if effort is not None and not effort.dimension else '')

    def _of(self, signal: str, joint: str) -> np.ndarray | None:
        return self._use.signal_in(self._columns, signal, joint)

    def _signals(self, joint: str, torque_per_current: float, notes: list[str]) -> dict[str, Any]:
        """Return the signals of a joint in SI units, effort and command as current."""
        layout, column = self._layout, self._use.of('effort', joint)
        signals: dict[str, Any] = {name: own for name in _SIGNALS
                                   if (own := self._of(name, joint)) is not None}
        if layout.stiffness and 'effort' not in signals:
            with np.errstate(divide='ignore', invalid='ignore'):
                velocity = signals['velocity'] if 'velocity' in signals else np.gradient(
                    signals['position'], self._time) if len(self._time) > 1 else 0.0
            follows = 'reference_velocity' in signals
            signals['effort'] = layout.stiffness * (
                signals['reference_position'] - signals['position']) - (layout.damping or 0.0) * (
                    velocity - signals.get('reference_velocity', 0.0))
            notes.append('effort is k_p (target - position) ' + (
                '+ k_d (target velocity - velocity)' if follows else '- k_d velocity'))
        for name in _HELD:
            if name in signals and (known := np.flatnonzero(np.isfinite(signals[name]))).size:
                last = np.searchsorted(known, np.arange(len(self._time)), side='right') - 1
                signals[name] = np.where(last < 0, 0.0, signals[name][known[np.maximum(last, 0)]])
        if 'direction' in signals:
            given = signals['direction']
            signals['direction'] = np.where(np.isin(given, (-1, 1)), given, 0).astype(int)
        if (behind := self._of('link_torque', joint)) is not None:
            is_torque = column is None or column.dimension in ('torque', 'force')
            signals.setdefault('load', _load(signals['effort'], behind, is_torque, notes))
        command = self._use.of('command', joint)
        if command is not None and command.dimension != 'current':
            signals['command'] = signals['command'] / torque_per_current
        signals['current'] = signals.pop('effort') / (
            1.0 if self._use.effort_is_current else torque_per_current)
        return signals

    def _load(self) -> None:
        """Read the columns once, with times in order, and rows that hold position and effort."""
        if self._columns:
            return
        use, layout = self._use, self._layout
        columns = self._table.read([column.name for column in use.columns])
        size = len(next(iter(columns.values())))
        if not size:
            raise InputError(f'{self.path}: has no row below its header')
        time = np.arange(size) / layout.rate if layout.rate else _times(use, columns, self.path)
        columns, time = _in_order(columns, time, use.notes)
        seconds = float(np.nanmax(time) - np.nanmin(time))
        # What tells that values without a unit are not in SI units, once for each signal.
        asked: dict[str, str] = {}
        for column in [one for one in use.columns if one.signal in STATES and not one.stated]:
            values = columns[column.name]
            if fault := (not_in_radians(values, seconds) if column.signal == 'position'
                         else whole_numbers(values)):
                asked.setdefault(column.signal, f'column {column.name!r} {fault}: give its unit, '
                                 f'--unit {unit_to_give(column.signal)}')
                if column.signal == 'velocity':
                    use.columns.remove(column)     # it is computed from the position
        use.notes += [f'{asked.pop("velocity")}; it is not used'] if 'velocity' in asked else []
        if asked:
            raise InputError(f'{self.path}: {"; ".join(asked.values())}')
        self._columns, self._time = _whole_rows(columns, time, use)

    def _assumed(self) -> tuple[str, ...]:
        """Return the SI units that are taken for granted, where neither name nor user says any."""
        length = self._use.linear
        units = {'position': 'm' if length else 'rad', 'velocity': 'm/s' if length else 'rad/s',
                 'effort': 'A' if self._use.effort_is_current else 'N' if length else 'N·m',
                 'time': 's'}
        found = {signal: [c.name for c in self._use.columns if c.signal == signal and not c.stated]
                 for signal in units}
        return tuple(f'{names[0]}{" and alike" * (len(names) > 1)} in {units[signal]}'
                     for signal, names in found.items() if names)


def _load(effort: np.ndarray, link_torque: np.ndarray, is_torque: bool, notes: list[str]
          ) -> np.ndarray:
    """Return the load on a gear in N·m, (N,), by the torque of the link behind it.

    The load moves the joint, and the gear moves the link: one is minus the other. In some robots
    the sensor has the opposite sign, which is reversed.
    """
    both = np.isfinite(effort) & np.isfinite(link_torque)
    product, power = float(effort[both] @ link_torque[both]), float(effort[both] @ effort[both])
    if product < 0.0:
        link_torque = -link_torque
        notes.append('the sign of link_torque is reversed: it is opposite to that of effort')
    ratio = abs(product) / max(power, 1e-300)
    # More than any friction makes of it.
    if is_torque and ratio > 3.0:
        notes.append(f'link_torque is about {ratio:.2g} times the effort, as if that were before a '
                     'gear: give its ratio, --unit effort=100Nm if it is 100')
    return -link_torque


def _times(use: Assignment, columns: Columns, where: object) -> np.ndarray:
    """Return the times, s; raises InputError if they are not in the unit given or assumed."""
    column = use.of('time', '')
    assert column is not None
    values = np.sort(columns[column.name][np.isfinite(columns[column.name])])
    if not values.size:
        raise InputError(f'{where}: column {column.name!r} holds no time')
    if fault := not_in_seconds(values, column.factor, column.stated):
        raise InputError(f'{where}: column {column.name!r} {fault}')
    return column.factor * columns[column.name]


def _in_order(columns: Columns, time: np.ndarray, notes: list[str]) -> tuple[Columns, np.ndarray]:
    """Return columns and times, s, sorted; where times begin anew, they go on after a pause."""
    steps = np.diff(time[np.isfinite(time)])
    back = steps < 0.0
    if not back.any():
        return columns, time
    if back.mean() < 0.01 and np.isfinite(time).all() and (
            np.diff(np.flatnonzero(back), prepend=-20) >= 20).all():
        notes.append(f'times begin anew {np.count_nonzero(back)} times, as of episodes: no motion '
                     'is taken to be between them')
        pause = 1.0 + gap_length(steps)
        later = np.cumsum(np.where(back, pause - steps, 0.0))
        return columns, time + np.concatenate(([0.0], later))
    notes.append('rows are in no order of time: sorted')
    order = np.argsort(time, kind='stable')
    return {name: values[order] for name, values in columns.items()}, time[order]


def _whole_rows(columns: Columns, time: np.ndarray, use: Assignment) -> tuple[Columns, np.ndarray]:
    """Return columns and times, s, of the rows that hold the rarer of position and effort.

    The others are interpolated to them, where these are mostly in other rows: so logs of several
    topics are written. Nothing is interpolated over gaps.
    """
    pairs = [(effort.name, position.name) for joint in use.joints
             if (effort := use.of('effort', joint)) and (position := use.of('position', joint))]
    known = {name: np.isfinite(columns[name] + time) for pair in pairs for name in pair}
    if all((known[one] & known[other]).sum() > 0.5 * min(known[one].sum(), known[other].sum())
           for one, other in pairs) or not all(rows.any() for rows in known.values()):
        return columns, time
    rarest = min(known, key=lambda name: int(known[name].sum()))
    use.notes.append(f'rows hold few values each: those with {rarest} are used, the others are '
                     'interpolated to their times')
    rows, found = known[rarest], {name: values[known[rarest]] for name, values in columns.items()}
    for column in use.columns:
        own = np.isfinite(columns[column.name] + time)
        if column.signal not in (*_HELD, 'time') and own.any():
            values = at_times(
                time[rows], time[own], columns[column.name][own], 0.0,
                2.0 * np.pi / abs(column.factor) if column.dimension == 'angle' else 0.0)
            within = (time[rows] >= time[own][0]) & (time[rows] <= time[own][-1])
            found[column.name] = np.where(within | (own.sum() < 2), values, np.nan)
    return found, time[rows]


def read_frame(frame: Any, layout: Layout | None = None, torque_constant: float = 1.0,
               gear_ratio: float = 1.0, joint: str | None = None, notes: list[str] | None = None
               ) -> Samples:
    """Return samples from a pandas or polars data frame, or a dictionary of arrays.

    Parameters
    ----------
    frame : DataFrame or dict of str to array_like
    layout : Layout, optional
        Columns and units of signals; others are guessed from the names of the columns.
    torque_constant, gear_ratio : float
        k_t in N·m/A and n, for a frame with an effort in N·m.
    joint : str, optional
        Required if the frame has several joints.
    notes : list of str, optional
        Notes on what was guessed are appended.

    Examples
    --------
    >>> samples = read_frame({'t': [0, 0.1, 0.2], 'q [deg]': [0, 90, 180], 'i': [0.1, 0.2, 0.1]})
    >>> samples.position.round(3).tolist()
    [0.0, 1.571, 3.142]
    """
    samples, info = TableRecording(Path('data frame'), layout, frame).samples(
        joint, torque_constant * gear_ratio)
    if notes is not None:
        notes.extend(info.notes)
    return samples


def read_plan(path: Path, layout: Layout | None = None) -> dict[str, Samples] | None:
    """Return the planned motion of each joint by name; None if the file is not a plan.

    A plan is a JointTrajectory (.yaml), or a table in which time and position are found, but no
    effort and no current. Its samples have zero current, and the motion of all joints in `arm`.
    """
    if path.suffix.lower() in ('.yaml', '.yml'):
        from friction_comp.trajectory import Trajectory

        plan = Trajectory.load(path)
        arm = JointStates(plan.joints, plan.position, plan.velocity)
        return {name: Samples(
            plan.time, plan.position[:, k], np.zeros(len(plan.time)), joint=name, arm=arm,
            velocity=plan.velocity[:, k], acceleration=plan.acceleration[:, k])
            for k, name in enumerate(plan.joints)}
    if not is_table(path) or not all(part.is_file() for part in parts_of(path)):
        return None
    try:
        table = TableRecording(path, layout, plan=True)
    except InputError:
        return None     # faults are reported when the table is read as a recording
    use = table._use
    if use.layout.stiffness or any(column.signal == 'effort' for column in use.columns):
        return None
    values = table._table.read([column.name for column in use.columns])
    size = len(next(iter(values.values())))
    time = np.arange(size) / use.layout.rate if use.layout.rate else use.signal_in(values, 'time')
    positions = {name: use.signal_in(values, 'position', name) for name in use.joints}
    rows: Any = np.array([time, *positions.values()], dtype=float)
    if not np.isfinite(rows).all():
        raise InputError(f'{path}: a plan has a time and the position of each joint in every row')
    if not (np.diff(rows[0]) > 0.0).all():
        raise InputError(f'{path}: its times do not rise')
    arm = JointStates(tuple(positions), rows[1:].T)
    speeds = {name: use.signal_in(values, 'velocity', name) for name in use.joints}
    return {name: Samples(
        rows[0], position, np.zeros(size), joint=name, arm=arm,
        velocity=None if speed is None or not np.isfinite(speed).all() else speed)
        for (name, speed), position in zip(speeds.items(), rows[1:])}


def table_of(joints: Sequence[Samples]) -> Columns:
    """Return samples on one time base as columns, such as ``elbow.position``; current is effort."""
    columns = {'time': joints[0].time}
    for samples in joints:
        for name in _SIGNALS:
            values = getattr(samples, 'current' if name == 'effort' else name)
            if values is not None:
                columns[f'{samples.joint}.{name}'.lstrip('.')] = values
    return columns
