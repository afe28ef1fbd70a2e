# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Assigns signals and units to the columns of a table.

Each column that is used gets a signal, a joint and a factor to SI units: from the user's layout
first, then from the column's name. Columns that are named like one of the user's, but for a number,
are the same signal of another joint. Notes list what was guessed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from friction_comp.column_names import numbers, read_name, Reading, skeleton
from friction_comp.controller_effort import controller_effort
from friction_comp.errors import InputError
from friction_comp.units import (
    default_unit,
    parse_unit,
    possible_units,
    signals_with,
    Unit,
    unit_of,
)

# Whose unit a signal has if none is given for it: a target that of what it is the target of.
_SAME_UNIT = {'current': ('effort',), 'command': ('current', 'effort'),
              'reference_position': ('position',), 'reference_velocity': ('velocity',)}
# Suffixes of table files.
TABLES = ('.csv', '.csv.gz', '.tsv', '.txt', '.dat', '.parquet', '.npz', '.npy', '.mat', '.json',
          '.jsonl')
SIGNALS = ('time', 'position', 'velocity', 'effort', 'current', 'command', 'direction', 'load',
           'link_torque', 'temperature', 'reference_position', 'reference_velocity')


@dataclass(frozen=True)
class Layout:
    """The user's description of a table's columns, and of what no column holds.

    Parameters
    ----------
    columns : dict of str to str
        Signal to column; signals are time, position, velocity, effort, current, command,
        direction, load, link_torque, temperature, reference_position and reference_velocity.
        Columns of other signals are guessed.
    units : dict of str to str
        Signal to unit, such as ``{'position': 'deg', 'time': 'ms'}``; ``counts/4096`` means encoder
        counts, 4096 per turn, and ``2.69mA`` that one count is 2.69 mA. The default is SI units.
    rate : float, optional
        Rows per second, Hz, of a table without times.
    stiffness, damping : sequence of (float or str)
        k_p in N·m/rad and k_d in N·m·s/rad of a position controller: numbers, or columns that hold
        them. Effort is then k_p (target - position) - k_d velocity. One for all recordings, or one
        for each.
    joint : str
        Name of the joint whose columns are given, where they do not name it.

    Raises
    ------
    InputError
        If a signal or a unit is not known.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    rate: float | None = None
    stiffness: Sequence[float | str] = ()
    damping: Sequence[float | str] = ()
    joint: str = ''

    def __post_init__(self) -> None:
        for signal in (*self.columns, *self.units):
            if signal not in SIGNALS:
                raise InputError(f'there is no signal {signal!r}; signals are '
                                 f'{", ".join(SIGNALS)}')
        if 'effort' in self.columns and 'current' in self.columns:
            raise InputError('columns name both effort and current: name only one of them, the '
                             'measured one')
        for signal, unit in self.units.items():
            if signal != 'effort':
                unit_factor(signal, unit)

    @property
    def describes_table(self) -> bool:
        """Whether something is given that only a table needs."""
        return bool(self.columns or self.units or self.rate)

    @property
    def linear(self) -> bool:
        """Whether all that is given are the SI units of a linear axis, which need no columns."""
        units = [unit_of(signal, text) for signal, text in self.units.items()]
        return bool(units) and not (self.columns or self.rate or self.stiffness) and all(
            unit in (Unit(1.0, 'length'), Unit(1.0, 'length/time'), Unit(1.0, 'force'))
            for unit in units)

    def gains(self, names: Sequence[str], where: str) -> tuple[float | str, ...]:
        """Return stiffness and damping of one table, numbers or columns; empty if none are given.

        Raises InputError if a column is missing.
        """
        if not self.stiffness:
            return ()
        if max(len(self.stiffness), len(self.damping)) > 1:
            raise InputError(f'{where}: several gains are given for one recording')
        gains = self.stiffness[0], self.damping[0] if self.damping else 0.0
        for gain in gains:
            if isinstance(gain, str) and gain not in names:
                raise InputError(f'{where}: stiffness and damping are numbers or columns; there is '
                                 f'no column {gain!r}, but {", ".join(map(repr, names))}')
        return gains

    def of_recording(self, index: int, count: int) -> Layout:
        """Return the layout of one of several recordings, with its own gains."""
        def own(values: Sequence[float | str], name: str) -> Sequence[float | str]:
            if len(values) not in (0, 1, count):
                raise InputError(f'{name}: {len(values)} values for {count} recordings; give one, '
                                 'or one for each')
            return values[index:index + 1] if len(values) == count else values
        return replace(self, stiffness=own(self.stiffness, 'stiffness'),
                       damping=own(self.damping, 'damping'))


@dataclass(frozen=True)
class Column:
    """A used column: its name, signal, joint and unit, and the factor to SI units."""

    name: str
    signal: str
    joint: str
    unit: str
    factor: float
    dimension: str = ''     # what the unit measures, such as angle; '' if it is not known
    key: tuple[str, ...] = ()
    stated: bool = False    # whether the unit was given, by the user or in the name


@dataclass
class Assignment:
    """The used columns of a table."""

    columns: list[Column]
    effort_is_current: bool     # whether efforts are in A
    notes: list[str]            # what was guessed
    chosen: str | None = None   # the joint whose columns the user named

    @property
    def time(self) -> Column | None:
        """The column of time; None if rows come at a known rate."""
        return next((column for column in self.columns if column.signal == 'time'), None)

    @property
    def joints(self) -> list[str]:
        """Names of the joints; a single joint without a name is ''."""
        return list(dict.fromkeys(c.joint for c in self.columns if c.signal == 'position'))

    @property
    def linear(self) -> bool:
        """Whether positions are lengths: values are then in m and N."""
        return any(c.dimension == 'length' for c in self.columns if c.signal == 'position')

    def of(self, signal: str, joint: str) -> Column | None:
        """Return the column of a joint's signal, or None."""
        return next((column for name in (joint, '') for column in self.columns
                     if column.signal == signal and column.joint == name), None)

    def signal_in(self, table: Mapping[str, np.ndarray], signal: str, joint: str
                  ) -> np.ndarray | None:
        """Return a joint's signal in SI units from the columns of a table, or None."""
        column = self.of(signal, joint)
        return None if column is None else column.factor * table[column.name]

    def controller_effort(self, values: Mapping[str, np.ndarray], time: np.ndarray, joint: str,
                          gains: Sequence[Any]) -> tuple[np.ndarray, str] | None:
        """Return a joint's effort and a note by `controller_effort`; None without a target."""
        target, position, velocity, rate = (
            self.signal_in(values, signal, joint) for signal in (
                'reference_position', 'position', 'velocity', 'reference_velocity'))
        if target is None or position is None:
            return None
        stiffness, damping = gains
        return controller_effort(time, target, position, velocity, stiffness, damping, rate)


