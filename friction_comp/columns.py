# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Assigns signals and units to the columns of a table.

Each column that is used gets a signal, a joint and a factor to SI units: from the user's layout
first, then from the column's name, by common names of signals and a unit as in ``q [deg]``. Notes
list what was guessed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
import re

import numpy as np

from friction_comp.errors import InputError

# Suffixes of table files.
TABLES = ('.csv', '.csv.gz', '.tsv', '.parquet', '.npz')

# Signal to its common column names, without joint and unit. `current` is an effort in A.
_NAMES = {
    'time': 'time t timestamp stamp sec secs seconds elapsed elapsed_time',
    'position': 'position pos q angle theta phi joint_position joint_angle actual_position',
    'velocity': 'velocity vel dq qd qdot q_dot dot_q omega speed dtheta joint_velocity '
                'actual_velocity',
    'effort': 'effort torque tau motor_torque joint_torque tau_m actual_torque',
    'current': 'current i iq i_q i_m im motor_current actual_current measured_current',
    'command': 'command current_command commanded_current i_cmd i_des cmd',
    'direction': 'direction d dir',
    'load': 'load tau_b tau_ext interaction_torque interaction_wrench backdriving_torque '
            'back_driving_torque external_torque sensor_torque',
    'temperature': 'temperature temp motor_temperature motor_temp',
    'reference_position': 'reference_position reference ref q_ref q_des q_d desired_position '
                          'target_position pos_ref',
    'reference_velocity': 'reference_velocity dq_ref dq_des qd_ref desired_velocity '
                          'target_velocity vel_ref',
}
SIGNALS = tuple(_NAMES)
_SIGNAL_OF = {name: signal for signal, names in _NAMES.items() for name in names.split()}

_TURN = 2.0 * np.pi
_ANGLES = {'rad': 1.0, 'mrad': 1e-3, 'deg': np.pi / 180.0, 'degrees': np.pi / 180.0,
           '°': np.pi / 180.0, 'turn': _TURN, 'turns': _TURN, 'rev': _TURN, 'm': 1.0, 'mm': 1e-3}
_SPEEDS = {**{f'{unit}/s': factor for unit, factor in _ANGLES.items()}, 'rpm': _TURN / 60.0}
_TORQUES = {'N·m': 1.0, 'Nm': 1.0, 'N*m': 1.0, 'N.m': 1.0, 'mN·m': 1e-3, 'mNm': 1e-3, 'N': 1.0}
_CURRENTS = {'A': 1.0, 'mA': 1e-3}
_UNITS = {
    'time': {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'µs': 1e-6, 'ns': 1e-9, 'min': 60.0},
    'position': _ANGLES, 'velocity': _SPEEDS, 'effort': {**_TORQUES, **_CURRENTS},
    'current': _CURRENTS, 'command': _CURRENTS, 'direction': {}, 'load': _TORQUES,
    'temperature': {'°C': 1.0, 'C': 1.0, 'degC': 1.0}, 'reference_position': _ANGLES,
    'reference_velocity': _SPEEDS,
}
_COUNTS = re.compile(r'counts/(\d+(?:\.\d+)?)(/s)?')
# A unit in brackets after a name, or as its last part.
_BRACKET = re.compile(r'\s*[\[(]([^\])]*)[\])]\s*$')
_LAST = re.compile(r'_(s|ms|us|ns|deg|rad|rpm|mA|A|Nm|mNm)$')


