# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Units as people write them: a factor, a symbol or the product of two, and perhaps ``/s``.

One grammar reads ``2.69mA``, ``0.229rpm``, ``kN·m``, ``inch/min`` and ``counts/4096/s``, without
regard to capitals. The result is the factor to SI units and the dimension, which tells whether a
signal can have the unit.
"""

from __future__ import annotations

from functools import lru_cache
import math
import re
from typing import NamedTuple

from friction_comp.errors import InputError

_TURN, _STANDARD, _POUND, _INCH = 2.0 * math.pi, 9.80665, 4.4482216152605, 0.0254
# Dimension to symbols and their factors.
_SYMBOLS = {symbol: (factor, dimension) for dimension, table in {
    'angle': {'radian radians': 1.0, 'deg degree degrees °': _TURN / 360.0,
              'turn turns rev revs revolution revolutions rot': _TURN},
    'angle/time': {'rpm': _TURN / 60.0, 'dps': _TURN / 360.0, 'rps': _TURN, 'radps': 1.0},
    'length': {'inch in': _INCH, 'ft': 12.0 * _INCH}, 'length/time': {'mps': 1.0},
    'time': {'sec secs second seconds': 1.0, 'msec millis': 1e-3, 'usec micros': 1e-6,
             'nsec nanos': 1e-9, 'min': 60.0, 'h': 3600.0},
    'force': {'kgf kg': _STANDARD, 'gf': 1e-3 * _STANDARD, 'lbf lb': _POUND},
    'temperature': {'c °c degc celsius': 1.0}}.items()
    for symbols, factor in table.items() for symbol in symbols.split()}
_WITH_PREFIX = {'rad': 'angle', 'nm': 'torque', 'm': 'length', 's': 'time', 'n': 'force',
                'a': 'current'}
_PREFIXES = {'': 1.0, 'k': 1e3, 'c': 1e-2, 'm': 1e-3, 'µ': 1e-6, 'u': 1e-6, 'n': 1e-9}
_PER_MINUTE = {'1/min', 'r/min', 'min-1', 'min^-1', 'min⁻¹'}
# As in rad·s⁻¹; and the factor before a unit.
_PER_SECOND = re.compile(r'[·*. ]?s(\^?-1|⁻¹)$')
_FACTOR = re.compile(r'([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)?\s*\*?\s*(.*)')
_COUNTS = re.compile(r'counts?/(\d+(?:\.\d+)?)(/s)?')
_ANGLE, _RATE = ('angle', 'length', 'counts'), ('angle/time', 'length/time', 'counts/time')
_TORQUE = ('torque', 'force')
DIMENSIONS = {
    'time': ('time', 'counts'), 'position': _ANGLE, 'velocity': _RATE,
    'effort': (*_TORQUE, 'current'), 'current': ('current',), 'command': ('current', *_TORQUE),
    'direction': (), 'load': _TORQUE, 'link_torque': _TORQUE, 'temperature': ('temperature',),
    'reference_position': _ANGLE, 'reference_velocity': _RATE}
"""What each signal may measure; the first SI unit is its default. The order is that in which
columns are listed, and of several columns for one thing that of the earlier signal is used."""
_SI = {'time': 's', 'angle': 'rad', 'angle/time': 'rad/s', 'torque': 'N·m', 'force': 'N',
       'current': 'A', 'temperature': '°C'}
# Units to name where one is not known.
_EXAMPLES = {
    'time': 's, ms, µs, ns, min', 'angle': 'rad, mrad, deg, turn, counts/N (N per turn), m, mm, '
    'inch', 'angle/time': 'rad/s, deg/s, rpm, counts/N/s, m/s', 'torque': 'N·m, mN·m, N, kN, lbf',
    'current': 'A, mA', 'temperature': '°C'}
OTHER_UNITS = {word: unit for unit, words in {
    'V': 'v volt volts voltage', 'mV': 'mv', 'W': 'w watts', '%': '% percent pct',
    '‰': '‰ permille', 'PWM': 'pwm', 'duty': 'duty', 'LSB': 'lsb', 'counts': 'count counts',
    'ticks': 'tick ticks', 'pulses': 'pulse pulses', 'raw': 'raw', 'digits': 'digit digits',
    'steps': 'step steps', 'p.u.': 'p.u. pu', 'a.u.': 'a.u. au', 'increments': 'inc increments'
    }.items()
    for word in words.split()}
"""Words for units of a drive that are none of the package's: such an effort stays as it is."""