def unit_factor(signal: str, unit: str) -> float:
    """Return the factor that converts a column's numbers to SI units.

    Raises InputError if the unit is not known for this signal.
    """
    known = unit_of(signal, unit)
    if known is not None:
        return known.factor
    if signal == 'effort':
        # In other units, such as volts or per cent of a servo's range, values stay as they are.
        return 1.0
    raise InputError(f'{signal} cannot be in {unit!r}; its units are {possible_units(signal)}, '
                     'with a factor before them if needed, as in 2.69mA')


def signal_with_unit(unit: str) -> str | None:
    """Return a signal that has a known unit which effort cannot have, else None."""
    signals = signals_with(unit)
    return None if not signals or 'effort' in signals else (
        'position' if parse_unit(unit).dimension == 'counts'  # type: ignore[union-attr]
        else signals[0])


def assign(names: Sequence[str], layout: Layout | None, where: str) -> Assignment:
    """Assign signals to a table's columns; `where` names the table in messages.

    Columns without a name are left out. Raises InputError if a column is missing, or time, position
    or effort cannot be found.
    """
    layout = layout or Layout()
    names = [name for name in names if name]
    named = _named(names, layout, where)
    own = next((column.key for column in named if column.signal != 'time'), ())
    used = _joint_columns([*named, *_guessed(names, named, own, layout)], own if named else None)
    used.sort(key=lambda c: (SIGNALS.index(c.signal), names.index(c.name)))
    _check_complete(used, names, layout, where)
    keys = list(dict.fromkeys(c.key for c in used if c.signal == 'position'))
    labels = _labels(used, keys, layout, own if any(c.signal != 'time' for c in named) else None)
    used = [replace(column, joint=labels.get(column.key, ''),
                    signal='effort' if column.signal == 'current' else column.signal)
            for column in used]
    in_ampere = {column.dimension == 'current' for column in used if column.signal == 'effort'}
    if len(in_ampere) > 1:
        raise InputError(f'{where}: some joints have a current, others an effort: name the columns '
                         'of one joint with --columns')
    return Assignment(used, in_ampere == {True}, _notes(used, layout),
                      labels.get(own) if named and len(keys) > 1 else None)


