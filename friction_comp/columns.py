# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Assigns signals and units to the columns of a table.

Each column that is used gets a signal, a joint and a factor to SI units: from the user's layout
first, then from the column's name. Columns that are named like one of the user's, but for a number,
are the same signal of another joint. Notes list what was guessed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from friction_comp.column_names import (
    common_name,
    is_linear,
    numbers,
    other_unit_in,
    read_name,
    read_of_axis,
    Reading,
    skeleton,
)
from friction_comp.controller_effort import controller_effort
from friction_comp.errors import InputError
from friction_comp.layout import Layout, SIGNALS
from friction_comp.units import default_unit, parse_unit, unit_of
from friction_comp.used_columns import Column, notes_on

# Signals whose unit a signal takes if none is given for it.
_SAME_UNIT = {'current': ('effort',), 'command': ('current', 'effort'),
              'reference_position': ('position',), 'reference_velocity': ('velocity',)}
_Read = Callable[[str], Reading]    # `read_name`, or `read_of_axis`
_MOST_NAMES = 200    # columns that a message lists
_TORQUES = ('effort', 'load', 'link_torque', 'command')     # what means torque, or force


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
        """Return the column of a joint's signal, or None.

        What names no joint is everyone's, unless it is that of a joint without a name.
        """
        shared = signal in ('time', 'temperature') or '' not in self.joints
        names = [joint, ''] if shared else [joint]
        return next((column for name in names for column in self.columns
                     if column.signal == signal and column.joint == name), None)

    def signal_in(self, table: Mapping[str, np.ndarray], signal: str, joint: str
                  ) -> np.ndarray | None:
        """Return a joint's signal in SI units from the columns of a table, or None."""
        column = self.of(signal, joint)
        return None if column is None else column.factor * table[column.name]

    def controller_effort(self, values: Mapping[str, np.ndarray], time: np.ndarray, joint: str,
                          gains: Sequence[float | str]) -> np.ndarray | None:
        """Return a joint's effort by `controller_effort`, and note how; None without a target.

        `gains` are `Layout.gains`, numbers or columns.
        """
        target, position, velocity, rate = (
            self.signal_in(values, signal, joint) for signal in (
                'reference_position', 'position', 'velocity', 'reference_velocity'))
        if target is None or position is None:
            return None
        stiffness, damping = (values[gain] if isinstance(gain, str) else gain for gain in gains)
        effort, note = controller_effort(time, target, position, velocity, stiffness, damping, rate)
        self.notes += [note] if note not in self.notes else []
        return effort


def assign(names: Sequence[str], layout: Layout | None, where: str, of_plan: bool = False,
           integrates: bool = False) -> Assignment:
    """Assign signals to a table's columns; `where` names the table in messages.

    Columns without a name are left out. Targets are the positions and velocities of a plan. If no
    column can be the position, and the reader `integrates`, those of velocity are used. Raises
    InputError if a column is missing, or time, position or effort cannot be found.
    """
    names = [name for name in names if name]
    layout = (layout or Layout()).naming(names, where)
    read = _reader(names, layout)
    named = _named(layout, read, where)
    own = next((column.key for column in named if column.signal != 'time'), ())
    found = [*named, *_guessed(names, named, own, layout, read, of_plan)]
    if integrates and not layout.stiffness:
        found += _integrals(found, names, read)
    found = _named_joints(found)
    used = _joint_columns(found, own if named else None, where)
    used.sort(key=lambda c: (SIGNALS.index(c.signal), names.index(c.name)))
    _check_complete(used, names, layout, read, where)
    keys = list(dict.fromkeys(c.key for c in used if c.signal == 'position'))
    labels = _labels(used, keys, layout, own if any(c.signal != 'time' for c in named) else None)
    used = [replace(column, joint=labels.get(column.key, ''),
                    signal='effort' if column.signal == 'current' else column.signal)
            for column in used]
    in_ampere = {column.dimension == 'current' for column in used if column.signal == 'effort'}
    if len(in_ampere) > 1:
        raise InputError(f'{where}: some joints have a current, others an effort: name the columns '
                         'of one joint with --columns')
    integrals = [column.name for column in used if column.integrated]
    notes = notes_on(used, named, found, names, layout) + [
        f'no column holds the position: it is the integral of {", ".join(integrals)}, zero at the '
        'start, and drifts. What depends on position, such as a weight, a spring or cogging, is '
        'not to be believed'] * bool(integrals)
    return Assignment(used, in_ampere == {True}, notes,
                      labels.get(own) if named and len(keys) > 1 else None)