class Unit(NamedTuple):
    """A unit: the factor that converts a value to SI units, and what it measures."""

    factor: float
    dimension: str      # angle, length, time, force, torque, current or temperature, or a rate


@lru_cache(maxsize=4096)
def parse_unit(text: str) -> Unit | None:
    """Return a unit from its text, None if it is not known.

    ``counts/4096`` is a 4096th of a turn; its dimension is ``counts``. A factor may precede any
    unit: ``2.69mA``.
    """
    text = _PER_SECOND.sub('/s', text.strip().lower().replace('\u03bc', 'µ'))
    match = _FACTOR.fullmatch('rpm' if text in _PER_MINUTE else text)
    if match is None:
        return None
    factor, (above, mark, below) = float(match[1] or 1.0), match[2].partition('/')
    counts = _COUNTS.fullmatch(match[2])
    if counts:
        size = float(counts[1])
        known = Unit(1.0 / size, 'counts' + '/time' * bool(counts[2])) if size else None
    else:
        known = _product(above)
        divisor = _product(below) if mark else None
        if mark:
            known = Unit(known.factor / divisor.factor, f'{known.dimension}/time') if (
                known and divisor and divisor.dimension == 'time'
                and '/' not in known.dimension) else None
    if known is None or not factor or not math.isfinite(factor):
        return None
    return Unit(factor * known.factor, known.dimension)


def _product(text: str) -> Unit | None:
    """Return one symbol, or the product of a force and a length, such as N·m, N cm or lbft."""
    plain = re.sub(r'[·*.\- ]', '', text)
    if whole := _symbol(plain):
        return whole
    for k in range(1, len(plain)):
        one, other = _symbol(plain[:k]), _symbol(plain[k:])
        if one and other and {one.dimension, other.dimension} == {'force', 'length'}:
            return Unit(one.factor * other.factor, 'torque')
    return None


def _symbol(text: str) -> Unit | None:
    if text in _SYMBOLS:
        return Unit(*_SYMBOLS[text])
    return next((Unit(_PREFIXES[prefix], dimension) for symbol, dimension in _WITH_PREFIX.items()
                 if text.endswith(symbol) and (prefix := text.removesuffix(symbol)) in _PREFIXES),
                None)


def is_other_unit(text: str) -> bool:
    """Return whether a text is a unit in which an effort stays as it is, such as V or 0.1 %."""
    return text.strip().lstrip('+-.0123456789').strip(' *').lower() in OTHER_UNITS


def unit_of(signal: str, text: str) -> Unit | None:
    """Return the unit of a signal from its text, None if the signal cannot have it.

    An angle as the unit of a velocity means angle per second.
    """
    unit = parse_unit(text)
    for dimension in (unit.dimension, f'{unit.dimension}/time') if unit else ():
        if unit and dimension in DIMENSIONS[signal]:
            # Counts of a turn; those of a timer are parts of a second.
            turned = dimension.startswith('counts') and signal != 'time'
            return Unit(_TURN * unit.factor, dimension.replace('counts', 'angle')) if turned \
                else Unit(unit.factor, dimension)
    return None


def unit_factor(signal: str, unit: str) -> float:
    """Return the factor that converts a column's numbers to SI units.

    Raises InputError if the unit is not known for this signal.
    """
    known = unit_of(signal, unit)
    if known is not None:
        return known.factor
    possible = ', '.join(_EXAMPLES[one] for one in DIMENSIONS[signal] if one in _EXAMPLES)
    others = '; values in V, %, counts, PWM or another of a drive stay as they are'
    raise InputError(f'{signal} cannot be in {unit!r}; its units are {possible or "none"}, '
                     'with a factor before them if needed, as in 2.69mA'
                     + others * (signal == 'effort'))


def signal_with_unit(unit: str) -> str | None:
    """Return a signal that has a known unit which effort cannot have, else None."""
    signals = [signal for signal in DIMENSIONS if unit_of(signal, unit) is not None]
    if not signals or 'effort' in signals:
        return None
    # Counts may be those of a timer, but are seldom.
    return 'position' if 'position' in signals else signals[0]


def si_unit(signal: str, dimension: str = '') -> str:
    """Return the SI unit of a signal, or of a dimension that it has; '' if there is none."""
    return _SI.get(dimension or next(iter(DIMENSIONS[signal]), ''), '')