def without_time(names: Sequence[str], layout: Layout, where: str) -> tuple[Column, Column] | None:
    """Return the columns of velocity and effort of a table of steady states, else None.

    It has neither time nor position: each row is the mean of a motion at constant speed. Raises
    InputError if it has several joints, and none is named.
    """
    if layout.rate or not set(layout.columns.values()) <= set(names):
        return None
    named = _named(names, layout, where)
    columns = [*named, *_guessed([name for name in names if name], named, (), layout)]
    if any(c.signal in ('time', 'position') for c in columns):
        return None
    # A commanded speed is that of the means, where the measured one is not given.
    measured = any(c.signal == 'velocity' for c in columns)
    wanted = 'velocity' if measured else 'reference_velocity'
    pairs = [(speed, effort) for speed in columns if speed.signal == wanted
             for effort in columns if _kind(effort.signal) == 'effort'
             and (effort.key in (speed.key, ()) or speed.key == ())]
    pairs = [pair for pair in pairs if pair[0] in named or pair[1] in named] or pairs
    chosen = [pair for pair in pairs if layout.joint in (pair[0].joint, pair[1].joint)] or pairs
    if len(chosen) > 1:
        raise InputError(f'{where}: several joints, name one with --joint or --columns: '
                         + ', '.join(repr(speed.joint or effort.joint) for speed, effort in chosen))
    return chosen[0] if chosen else None


def _notes(used: Sequence[Column], layout: Layout) -> list[str]:
    # A column named after its signal is not a guess.
    guessed = [column for column in used if column.name not in layout.columns.values()
               and column.name.lower() != f'{column.joint}.{column.signal}'.strip('.').lower()
               and not (column.signal == 'effort' and column.name == 'current')]
    if not guessed:
        return []
    return ['columns guessed from their names: ' + ', '.join(
        f'{column.joint}.{column.signal}'.lstrip('.') + f'={column.name}'
        + (f' in {column.unit}' if column.unit else '')
        for column in guessed) + ' (override with --columns and --unit)']


def _named(names: Sequence[str], layout: Layout, where: str) -> list[Column]:
    """Return the columns that the user named, all of one joint but time."""
    for name in layout.columns.values():
        if name not in names:
            raise InputError(f'{where}: has no column {name!r}, but '
                             f'{", ".join(map(repr, names))}')
    first = next((layout.columns[signal] for signal in ('position', 'effort', 'current', 'velocity')
                  if signal in layout.columns), '')
    key = _key(first)
    return [_column(name, Reading(signal, () if signal == 'time' else key,
                                  read_name(name).joint or '_'.join(key), read_name(name).unit),
                    layout) for signal, name in layout.columns.items()]


def _key(name: str) -> tuple[str, ...]:
    reading = read_name(name)
    return reading.key if reading.signal or not skeleton(name) else numbers(name)


def _column(name: str, reading: Reading, layout: Layout) -> Column:
    signal = reading.signal
    given = next((layout.units[one] for one in (signal, *_SAME_UNIT.get(signal, ()))
                  if one in layout.units), '')
    text = given or reading.unit
    unit = unit_of(signal, text) if text else None
    stated = unit is not None
    if unit is None and given and signal == 'effort':
        # A unit such as V or %: only a factor before it is applied.
        return Column(name, signal, reading.joint, given, 1.0, '', reading.key, True)
    if unit is None:
        text = 'N·m' if reading.torque else default_unit(signal)
        unit = unit_of(signal, text)
        # The torque constant may make a current of an effort without a unit.
        text = '' if signal == 'effort' else text
    elif signal in ('velocity', 'reference_velocity') and parse_unit(text) != unit:
        text = text if '/' in text or text.endswith('pm') else f'{text}/s'
    dimension, factor = (unit.dimension, unit.factor) if unit else ('', 1.0)
    return Column(name, signal, reading.joint, text, factor, dimension, reading.key, stated)


