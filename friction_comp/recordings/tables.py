# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads tables as recordings, their rows as if they were messages, and writes them as tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
import io
from pathlib import Path

import numpy as np

from friction_comp.column_names import in_turns_of, is_of_motor, read_name, read_of_axis, skeleton
from friction_comp.column_values import to_csv
from friction_comp.columns import assign, Assignment
from friction_comp.errors import InputError
from friction_comp.facts.motion import not_in_radians
from friction_comp.facts.timing import not_in_seconds, unit_for
from friction_comp.files import write_atomically
from friction_comp.layout import Layout
from friction_comp.recordings.integral import Integral
from friction_comp.recordings.row_groups import column_of_episodes, column_of_joints, Episodes
from friction_comp.recordings.row_times import clock_parts, in_no_order
from friction_comp.recordings.scan import Scan, Track
from friction_comp.recordings.sparse_rows import gathered
from friction_comp.recordings.storage import unreadable_on_error
from friction_comp.recordings.table_base import Columns
from friction_comp.recordings.table_files import of_one_clock, open_table, pyarrow_of
from friction_comp.recordings.told_units import unit_of_dates
from friction_comp.samples import Samples
from friction_comp.topics import TOPICS, TORQUE_UNIT
from friction_comp.units import unit_factor

# Topic that corresponds to each column of a table besides the joint states and the reference.
_TOPICS = {'load': 'interaction_wrench', 'temperature': 'motor_temperature',
           'command': 'current_command', 'direction': 'direction'}
_SIGNALS = ('position', 'velocity', 'effort', 'command', 'direction', 'load', 'temperature',
            'reference_position', 'reference_velocity')
# Magnitude above which a number is no time, s: 64 bits hold no more in ns.
_LATEST = 9e9
# Fewest rows of whole numbers that are no coincidence.
_FEWEST_RAW = 50