def without_time(names: Sequence[str], layout: Layout, where: str) -> tuple[Column, Column] | None:
    """Return the columns of velocity and effort of a table of steady states, else None.

    Its rows are means at constant speeds, without time and position. Raises InputError if it has
    several joints, and none is named, or several speeds for a torque, as of both sides of a gear.
    """
    layout = layout.naming(names, where)
    read = _reader(names, layout)
    named = _named(layout, read, where)
    columns = [*named, *_guessed(list(filter(None, names)), named, (), layout, read)]
    if layout.rate or any(c.signal in ('time', 'position') for c in columns):
        return None
    # A commanded speed is that of the means where none is measured.
    wanted = 'velocity' if any(c.signal == 'velocity' for c in columns) else 'reference_velocity'
    pairs = [(speed, effort) for speed in columns if speed.signal == wanted
             for effort in columns if _kind(effort.signal) == 'effort'
             and (effort.key in (speed.key, ()) or speed.key == ())]
    told = [sum(column in named for column in pair) for pair in pairs]
    pairs = [pair for pair, count in zip(pairs, told) if count == max(told)]
    chosen = [pair for pair in pairs if layout.joint in (pair[0].joint, pair[1].joint)] or pairs
    if len(chosen) > 1:
        raise InputError(f'{where}: several joints, name one with --joint or --columns: '
                         + ', '.join(repr(speed.joint or effort.joint) for speed, effort in chosen))
    for speed, effort in chosen:
        speeds = [name for name in names if (reading := read(name)).signal == wanted
                  and reading.key in (speed.key, effort.key, ())]
        if len(speeds) > 1 and speed not in named:
            raise InputError(f'{where}: which speed is that of {effort.name}? Name both, --columns '
                             f'velocity=NAME,effort={effort.name}; there are {", ".join(speeds)}')
    return chosen[0] if chosen else None


def _reader(names: Sequence[str], layout: Layout) -> _Read:
    """Return how names are read: with m and N as units where columns tell only a linear axis."""
    of_user = {name: signal for signal, name in layout.columns.items()}
    told = set[bool | None]()
    for name in names:
        reading = read_name(name)
        signal = of_user.get(name, reading.signal)
        told.add(is_linear(name, signal, layout.units.get(signal, reading.unit)))
    return read_of_axis if told - {None} == {True} else read_name


def _named(layout: Layout, read: _Read, where: str) -> list[Column]:
    """Return the columns that the user named, all of one joint but time."""
    first = next((layout.columns[signal] for signal in ('position', 'effort', 'current', 'velocity')
                  if signal in layout.columns), '')
    key = _key(first, read)
    names = [name for signal, name in layout.columns.items() if signal != 'time']
    if numbers(first) and {_key(name, read) for name in names} != {key} and all(
            numbers(name) == numbers(first) for name in names):
        # Where words differ, as in pos_read_1 and curr_1, the number is the joint.
        key = numbers(first)
    readings = {}
    for signal, name in layout.columns.items():
        own = read(name)
        # An effort whose name says that it is a current is one, and in A.
        signal = own.signal if (signal, own.signal) == ('effort', 'current') else signal
        reading = readings[name] = Reading(
            signal, () if signal == 'time' else key, own.joint or '_'.join(key), own.unit)
        if _unknown_unit(reading, layout):
            raise InputError(f'{where}: {_say_unit(name, reading)}')
        if signal == 'effort' and not reading.unit and own.signal not in _TORQUES:
            # Only a name that means torque or force is one.
            if not ('effort' in layout.units or other_unit_in(name)):
                raise InputError(f'{where}: column {name!r}: its name tells no unit: say what one '
                                 'of it is, --unit effort=N·m, or A, V, %, or 2.69mA')
            readings[name] = replace(reading, unit=other_unit_in(name))
    return [_column(name, reading, layout) for name, reading in readings.items()]


