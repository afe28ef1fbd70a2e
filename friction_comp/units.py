# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Units as people write them: a factor, products and one quotient of symbols with prefixes.

One grammar reads ``2.69mA``, ``0.229rpm``, ``kN·m``, ``inch/min`` and ``counts/4096/s``. The result
is the factor to SI units and the dimension, which tells whether a signal can have the unit.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple, TypeVar

from friction_comp.errors import InputError

T = TypeVar('T')
_TURN = 2.0 * math.pi
_STANDARD = 9.80665                 # N of a kg
_POUND = 0.45359237 * _STANDARD     # N
_INCH = 0.0254
# Symbol to factor and dimension; those of the second table take prefixes.
_WORDS = {word: (factor, dimension) for dimension, factor, words in (
    ('angle', _TURN / 360.0, 'deg degree degrees Grad °'), ('angle', 1.0, 'radian radians'),
    ('angle', _TURN, 'turn turns rev revs revolution revolutions rotation rotations rot'),
    ('angle/time', _TURN / 60.0, 'rpm RPM'), ('angle/time', _TURN / 360.0, 'dps'),
    ('angle/time', _TURN, 'rps'), ('angle/time', 1.0, 'radps rads'),
    ('length', _INCH, 'inch in'), ('length', 12.0 * _INCH, 'ft'), ('length', 1.0, 'meter metre'),
    ('length/time', 1.0, 'mps'),
    ('time', 1.0, 'sec seconds'), ('time', 60.0, 'min'), ('time', 3600.0, 'h'),
    ('time', 1e-3, 'millis milliseconds'), ('time', 1e-6, 'micros microseconds'),
    ('force', _STANDARD, 'kgf kg'), ('force', 1e-3 * _STANDARD, 'gf'), ('force', _POUND, 'lbf lb'),
    ('force', _POUND / 16.0, 'oz ozf'), ('force', 1e3 * _POUND, 'kip'),
    ('temperature', 1.0, 'C °C degC')) for word in words.split()}
_PER_MINUTE = {'1/min', 'r/min', 'U/min', 'min-1', 'min^-1', 'min⁻¹'}
_WITH_PREFIX = {'rad': 'angle', 'm': 'length', 's': 'time', 'N': 'force', 'Nm': 'torque',
                'A': 'current'}
_PREFIXES = {'': 1.0, 'k': 1e3, 'c': 1e-2, 'm': 1e-3, 'µ': 1e-6, 'u': 1e-6, 'n': 1e-9, 'M': 1e6}
_PRODUCTS = {('force', 'length'): 'torque', ('length', 'force'): 'torque'}
_ANGLE, _RATE = ('angle', 'length', 'counts'), ('angle/time', 'length/time', 'counts/time')
_TORQUE = ('torque', 'force')
# What each signal may measure; the first SI unit of each is its default. Of several columns for
# one thing, that of the signal that comes first is used.
DIMENSIONS = {
    'time': ('time', 'counts'), 'position': _ANGLE, 'velocity': _RATE,
    'effort': (*_TORQUE, 'current'), 'current': ('current',), 'command': ('current', *_TORQUE),
    'direction': (), 'load': _TORQUE, 'link_torque': _TORQUE, 'temperature': ('temperature',),
    'reference_position': _ANGLE, 'reference_velocity': _RATE}
_SI = {'time': 's', 'angle': 'rad', 'angle/time': 'rad/s', 'torque': 'N·m', 'current': 'A',
       'temperature': '°C'}
# Units to name where one is not known.
_EXAMPLES = {
    'time': 's, ms, µs, ns, min', 'angle': 'rad, mrad, deg, turn, counts/N (N per turn), m, mm, '
    'inch', 'angle/time': 'rad/s, deg/s, rpm, counts/N/s, m/s', 'torque': 'N·m, mN·m, N, kN, lbf',
    'current': 'A, mA', 'temperature': '°C'}
_COUNTS = r'counts?/(\d+(?:\.\d+)?)'
# As in rad·s⁻¹.
_PER_SECOND = re.compile(r'[·*. ]?s(\^?-1|⁻¹)$')
# Factor, what is above the quotient, and below.
_PARTS = re.compile(r'\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)?\s*\*?\s*'
                    rf'({_COUNTS}|[^/]*)(?:/(.*))?')