class TableScanner:
    """Reads a table block by block; the counterpart of `MessageScanner`."""

    # A batch of 250,000 rows takes 20 MB for ten columns.
    def __init__(self, path: Path, layout: Layout | None = None, joint: str | None = None,
                 batch: int = 250_000) -> None:
        self.progress = 0.0
        self._path, self._joint, self._batch = path, joint, batch
        self._layout = layout or Layout()
        with unreadable_on_error(path):
            self._table = open_table(path)
        self._table.names = of_one_clock(self._table, self._layout, str(path))
        self._use = self._assigned(layout)
        self._whose = self._column_of_joints()
        self._episode, self._episodes = self._column_of_episodes(), Episodes()
        self._integrals: dict[tuple[str, str], Integral] = {}
        self._effort_unit = next((column.unit for column in self._use.columns if column.unit
                                  and column.signal == 'effort' and not column.dimension), '')
        self._gains = self._layout.gains(self._table.names, str(path))
        time = self._use.time
        with unreadable_on_error(path):
            self._clock = clock_parts(self._table, time.name) if time and (
                time.factor == 1.0) else {}
        if self._clock and time:
            self._use.notes.append(f'time is that of {time.name}, {", ".join(self._clock)}')

    def _assigned(self, layout: Layout | None) -> Assignment:
        """Return the used columns, none of which may share its name with another."""
        doubled = ', '.join(map(repr, self._table.doubled))
        try:
            # Of two columns for the position, neither is used, but they are asked for.
            integrates = not any(read_name(name).signal == 'position'
                                 for name in self._table.doubled)
            use = assign(self._table.names, layout, str(self._path), integrates=integrates)
        except InputError as error:
            raise InputError(f'{error}, and two columns called {doubled}'
                             if doubled else str(error)) from None
        if doubled:
            use.notes.append(f'left out, since several columns have this name: {doubled}')
        return use

    def _column_of_joints(self) -> str | None:
        """Return the column that says whose row each row is; columns are then of no joint."""
        use = self._use
        if len(use.joints) > 1:
            return None
        with unreadable_on_error(self._path):
            name = column_of_joints(self._table, [column.name for column in use.columns],
                                    use.time.name if use.time else None)
        if name is not None:
            use.columns[:] = [replace(column, joint='') for column in use.columns]
            use.notes.append(f'column {name!r} says whose row each row is')
        return name

    def _column_of_episodes(self) -> str | None:
        with unreadable_on_error(self._path):
            name = column_of_episodes(self._table, [c.name for c in self._use.columns])
        if name is not None:
            self._use.notes.append(f'column {name!r} says which episode each row is of')
        return name

    def scans(self) -> Iterator[Scan]:
        """Yield a scan of each block of rows."""
        use = self._use
        wanted = list(dict.fromkeys(column.name for column in use.columns))
        wanted += [gain for gain in self._gains if isinstance(gain, str)] + [*self._clock]
        wanted += [name for name in (self._whose, self._episode) if name is not None]
        rows = 0
        with unreadable_on_error(self._path):
            for columns, share in self._table.blocks(wanted, self._batch):
                self.progress = share
                size = len(columns[wanted[0]])
                use.notes += [note for note in self._table.notes if note not in use.notes]
                if size:
                    if not rows:
                        self._check_first(columns)
                    self._leave_out_raw(columns)
                    columns, time = self._whole_rows(columns, self._times(columns, rows))
                    order = rows + np.arange(len(time))
                    if self._episode is not None:
                        time = self._episodes.apart(columns[self._episode], time)
                    tracks = list(self._tracks(columns, time, order) if self._whose is None
                                  else self._tracks_by_joint(columns, time, order))
                    rows += size
                    yield Scan(self._path, tracks,
                               {track.topic: (TOPICS[track.signal], rows) for track in tracks},
                               list(use.notes), effort_is_current=use.effort_is_current,
                               selected=use.chosen, linear=use.linear,
                               effort_unit=self._effort_unit, assumed=self._assumed())
        if not rows:
            raise InputError(f'{self._path}: has no row below its header')

    def _assumed(self) -> tuple[str, ...]:
        """Return what is taken for granted of columns.

        It is the SI unit where neither the name nor the user gives one, and that the values of a
        motor are those behind its gear.
        """
        found: dict[str, list[str]] = {}
        for column in self._use.columns:
            if not (column.stated or (column.signal == 'effort' and self._effort_unit)):
                found.setdefault(column.signal, []).append(column.name)
        units = {'position': 'rad', 'effort': 'A' if self._use.effort_is_current else 'N·m',
                 'velocity': 'rad/s', 'time': 's'}
        # Of a motor, or in metres: nothing tells.
        asked = ', or in m (--unit position=m)' if any(
            read_of_axis(name).unit == 'm' for name in found.get('position', ())) else ''
        geared = [column.name for column in self._use.columns if is_of_motor(column.name)
                  and column.signal in ('position', 'velocity')]
        return (*(f'{found[signal][0]}{" and alike" * (len(found[signal]) > 1)} in {unit}'
                  + asked * (signal == 'position')
                  for signal, unit in units.items() if signal in found),
                *([f'{" and ".join(geared[:2])} behind the gear, of the joint'] if geared else []))

    def _check_first(self, columns: Columns) -> None:
        """Compare values of the first block with the units that are taken for granted.

        Times that are dates get their unit. Raises InputError if others cannot be in s, or a
        position without a unit in rad.
        """
        for place, column in enumerate(self._use.columns):
            said, values = f'{self._path}: column {column.name!r}', columns[column.name]
            if column.signal == 'position' and not column.stated:
                if fault := not_in_radians(values):
                    raise InputError(f'{said} {fault}: give its unit, --unit position=deg, turn, '
                                     'counts/4096 (counts in a turn) or rad')
                if make := in_turns_of(column.name):
                    raise InputError(
                        f'{said} is called as by {make}, which reports turns: give its unit, '
                        '--unit position=turn,velocity=turn/s, or position=rad')
            if column.signal != 'time' or self._layout.rate:
                continue
            if in_no_order(values):
                values = np.sort(values)
            unit = '' if column.stated else unit_of_dates(values)
            finite = values[np.isfinite(values)]
            if len(values) and not finite.size:
                raise InputError(f'{said} holds no time')
            if unit:
                self._use.columns[place] = replace(
                    column, unit=unit, factor=unit_factor('time', unit), stated=True)
                self._use.notes[:] = [note.replace(
                    f'time={column.name} in s', f'time={column.name} in {unit}, dates')
                    for note in self._use.notes]
            elif 'time' not in self._layout.units and (
                    fault := not_in_seconds(values, column.factor, column.stated)):
                unit = unit_for(values)
                raise InputError(f'{said} {fault}: give its unit, for instance --unit time={unit}'
                                 + ', or time=s' * (unit != 's')
                                 + ', or the rows per second with --rate')

    def _whole_rows(self, columns: Columns, time: np.ndarray) -> tuple[Columns, np.ndarray]:
        """Return columns and times, s, of rows that hold position and effort."""
        if self._whose is not None:
            return columns, time
        of = self._use.of
        pairs = [(effort.name, position.name) for joint in self._use.joints
                 if (effort := of('effort', joint)) and (position := of('position', joint))]
        turns = {column.name: 2.0 * np.pi / abs(column.factor) for column in self._use.columns
                 if column.signal in ('position', 'reference_position')
                 and not column.integrated}
        columns, time, rarest = gathered(columns, time, pairs, turns)
        note = (f'rows hold few values each: those with {rarest} are used, the others are '
                'interpolated to their times')
        self._use.notes += [note] if rarest and note not in self._use.notes else []
        return columns, time

    def _leave_out_raw(self, columns: Columns) -> None:
        """Deal with whole numbers without a unit, such as a register's: they are no SI values.

        A velocity of these is left out, an effort is in counts, and a position raises InputError.
        """
        noted: dict[str, str] = {}      # once for columns that are named alike
        for column in list(self._use.columns):
            values = columns[column.name]
            values = values[np.isfinite(values)]
            if column.stated or len(values) < _FEWEST_RAW or (values != np.round(values)).any():
                continue
            said = f'column {column.name!r} holds whole numbers without a unit'
            if column.signal == 'velocity' and np.ptp(values) > 2.0:
                if any(one.integrated for one in self._use.columns):
                    raise InputError(f'{self._path}: {said}: give it, for instance --unit '
                                     'velocity=rpm, or velocity=rad/s')
                self._use.columns.remove(column)
                self._use.notes.append(f'{said}: not used (--unit velocity=0.229rpm)')
            # A sign has three values.
            if column.signal == 'effort' and len(np.unique(values)) > 3:
                self._effort_unit = 'counts'
                noted.setdefault(skeleton(column.name) or column.name, f'{said}: figures are in '
                                 'counts (--unit current=2.69mA)')
        self._use.notes += noted.values()

    def _times(self, columns: Columns, first: int) -> np.ndarray:
        time, rate = self._use.time, self._layout.rate
        if rate or time is None:
            size = len(next(iter(columns.values())))
            return (first + np.arange(size)) / float(rate or 1.0)
        seconds = time.factor * columns[time.name]
        for name, part in self._clock.items():
            seconds = seconds + part * columns[name]
        return seconds

    def _tracks_by_joint(self, columns: Columns, time: np.ndarray, order: np.ndarray
                         ) -> Iterator[Track]:
        """Yield the tracks of each joint's rows, as if it had topics of its own."""
        assert self._whose is not None
        codes = columns[self._whose]
        for code, name in enumerate(self._table.labels[self._whose].names):
            own = np.flatnonzero(codes == code)
            for track in self._tracks({column: values[own] for column, values in columns.items()},
                                      time[own], order[own], name) if len(own) else ():
                # Arrays of commands and directions have no names.
                if '' in track.values and track.signal not in ('current_command', 'direction'):
                    values = {name: track.values['']} if self._joint in (None, name) else {}
                    yield replace(track, topic=f'{name}/{track.topic}', names=[name], values=values)

    def _tracks(self, columns: Columns, time: np.ndarray, order: np.ndarray, whose: str = ''
                ) -> Iterator[Track]:
        """Yield the tracks of rows with their times, s, and their numbers in the table."""
        use, joint = self._use, self._joint
        stamp, valid = _stamps(time)
        missing = np.full(len(stamp), np.nan)

        def read(signal: str, name: str) -> np.ndarray | None:
            if signal == 'effort' and self._gains and use.of(signal, name) is None:
                return use.controller_effort(columns, time, name, self._gains)
            column = use.of(signal, name)
            if column is not None and column.integrated:
                return self._integrals.setdefault((whose, column.name), Integral()).positions(
                    stamp, column.factor * columns[column.name], str(self._path))
            return use.signal_in(columns, signal, name)

        def stack(name: str, *signals: str) -> np.ndarray:
            parts = [read(signal, name) for signal in signals]
            return np.column_stack([missing if values is None else values for values in parts])

        def track(topic: str, values: Columns) -> Track:
            return Track(topic, topic, stamp, stamp, order, use.joints, values)

        states = ['position', 'velocity', 'effort']
        if any(column.signal == 'link_torque' for column in use.columns):
            states.append('link_torque')
        yield track('joint_states', {
            name: np.where(valid[:, None], stack(name, *states), np.nan)
            for name in use.joints if joint in (None, name) or not name})
        for signal, topic in _TOPICS.items():
            values = {name: own[:, None] for name in use.joints
                      if (own := read(signal, name)) is not None}
            if values and topic in ('current_command', 'direction'):
                torque = any(c.signal == signal and c.dimension in ('torque', 'force')
                             for c in use.columns)
                values = {TORQUE_UNIT if torque else '': np.hstack(
                    [values.get(name, missing[:, None]) for name in use.joints])}
            if values:
                yield track(topic, values)
        references = {name: stack(name, 'reference_position', 'reference_velocity')
                      for name in use.joints if use.of('reference_position', name) is not None}
        if references:
            yield track('reference', references)