@dataclass(frozen=True)
class Layout:
    """The user's description of a table's columns.

    Parameters
    ----------
    columns : dict of str to str
        Signal to column; signals are time, position, velocity, effort, current, command,
        direction, load, temperature, reference_position and reference_velocity. Columns of other
        signals are guessed.
    units : dict of str to str
        Signal to unit, such as ``{'position': 'deg', 'time': 'ms'}``; ``counts/4096`` means encoder
        counts, 4096 per turn. The default is SI units.

    Raises
    ------
    InputError
        If a signal or a unit is not known.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for signal in (*self.columns, *self.units):
            if signal not in _NAMES:
                raise InputError(f'there is no signal {signal!r}; signals are '
                                 f'{", ".join(SIGNALS)}')
        if 'effort' in self.columns and 'current' in self.columns:
            raise InputError('columns name both effort and current: name only one of them, the '
                             'measured one')
        for signal, unit in self.units.items():
            if signal != 'effort':
                unit_factor(signal, unit)


@dataclass(frozen=True)
class Column:
    """A used column: its name, signal, joint and unit, and the factor to SI units."""

    name: str
    signal: str
    joint: str
    unit: str
    factor: float


@dataclass
class Assignment:
    """The used columns of a table."""

    columns: list[Column]
    effort_is_current: bool     # whether efforts are in A
    notes: list[str]            # what was guessed

    @property
    def time(self) -> Column:
        """The column of time."""
        return next(column for column in self.columns if column.signal == 'time')

    @property
    def joints(self) -> list[str]:
        """Names of the joints; a single joint without a name is ''."""
        return list(dict.fromkeys(c.joint for c in self.columns if c.signal == 'position'))

    def of(self, signal: str, joint: str) -> Column | None:
        """Return the column of a joint's signal, or None."""
        return next((column for column in self.columns if column.signal == signal
                     and column.joint in (joint, '')), None)


def unit_factor(signal: str, unit: str) -> float:
    """Return the factor that converts a column's numbers to SI units.

    Raises InputError if the unit is not known for this signal.
    """
    known = _UNITS[signal]
    if unit in known:
        return known[unit]
    counts = _COUNTS.fullmatch(unit)
    if counts and f'rad{counts[2] or ""}' in known and float(counts[1]) > 0:
        return _TURN / float(counts[1])
    if signal == 'effort':
        # In other units, such as volts or per cent of a servo's range, values stay as they are.
        return 1.0
    listed = ', '.join(known) or 'none'
    more = ', counts/N (N per turn)' if 'rad' in known else ', counts/N/s' if 'rad/s' in known \
        else ''
    raise InputError(f'{signal} cannot be in {unit!r}; its units are {listed}{more}')


def signal_with_unit(unit: str) -> str | None:
    """Return a signal that has a known unit which effort cannot have, else None."""
    if unit in _UNITS['effort']:
        return None
    if _COUNTS.fullmatch(unit):
        return 'velocity' if unit.endswith('/s') else 'position'
    return next((signal for signal, units in _UNITS.items() if unit in units), None)


def to_numbers(values: np.ndarray, name: str, where: object) -> np.ndarray:
    """Return the values of a column as floats, and dates in s.

    Raises InputError, which begins with `where`, if it does not contain numbers.
    """
    if np.issubdtype(values.dtype, np.datetime64):
        dates = values.astype('datetime64[ns]')
        return np.where(np.isnat(dates), np.nan, dates.astype(np.int64) * 1e-9)
    try:
        return values.astype(float)
    except (TypeError, ValueError):
        raise InputError(f'{where}: column {name!r} does not contain numbers') from None


def read_pairs(text: str, what: str, form: str = 'SIGNAL=NAME, for instance time=t,position=q_2'
               ) -> dict[str, str]:
    """Parse ``a=b,c=d`` into a dictionary; InputError, which says the form, if it is invalid."""
    pairs: dict[str, str] = {}
    for part in text.split(','):
        name, sign, value = (piece.strip() for piece in part.partition('='))
        if not (name and sign and value):
            raise InputError(f'{what}: {part.strip()!r} is not of the form {form}')
        if name in pairs:
            raise InputError(f'{what}: names {name} twice')
        pairs[name] = value
    return pairs