class Unit(NamedTuple):
    """A unit: the factor that converts a value to SI units, and what it measures."""

    factor: float
    dimension: str      # angle, length, time, force, torque, current or temperature, or a quotient


def parse_unit(text: str) -> Unit | None:
    """Return a unit from its text, None if it is not known.

    ``counts/4096`` is a 4096th of a turn; its dimension is ``counts``. A factor may precede any
    unit: ``2.69mA``.
    """
    if text.strip() in _PER_MINUTE:
        return Unit(*_WORDS['rpm'])
    match = _PARTS.fullmatch(_PER_SECOND.sub('/s', text.strip().replace('\u03bc', 'µ')))
    if match is None:
        return None
    number, above_text, _, below_text = match.groups()
    factor, above = float(number or 1.0), _product(above_text)
    if above is None or not math.isfinite(factor) or factor == 0.0:
        return None
    if not below_text:
        return Unit(factor * above.factor, above.dimension)
    divisor = _product(below_text)
    if divisor is None or divisor.dimension == 'counts' or any(
            '/' in part.dimension for part in (above, divisor)):
        return None
    return Unit(factor * above.factor / divisor.factor, f'{above.dimension}/{divisor.dimension}')


def unit_of(signal: str, text: str) -> Unit | None:
    """Return the unit of a signal from its text, None if the signal cannot have it.

    An angle as the unit of a velocity means angle per second.
    """
    unit = parse_unit(text)
    possible = DIMENSIONS[signal]
    if unit is not None and unit.dimension not in possible:
        unit = Unit(unit.factor, f'{unit.dimension}/time')
    if unit is None or unit.dimension not in possible:
        return None
    if unit.dimension.startswith('counts') and signal != 'time':
        # Counts of a turn; those of a linear scale are given by their length, as 0.01mm.
        return Unit(_TURN * unit.factor, unit.dimension.replace('counts', 'angle'))
    return unit


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


def default_unit(signal: str) -> str:
    """Return the SI unit of a signal, '' if it has none."""
    return _SI.get(next(iter(DIMENSIONS[signal]), ''), '')


def in_own_units(content: T, linear: bool) -> T:
    """Return text, or the texts of a report, with m and N instead of rad and N·m if `linear`."""
    if not linear:
        return content
    if isinstance(content, str):
        # Waves over a length are per metre, not per turn of 2π.
        text = re.sub(r'([\d.]+) times a turn', lambda match: (
            f'{float(match[1]) / (_TURN):.4g} times a metre'), content)
        text = text.replace('kg·m²', 'kg').replace('N·m', 'N')
        return re.sub(r'\brad\b', 'm', text)  # type: ignore[return-value]
    if isinstance(content, dict):
        return {key: in_own_units(value, True)      # type: ignore[return-value]
                for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [in_own_units(value, True) for value in content]     # type: ignore[return-value]
    return content


def _product(text: str) -> Unit | None:
    """Return one symbol, or the product of two, such as N·m, N m or Ncm."""
    whole = _symbol(text)
    if whole is not None:
        return whole
    apart = [part for part in re.split(r'[·*.\- ]', text) if part]
    together = [[text[:k], text[k:]] for k in range(1, len(text))]
    for pair in [apart] if len(apart) > 1 else together:
        first, second = map(_symbol, pair) if len(pair) == 2 else (None, None)
        if first and second and (first.dimension, second.dimension) in _PRODUCTS:
            return Unit(first.factor * second.factor,
                        _PRODUCTS[first.dimension, second.dimension])
    return None


def _symbol(text: str) -> Unit | None:
    if text in _WORDS:
        return Unit(*_WORDS[text])
    counts = re.fullmatch(_COUNTS, text)
    if counts:
        return Unit(1.0 / float(counts[1]), 'counts') if float(counts[1]) > 0.0 else None
    for symbol, dimension in _WITH_PREFIX.items():
        prefix = text[:len(text) - len(symbol)]
        if text.endswith(symbol) and prefix in _PREFIXES:
            return Unit(_PREFIXES[prefix], dimension)
    return None