def _stamps(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Convert times in s to ns, invalid ones to that of the row before; return which are valid."""
    valid = np.abs(time) < _LATEST
    stamp = np.zeros(len(time), dtype=np.int64)
    stamp[valid] = np.round(1e9 * time[valid]).astype(np.int64)
    if valid.any():
        index = np.maximum.accumulate(np.where(valid, np.arange(len(valid)), -1))
        stamp = stamp[np.where(index >= 0, index, np.argmax(valid))]
    return stamp, valid


def table_of(joints: Sequence[Samples]) -> dict[str, np.ndarray]:
    """Return samples on one time base as columns, such as ``elbow.position``; current is effort."""
    columns = {'time': joints[0].time}
    for samples in joints:
        prefix = f'{samples.joint}.' if samples.joint else ''
        for name in _SIGNALS:
            values = getattr(samples, 'current' if name == 'effort' else name)
            if values is not None:
                columns[prefix + name] = values
    return columns


def write_table(path: Path, joints: Sequence[Samples]) -> None:
    """Write the columns of `table_of` as CSV, Parquet or npz; raises InputError if it cannot."""
    columns = table_of(joints)
    name = path.name.lower()
    stream = io.BytesIO()
    if name.endswith('.npz'):
        np.savez_compressed(stream, **columns)  # type: ignore[arg-type] # its allow_pickle
    elif name.endswith('.parquet'):
        arrow = pyarrow_of(path)
        arrow.parquet.write_table(arrow.table(columns), stream)
    elif name.endswith('.csv'):
        stream.write(to_csv(columns, 12).encode())
    else:
        raise InputError(f'{path}: a table is .csv, .parquet or .npz')
    write_atomically(path, stream.getvalue())
