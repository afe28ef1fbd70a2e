# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The columns of a table that are used, and notes: what was guessed, and which are not used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import re

from friction_comp.column_names import is_target, read_name, skeleton
from friction_comp.layout import Layout

_TORQUES = ('effort', 'load', 'link_torque')


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
    integrated: bool = False    # whether values of velocity are to be integrated to positions


def notes_on(used: Sequence[Column], named: Sequence[Column], found: Sequence[Column],
             names: Sequence[str], layout: Layout) -> list[str]:
    """Return notes on the columns that are `used`, of those `found`, and of all `names`.

    Those that the user `named` are no guess.
    """
    return [*_guesses(used, layout), *_asked_for(named), *_nameless(used, names),
            *_idle(used, found), *_other_currents(used, names)]


def idle_note(names: Sequence[str]) -> str:
    """Return the note on other joints, or their columns, that have a position, but no effort."""
    return f'the motion of {", ".join(names)} is left out: no effort belongs to it'


def _guesses(used: Sequence[Column], layout: Layout) -> list[str]:
    # A column named after its signal is not a guess.
    guessed = [column for column in used if column.name not in layout.columns.values()
               and not column.integrated
               and column.name.lower() != f'{column.joint}.{column.signal}'.strip('.').lower()
               and not (column.signal == 'effort' and column.name == 'current')]
    if not guessed:
        return []
    # Columns of other joints that are named alike but for a number need no line of their own.
    alike: dict[tuple[str, str, str], list[Column]] = {}
    for column in guessed:
        alike.setdefault((column.signal, column.unit, skeleton(column.name) or column.name),
                         []).append(column)
    return ['columns guessed from their names: ' + ', '.join(
        f'{first.joint}.{first.signal}'.lstrip('.') + f'={first.name}'
        + (f' in {first.unit}' if first.unit else '')
        + (f' and {len(others)} alike' if others else '')
        for first, *others in alike.values()) + ' (override with --columns and --unit)']


def _asked_for(named: Sequence[Column]) -> list[str]:
    return [f'{c.name}: by its name an effort that was asked for, not measured: friction is in it '
            'only if the drive gives just this' for c in named
            if c.signal in ('effort', 'current') and is_target(c.name)]


def _nameless(used: Sequence[Column], names: Sequence[str]) -> list[str]:
    """Return a note if others, enough for another joint, differ from the used ones by a number.

    Different signals are then columns of one array, or have numbers instead of names.
    """
    own = {re.sub(r'\d+', '#', column.name) for column in used if column.signal != 'time'}
    left = {name for name in names if re.sub(r'\d+', '#', name) in own} - {c.name for c in used}
    if len(own) != 1 or '#' not in min(own) or len(left) < 2:
        return []
    return [f'{len(left)} other columns have no names: if other joints moved, their motion is not '
            'taken into account; a first line of names, such as q_1,q_2,tau_1,tau_2, tells it']


def _idle(used: Sequence[Column], found: Sequence[Column]) -> list[str]:
    """Return notes on columns of joints with a position or an effort alone, beside those used."""
    keys, names = {c.key for c in used if c.signal == 'position'}, {c.name for c in used}
    left = [c for c in found if c.key not in keys and c.name not in names]
    idle = [c.name for c in left if c.signal == 'position']
    # Neither siblings of named columns nor the only effort are called so.
    loose = [c.name for c in left if c.signal in _TORQUES and read_name(c.name).signal in _TORQUES]
    return ([idle_note(idle)] if idle else []) + ([
        f'{", ".join(loose)}: not used, since no position belongs to it; a torque from outside is '
        'named with --columns load=NAME, one behind the gear with link_torque=NAME']
        if loose else [])


def _other_currents(used: Sequence[Column], names: Sequence[str]) -> list[str]:
    """Return a note on currents that are measured beside the torques that are used."""
    keys = {c.key for c in used if c.signal == 'effort' and c.dimension not in ('current', '')}
    taken = {c.name for c in used}
    left = [name for name in names if name not in taken and not is_target(name)
            and (reading := read_name(name)).signal == 'current' and reading.key in keys]
    return [f'{left[0]}{f" and {len(left) - 1} alike" * (len(left) > 1)}: not used beside a '
            'torque; if that is measured behind the gear, name both, --columns '
            f'current={left[0]},link_torque=NAME'] if left else []