def _unknown_unit(reading: Reading, layout: Layout) -> bool:
    """Return whether a name gives an unknown unit, of no effort, and the user gives none."""
    signal = reading.signal
    given = any(one in layout.units for one in (signal, *_SAME_UNIT.get(signal, ())))
    return (bool(reading.unit) and not given and signal not in ('effort', 'current')
            and unit_of(signal, reading.unit) is None)


def _say_unit(name: str, reading: Reading) -> str:
    example = {'position': 'counts/4096 (counts in a turn), or deg',
               'time': 'counts/100 (in a second)', 'velocity': '0.229rpm'}.get(
                   reading.signal, default_unit(reading.signal))
    return (f'column {name!r}: {reading.unit!r} does not tell what a {reading.signal} of 1 is: '
            f'say it, for instance with --unit {reading.signal}={example}')


def _key(name: str, read: _Read) -> tuple[str, ...]:
    reading = read(name)
    return reading.key if reading.signal or not skeleton(name) else numbers(name)


def _column(name: str, reading: Reading, layout: Layout) -> Column:
    """Return a column in the unit of the layout, else of its name, else the SI unit."""
    signal = reading.signal
    given = next((layout.units[one] for one in (signal, *_SAME_UNIT.get(signal, ()))
                  if one in layout.units), '')
    if signal == 'current' and unit_of(signal, given) is None and unit_of('effort', given):
        signal = 'effort'   # 62N: the force of 1 A
    text = given or reading.unit
    unit = unit_of(signal, text) if text else None
    stated = unit is not None
    if unit is None and text and signal in ('effort', 'current'):
        # A unit such as V or %: values stay as they are.
        return Column(name, 'effort', reading.joint, text, 1.0, '', reading.key, True)
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
             layout: Layout, read: _Read, of_plan: bool = False) -> list[Column]:
    """Return the columns recognised by their names, the best of those for one signal of a joint."""
    patterns = {skeleton(column.name): column.signal for column in named
                if skeleton(column.name) and column.signal != 'time'}
    taken, signals = {c.name for c in named}, {_kind(c.signal) for c in named}
    by_number = own in [numbers(c.name) for c in named if c.signal != 'time']
    found: list[tuple[tuple[int, ...], Column]] = []
    for place, name in enumerate(names):
        reading, alike = read(name), skeleton(name) in patterns
        if of_plan:
            reading = replace(reading, signal=reading.signal.removeprefix('reference_'))
        if alike:
            key = numbers(name) if by_number else _key(name, read)
            reading = replace(reading, signal=patterns[skeleton(name)], key=key,
                              joint=reading.joint or '_'.join(numbers(name)))
        named_already = _kind(reading.signal) in signals and reading.key in (own, ())
        if reading.signal and name not in taken and not (
                named_already or _unknown_unit(reading, layout)):
            column = _column(name, reading, layout)
            kind = _kind(column.signal)
            # What is named as the user's columns comes first. The name decides, whatever unit the
            # user gives: a column in V or % is used only if none is in a unit of effort.
            other = bool(reading.unit) and unit_of(reading.signal, reading.unit) is None
            found.append(((SIGNALS.index(kind), not alike, kind == 'effort' and not
                           reading.measured, other, SIGNALS.index(reading.signal), reading.rank,
                           place), column))
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


def _integrals(found: Sequence[Column], names: Sequence[str], read: _Read) -> list[Column]:
    """Return the columns of velocity as positions; none if a column could be the position."""
    positions = ('position', 'reference_position')
    readings = [read(name) for name in names]
    # What has the unit of an angle or a length is unknown, and may be it.
    told = {column.signal for column in found} | {reading.signal for reading in readings}
    if told & {*positions} or any(
            unit_of('position', one.unit) for one in readings if not one.signal):
        return []
    return [replace(column, signal='position', dimension=column.dimension.removesuffix('/time'),
                    stated=True, integrated=True)
            for column in found if column.signal == 'velocity']


def _kind(signal: str) -> str:
    return 'effort' if signal == 'current' else signal


def _named_joints(columns: Sequence[Column]) -> list[Column]:
    """Return columns with the name of a joint that is a quantity: phi_pos, phi_tau, tail_pos.

    It names a joint only beside others, and if position and effort have it in common.
    """
    own = [c for c in columns if not c.key and c.signal in ('position', 'effort', 'current')]
    others = any(c.key for c in columns if c.signal == 'position')
    label = common_name([c.name for c in own]) if len(own) > 1 and others else ''
    return [replace(c, key=(label.lower(),), joint=label) if label and not c.key and common_name(
        [c.name, own[0].name]) else c for c in columns]


