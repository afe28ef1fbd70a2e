# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Coulomb and viscous friction, breakaway, inertia and the like as text: one line for each."""

from __future__ import annotations

import math
from typing import NamedTuple

from friction_comp.model.friction_numbers import FrictionNumbers
from friction_comp.number_text import number

# Name and unit of each number, A standing for the unit of current.
NAMES = {'coulomb': ('Coulomb', 'A'), 'coulomb_with_load': ('… with load', 'A'),
         'viscous': ('viscous', 'A·s/rad'), 'offset': ('offset', 'A'),
         'viscous_asymmetry': ('viscous, half of + minus −', 'A·s/rad'),
         'stribeck': ('Stribeck, at standstill', 'A'),
         'stribeck_speed': ('Stribeck speed', 'rad/s'), 'inertia': ('inertia', 'A·s²/rad')}
_UNKNOWN = 'not known: slow reversals show it, and identification measures it'


class NumberRow(NamedTuple):
    """A number of the model as text, in its own unit and in N·m ('' where that is the same)."""

    name: str
    value: str      # with unit
    interval: str   # 95 %, or why there is none
    torque: str
    remark: str


def number_rows(friction: FrictionNumbers) -> list[NumberRow]:
    """Return a row for each number."""
    remarks = {} if friction.offset is not None else {
        'coulomb': 'with the offset: the motion was in one direction',
        'offset': 'not known: the motion was in one direction'}
    keys = ['coulomb', 'viscous', 'offset']
    if friction.coulomb_with_load is not None:
        keys.insert(1, 'coulomb_with_load')
        remarks |= {'coulomb': ', '.join(filter(None, ('without load', remarks.get('coulomb')))),
                    'coulomb_with_load': 'mean in the recorded motion'}
    rows = [_row(friction, key, remarks.get(key, '')) for key in keys]
    rows.append(_breakaway_row(friction))
    rows.append(_presliding_row(friction.presliding))
    value, ends = friction.transition, friction.intervals.get('transition')
    rows.append(NumberRow('transition', *_texts(value, ends, 'rad/s'), '',
                          'speed over which friction changes sign'))
    rows.append(_row(friction, 'inertia', 'not found in the recordings' if friction.inertia is None
                     else f'of {friction.inertia_holds}'))
    return rows


def _row(friction: FrictionNumbers, key: str, remark: str) -> NumberRow:
    """Return the row of a number; its unit is that of `NAMES`, with `friction.unit` for A."""
    unit, gain = friction.unit, friction.torque_per_current
    (name, current_unit), value = NAMES[key], getattr(friction, key)
    if value is None:
        return NumberRow(name, '–', '', '', remark)
    ends = friction.intervals.get(key)
    torque_unit = 'kg·m²' if key == 'inertia' else current_unit.replace('A', 'N·m', 1)
    own_unit = torque_unit if unit in ('N·m', 'N') else current_unit.replace('A', unit, 1)
    torque = ''
    # A force in N is that of a linear axis, whose N·m are N.
    if gain and unit not in ('N·m', 'N'):
        scaled = None if ends is None else [gain * end for end in ends]
        text, interval = _texts(gain * value, scaled, torque_unit)
        torque = f'{text} ({interval})' if scaled else text
    return NumberRow(name, *_texts(value, ends, own_unit), torque, remark)


def _breakaway_row(friction: FrictionNumbers) -> NumberRow:
    """Return the row of breakaway, without what is held by a weight or an offset."""
    known, unit, gain = friction.breakaway, friction.unit, friction.torque_per_current
    if known is None:
        return NumberRow('breakaway', '–', '', '', _UNKNOWN)
    value, sides = known['friction'], (known['positive'], known['negative'])
    spread = math.hypot(*(side['std'] for side in sides))
    ends = [value - spread, value + spread] if spread else None
    return NumberRow(
        'breakaway', *_texts(value, ends, unit),
        f'{number(gain * value)} N·m' if gain and unit not in ('N·m', 'N') else '',
        f'half of what lies between {number(sides[0]["mean"])} and {number(sides[1]["mean"])}')


def _presliding_row(known: dict[str, float] | None) -> NumberRow:
    if known is None:
        return NumberRow('presliding', '–', '', '', _UNKNOWN)
    middle, spread = 1e3 * known['distance'], 2e3 * known.get('std', 0.0)
    ends = [max(middle - spread, 0.0), middle + spread] if spread else None
    return NumberRow('presliding', *_texts(middle, ends, 'mrad'), '',
                     'from rest until the gear slides'
                     + ('; interval of single rests' if ends else ''))


def _texts(value: float, ends: list[float] | None, unit: str) -> tuple[str, str]:
    """Return a value with its unit, and its interval, with as many digits as that justifies."""
    if ends is None:
        return f'{number(value)} {unit}', 'no interval'
    half = 0.5 * (ends[1] - ends[0])
    # A second digit of the interval's half only where the first is small.
    size = math.floor(math.log10(half / 3.0)) if half > 0.0 else -3
    places = int(min(max(-size, 0), 9))
    low, middle, high = (f'{one:.{places}f}'.replace('-', '\u2212')
                         for one in (ends[0], value, ends[1]))
    return f'{middle} {unit}', f'{low} to {high}'


def number_lines(friction: FrictionNumbers) -> list[str]:
    """Return the rows as aligned lines for a terminal."""
    rows = number_rows(friction)
    width = max(len(row.value) for row in rows)
    return ['  '.join(filter(None, (
        f'{row.name:<12}{row.value:<{width}}', row.interval and f'({row.interval})',
        row.torque and f'= {row.torque}', row.remark))).rstrip() for row in rows]