def assign(names: Sequence[str], layout: Layout | None, where: str) -> Assignment:
    """Assign signals to a table's columns; `where` names the table in messages.

    Raises InputError if a column is missing, or time, position or effort cannot be found.
    """
    layout = layout or Layout()
    listed = ', '.join(map(repr, names))
    used: list[Column] = []
    for signal, name in layout.columns.items():
        if name not in names:
            raise InputError(f'{where}: has no column {name!r}, but {listed}')
        used.append(_column(name, signal, '', layout))
    known = len(used)
    taken = {column.name for column in used}
    for column in _guesses([name for name in names if name not in taken], layout):
        # If the user names the columns of a joint, columns of other joints are ignored.
        if not (column.signal in layout.columns or _is_duplicate(column, used)
                or (column.joint and 'position' in layout.columns)):
            used.append(column)
    for wanted in (('time',), ('position',), ('effort', 'current')):
        if not any(column.signal in wanted for column in used):
            raise InputError(f'{where}: which column is the {" or ".join(wanted)}? Name it with '
                             f'--columns {wanted[0]}=NAME; there are {listed}')
    notes = []
    # A column named after its signal is not a guess.
    guessed = [column for column in used[known:] if _full_name(column) != column.name]
    if guessed:
        notes.append('columns guessed from their names: ' + ', '.join(
            f'{_full_name(column)}={column.name}{f" in {column.unit}" if column.unit else ""}'
            for column in guessed) + ' (override with --columns and --unit)')
    measured = [column for column in used if column.signal in ('effort', 'current')]
    in_ampere = {column.signal == 'current' or column.unit in _CURRENTS for column in measured}
    if len(in_ampere) > 1:
        raise InputError(f'{where}: some joints have a current, others an effort: name the columns '
                         'of one joint with --columns')
    return Assignment([
        Column(c.name, 'effort' if c.signal == 'current' else c.signal, c.joint, c.unit, c.factor)
        for c in used], in_ampere == {True}, notes)


def _full_name(column: Column) -> str:
    return f'{column.joint}.{column.signal}' if column.joint else column.signal


def _is_duplicate(column: Column, used: Iterable[Column]) -> bool:
    """Return whether a joint's signal is used already; effort and current count as the same."""
    same = ('effort', 'current') if column.signal in ('effort', 'current') else (column.signal,)
    return any(other.signal in same and other.joint == column.joint for other in used)


def _column(name: str, signal: str, joint: str, layout: Layout) -> Column:
    unit = layout.units.get(signal) or _unit_in_name(name, signal)
    if unit or signal == 'effort':
        return Column(name, signal, joint, unit, unit_factor(signal, unit) if unit else 1.0)
    # The first unit of each signal is that of SI.
    return Column(name, signal, joint, next(iter(_UNITS[signal]), ''), 1.0)


def _unit_in_name(name: str, signal: str) -> str:
    """Return the unit in a column's name, '' if there is none that the signal can have."""
    match = _BRACKET.search(name) or _LAST.search(name)
    unit = match[1].strip() if match else ''
    if unit and signal in ('velocity', 'reference_velocity') and f'{unit}/s' in _SPEEDS:
        unit = f'{unit}/s'
    return unit if unit in _UNITS[signal] else ''


def _guesses(names: Sequence[str], layout: Layout) -> list[Column]:
    """Return the columns with common names, in the order of `SIGNALS`."""
    columns = [_column(name, signal, joint, layout) for name in names
               for signal, joint in [_signal_and_joint(name)] if signal]
    # If a table has both `effort` and `current`, the former comes first and is used.
    columns.sort(key=lambda column: SIGNALS.index(column.signal))
    joints = {column.joint for column in columns if column.signal == 'position'}
    return [column for column in columns if column.joint in (*joints, '')]


def _signal_and_joint(name: str) -> tuple[str, str]:
    """Return signal and joint according to a column's name, each '' if there is none."""
    bare = _BRACKET.sub('', name.strip())
    for text in (bare, _LAST.sub('', bare)):
        whole = text.lower().strip().replace(' ', '_').replace('-', '_')
        if whole in _SIGNAL_OF:
            return _SIGNAL_OF[whole], ''
        # elbow.position, elbow/position
        for mark in './':
            joint, split, signal = text.rpartition(mark)
            if split and signal.lower() in _SIGNAL_OF:
                return _SIGNAL_OF[signal.lower()], joint
        # q_2, q2
        numbered = re.fullmatch(r'(.*?)_?(\d+)', whole)
        if numbered and numbered[1] in _SIGNAL_OF and _SIGNAL_OF[numbered[1]] != 'time':
            return _SIGNAL_OF[numbered[1]], numbered[2]
    return '', ''
