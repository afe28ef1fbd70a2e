# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the user tells of a recording: columns and rate of a table, and units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from friction_comp.column_names import is_other_unit, plain_name
from friction_comp.errors import InputError
from friction_comp.units import DIMENSIONS, Unit, unit_factor, unit_of

# Suffixes of table files.
TABLES = ('.csv', '.csv.gz', '.tsv', '.txt', '.dat', '.parquet', '.npz', '.npy', '.mat', '.h5',
          '.hdf5', '.json', '.jsonl')
SIGNALS = tuple(DIMENSIONS)
STATES = ('position', 'velocity', 'effort')
"""Signals of joint states."""


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
        Those of position, velocity and effort count for joint states in messages, too.
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
            if signal != 'effort' or not is_other_unit(unit):
                unit_factor(signal, unit)

    @property
    def of_states(self) -> dict[str, Unit]:
        """Units of what joint states hold, if nothing else is given; else empty."""
        units = {signal: unit for signal, text in self.units.items() if signal in STATES
                 and (unit := unit_of(signal, text)) is not None}
        only = len(units) == len(self.units) and not (self.columns or self.rate or self.stiffness)
        return units if only else {}

    def naming(self, names: Sequence[str], where: str) -> Layout:
        """Return the layout with a table's own names; raises InputError if one is missing."""
        return replace(self, columns={signal: column_called(name, names, where)
                                      for signal, name in self.columns.items()})

    def gains(self, names: Sequence[str], where: str) -> tuple[float | str, ...]:
        """Return stiffness and damping of one table, numbers or columns; empty without any."""
        if not self.stiffness:
            return ()
        if max(len(self.stiffness), len(self.damping)) > 1:
            raise InputError(f'{where}: several gains are given for one recording')
        gains = self.stiffness[0], self.damping[0] if self.damping else 0.0
        return tuple(column_called(gain, names, where) if isinstance(gain, str) else gain
                     for gain in gains)

    def of_recording(self, index: int, count: int) -> Layout:
        """Return the layout of one of several recordings, with its own gains."""
        def own(values: Sequence[float | str], name: str) -> Sequence[float | str]:
            if len(values) not in (0, 1, count):
                raise InputError(f'{name}: {len(values)} values for {count} recordings; give one, '
                                 'or one for each')
            return values[index:index + 1] if len(values) == count else values
        return replace(self, stiffness=own(self.stiffness, 'stiffness'),
                       damping=own(self.damping, 'damping'))


def column_called(name: str, names: Sequence[str], where: str) -> str:
    """Return the column of that name, or the only one that is it with a unit; else InputError."""
    if name in names:
        return name
    alike = [one for one in names if plain_name(one) == name.strip().casefold()]
    if len(alike) == 1:
        return alike[0]
    raise InputError(f'{where}: has no column {name!r}, but {", ".join(map(repr, names))}')
