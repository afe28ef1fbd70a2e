# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The short table of units: symbols, perhaps with a factor before them and ``/s`` behind.

``2.69mA``, ``0.229rpm``, ``N cm``, ``inch/min`` and ``counts/4096/s`` are units, without regard to
capitals. Each has a factor to SI units and a dimension, which tells whether a signal can have it.
"""

from __future__ import annotations

from functools import lru_cache
import math
import re
from typing import NamedTuple

from friction_comp.errors import InputError

_TURN, _KGF, _LBF, _INCH = 2.0 * math.pi, 9.80665, 4.4482216152605, 0.0254
# Dimension to symbols and their factors; those of products are written without a sign between.
_TABLE: dict[str, dict[str, float]] = {
    'angle': {'rad radian radians': 1.0, 'mrad': 1e-3, 'deg degree degrees °': _TURN / 360.0,
              'turn turns rev revs revolution revolutions rot': _TURN},
    'angle/time': {'radps': 1.0, 'rpm r/min 1/min min-1 min^-1 min⁻¹': _TURN / 60.0,
                   'dps': _TURN / 360.0, 'rps': _TURN},
    'length': {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3, 'µm um': 1e-6, 'inch in': _INCH,
               'ft': 12.0 * _INCH},
    'length/time': {'mps': 1.0},
    'time': {'s sec secs second seconds': 1.0, 'ms msec millis': 1e-3, 'µs us usec micros': 1e-6,
             'ns nsec nanos': 1e-9, 'min': 60.0, 'h': 3600.0},
    'force': {'n': 1.0, 'kn': 1e3, 'mn': 1e-3, 'kgf kg': _KGF, 'gf': 1e-3 * _KGF, 'lbf lb': _LBF},
    'torque': {'nm': 1.0, 'knm': 1e3, 'mnm nmm': 1e-3, 'ncm': 1e-2, 'kgfm kgm': _KGF,
               'kgfcm kgcm': 1e-2 * _KGF, 'lbft lbfft ftlb': 12.0 * _LBF * _INCH,
               'lbin lbfin inlb': _LBF * _INCH},
    'current': {'a': 1.0, 'ka': 1e3, 'ma': 1e-3, 'µa ua': 1e-6},
    'temperature': {'c °c degc celsius': 1.0}}
_SYMBOLS = {symbol: (factor, dimension) for dimension, table in _TABLE.items()
            for symbols, factor in table.items() for symbol in symbols.split()}
# As in rad·s⁻¹; and the factor before a unit.
_PER_SECOND = re.compile(r'[·⋅*. ]?s(\^?-1|⁻¹)$')
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
    if text in _SYMBOLS:
        return Unit(*_SYMBOLS[text])
    match = _FACTOR.fullmatch(text)
    if match is None:
        return None
    factor, symbol = float(match[1] or 1.0), re.sub(r'[·⋅*.\- ]', '', match[2])
    known, (above, _, below) = _SYMBOLS.get(symbol), symbol.partition('/')
    one, other = _SYMBOLS.get(above), _SYMBOLS.get(below)
    if (counts := _COUNTS.fullmatch(symbol)) and float(counts[1]):
        known = 1.0 / float(counts[1]), 'counts' + '/time' * bool(counts[2])
    elif one and other and other[1] == 'time' and '/' not in one[1]:
        known = one[0] / other[0], f'{one[1]}/time'
    if known is None or not factor or not math.isfinite(factor):
        return None
    return Unit(factor * known[0], known[1])


def other_unit(text: str) -> tuple[float, str] | None:
    """Return factor and name of a unit in which an effort stays as it is, such as V or 0.1 %."""
    match = _FACTOR.fullmatch(text.strip().lower())
    name = OTHER_UNITS.get(match[2]) if match else None
    return (float(match[1] or 1.0), name) if match and name else None


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


def check_unit(signal: str, unit: str) -> None:
    """Raise InputError if a signal cannot have a unit."""
    if unit_of(signal, unit) or (signal == 'effort' and other_unit(unit)):
        return
    possible = ', '.join(_EXAMPLES[one] for one in DIMENSIONS[signal] if one in _EXAMPLES)
    others = '; values in V, %, counts, PWM or another of a drive stay as they are'
    raise InputError(f'{signal} cannot be in {unit!r}; its units are {possible or "none"}, '
                     'with a factor before them if needed, as in 2.69mA'
                     + others * (signal == 'effort'))


def si_unit(signal: str) -> str:
    """Return the SI unit of a signal; '' if there is none."""
    return _SI.get(next(iter(DIMENSIONS[signal]), ''), '')