def _guessed(names: Sequence[str], named: Sequence[Column], own: tuple[str, ...],
             layout: Layout) -> list[Column]:
    """Return the columns recognised by their names, the best of those for one signal of a joint."""
    patterns = {skeleton(column.name): column.signal for column in named
                if skeleton(column.name) and column.signal != 'time'}
    taken = {column.name for column in named}
    signals = {_kind(column.signal) for column in named}
    found: list[tuple[tuple[int, int, int], Column]] = []
    for place, name in enumerate(names):
        reading = read_name(name)
        if skeleton(name) in patterns:
            reading = replace(reading, signal=patterns[skeleton(name)], key=_key(name),
                              joint=reading.joint or '_'.join(numbers(name)))
        named_already = _kind(reading.signal) in signals and reading.key in (own, ())
        if reading.signal and name not in taken and not named_already:
            column = _column(name, reading, layout)
            found.append(((SIGNALS.index(column.signal), reading.rank, place), column))
    best: dict[tuple[str, tuple[str, ...]], Column] = {}
    in_ampere = any(c.dimension == 'current' for c in named if _kind(c.signal) == 'effort')
    for _, column in sorted(found, key=lambda entry: entry[0]):
        if column.signal in ('effort', 'current') and column.dimension == 'current':
            in_ampere = in_ampere or ('effort', column.key) not in best
        # Without the torque constant, a commanded torque says nothing beside a current.
        if column.signal == 'command' and in_ampere and column.dimension != 'current':
            continue
        best.setdefault((_kind(column.signal), column.key), column)
    return list(best.values())


def _kind(signal: str) -> str:
    return 'effort' if signal == 'current' else signal


def _joint_columns(used: Sequence[Column], own: tuple[str, ...] | None) -> list[Column]:
    """Return the columns of joints that have position and effort, and of no joint in particular.

    `own` is the joint of the user's columns, None if none are named.
    """
    positions = list(dict.fromkeys(c.key for c in used if c.signal == 'position'))
    efforts = list(dict.fromkeys(c.key for c in used if _kind(c.signal) == 'effort'))
    if len(positions) == len(efforts) == 1 and () not in efforts and positions != efforts:
        # The only position and the only effort are of one joint, however they are named.
        used = [replace(c, key=positions[0]) if c.key == efforts[0] else c for c in used]
        efforts = positions
    both = [key for key in positions if key in efforts]
    keys = both if both and (() not in efforts or () in positions) else positions
    return [c for c in used if c.key in (*keys, (), own)]


def _labels(used: Sequence[Column], keys: Sequence[tuple[str, ...]], layout: Layout,
            own: tuple[str, ...] | None) -> dict[tuple[str, ...], str]:
    """Return the name of each joint; `own` is that of the user's columns, None if none are given.

    Alone, it needs no name.
    """
    labels = {key: next(c.joint for c in used if c.signal == 'position' and c.key == key)
              if key else '' for key in keys}
    if len(keys) == 1 and own is not None:
        labels = {keys[0]: ''}
    given = keys[0] if list(labels.values()) == [''] else own
    if layout.joint and layout.joint not in labels.values() and given is not None:
        labels[given] = layout.joint
    return labels


def _check_complete(used: Iterable[Column], names: Sequence[str], layout: Layout, where: str
                    ) -> None:
    """Raise InputError if a signal that is needed has no column."""
    signals = {_kind(column.signal) for column in used}
    needed = {'time': not layout.rate, 'position': True, 'effort': not layout.stiffness,
              'reference_position': bool(layout.stiffness)}
    for signal, wanted in needed.items():
        if not wanted or signal in signals:
            continue
        hints = {'time': ', or the rows per second with --rate HZ'}
        if 'reference_position' in signals:
            hints['effort'] = (', or the gains of the position controller with --stiffness and '
                               '--damping: effort is then k_p (target - position) - k_d velocity')
        elif 'command' in signals:
            hints['effort'] = ', a command only if the drive is known to follow it'
        what = 'effort or current' if signal == 'effort' else signal.replace('_', ' ')
        raise InputError(f'{where}: which column is the {what}? Name it with --columns '
                         f'{signal}=NAME{hints.get(signal, "")}; there are '
                         f'{", ".join(map(repr, names))}')