def _joint_columns(used: Sequence[Column], own: tuple[str, ...] | None, where: str
                   ) -> list[Column]:
    """Return the columns of joints with position and effort, of the user's (`own`) and of none.

    Raises InputError if efforts name joints that no position does, beside one that names none.
    """
    positions = list(dict.fromkeys(c.key for c in used if c.signal == 'position'))
    efforts = list(dict.fromkeys(c.key for c in used if _kind(c.signal) == 'effort'))
    if len(positions) == len(efforts) == 1 and () not in efforts and positions != efforts:
        # The only position and the only effort are of one joint, however they are named.
        used = [replace(c, key=positions[0]) if c.key == efforts[0] else c for c in used]
        efforts = positions
    both = [key for key in positions if key in efforts]
    if own is None and () in efforts and () not in positions and len(efforts) > 1 and (
            both or len(positions) > 1):
        # An effort that names no joint is that of any, but not beside those that name theirs.
        if not both:
            raise InputError(f'{where}: which effort is of which joint? Name the columns of one '
                             'with --columns position=NAME,effort=NAME; there are ' + ', '.join(
                                 repr(c.name) for c in used
                                 if _kind(c.signal) in ('position', 'effort')))
        used = [c for c in used if c.key or _kind(c.signal) != 'effort']
        efforts.remove(())
    keys = both if both and (() not in efforts or () in positions) else positions
    return [c for c in used if c.key in (*keys, (), own)]


def _labels(used: Sequence[Column], keys: Sequence[tuple[str, ...]], layout: Layout,
            own: tuple[str, ...] | None) -> dict[tuple[str, ...], str]:
    """Return the name of each joint; that of the user's columns (`own`) needs none if alone."""
    labels = {key: next(c.joint for c in used if c.signal == 'position' and c.key == key)
              if key else '' for key in keys}
    if len(keys) == 1 and own is not None:
        labels = {keys[0]: ''}
    given = keys[0] if list(labels.values()) == [''] else own
    if layout.joint and layout.joint not in labels.values() and given is not None:
        labels[given] = layout.joint
    return labels


def _check_complete(used: Iterable[Column], names: Sequence[str], layout: Layout,
                    read: _Read, where: str) -> None:
    """Raise InputError if a required signal is missing, with the ways to give it."""
    signals = {_kind(column.signal) for column in used}
    needed = {'time': not layout.rate, 'position': True, 'effort': not layout.stiffness,
              'reference_position': bool(layout.stiffness)}
    missing = [signal for signal, wanted in needed.items() if wanted and signal not in signals]
    for signal in missing:
        for name in names:
            if (reading := read(name)).signal == signal and _unknown_unit(reading, layout):
                raise InputError(f'{where}: {_say_unit(name, reading)}')
    if not missing:
        return
    hints = {'time': ', or the rows per second with --rate HZ'}
    if 'reference_position' in signals:
        hints['effort'] = (', or the gains of the position controller with --stiffness and '
                           '--damping: effort is then k_p (target - position) - k_d velocity')
    elif 'command' in signals:
        hints['effort'] = ', a command only if the drive is known to follow it'
    said = ', the '.join({'effort': 'effort or current'}.get(one, one.replace('_', ' '))
                         for one in missing)
    verb, them = ('s are', 'them') if len(missing) > 1 else (' is', 'it')
    raise InputError(f'{where}: which column{verb} the {said}? Name {them} with --columns '
                     f'{",".join(f"{one}=NAME" for one in missing)}'
                     f'{"".join(hints.get(one, "") for one in missing)}; there are '
                     f'{", ".join(map(repr, names[:_MOST_NAMES]))}' + (
                         f' and {len(names) - _MOST_NAMES} more: where a row holds a signal and '
                         'not a time, transpose the table' if len(names) > _MOST_NAMES else '')
                     + ('; of several files with a signal each, the names tell it, as in time.csv, '
                        'q.csv and tau.csv' if all(map(str.isdigit, names)) else ''))
