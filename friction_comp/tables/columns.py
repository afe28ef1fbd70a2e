# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Assigns signals and units to the columns of a table.

What the user tells, the `Layout`, comes first, then the names. A name is a row of words. Each is a
quantity, a source, a unit, or says nothing; what remains names the joint. Where no word is a
quantity, the unit tells it, as in ``encoder_rad``. There is no other rule: values are not looked
at, no robot is listed, and what is not understood is declared.

A column is chosen by its name and then has a unit, the user's, its name's or the SI unit: no unit
changes the choice. Columns that are named like one of the user's, but for a number, are the same
signal of another joint.

Units are symbols, perhaps with a factor before them and ``/s`` behind: ``2.69mA``, ``0.229rpm``,
``N cm``, ``inch/min`` and ``counts/4096/s``, without regard to capitals. Each has a factor to SI
units and a dimension, which tells whether a signal can have it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
import math
import re
from typing import NamedTuple

import numpy as np

from friction_comp.errors import InputError

# Units.

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
_FACTOR = re.compile(r'([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)?\s*\*?\s*(.*)')
_COUNTS = re.compile(r'counts?/(\d+(?:\.\d+)?)(/s)?')
# Efforts and positions whose product is no work, and the remedy.
_APART = (
    ('force', 'angle', 'give a torque, with a lever of 0.1 m --unit effort=0.1Nm, or '
     '--unit position=m'),
    ('torque', 'length', 'give a force, with a screw of 10 mm a turn --unit effort=628N, or '
     '--unit position=rad'))
_ANGLE, _RATE, _TORQUE = ('angle', 'length'), ('angle/time', 'length/time'), ('torque', 'force')
DIMENSIONS = {
    'time': ('time',), 'position': _ANGLE, 'velocity': _RATE,
    'effort': (*_TORQUE, 'current'), 'current': ('current',), 'command': ('current', *_TORQUE),
    'direction': (), 'load': _TORQUE, 'link_torque': _TORQUE, 'temperature': ('temperature',),
    'reference_position': _ANGLE, 'reference_velocity': _RATE}
"""What each signal may measure; the first SI unit is its default. The order is that in which
columns are listed, and of several columns for one thing that of the earlier signal is used."""
# Units of each dimension to name where one is not known, the SI unit first.
_EXAMPLES = {
    'time': 's, ms, µs, ns, min', 'angle': 'rad, mrad, deg, turn, counts/N (N per turn), m, mm, '
    'inch', 'angle/time': 'rad/s, deg/s, rpm, counts/N/s, m/s', 'torque': 'N·m, mN·m, N, kN, lbf',
    'current': 'A, mA', 'temperature': '°C'}
_SI = {signal: _EXAMPLES[dimensions[0]].split(',')[0] if dimensions else ''
       for signal, dimensions in DIMENSIONS.items()}
OTHER_UNITS = {word: words.split()[0] for words in (
    'V volt volts voltage', 'mV', 'W watts', '% percent pct', '‰ permille', 'PWM', 'duty', 'LSB',
    'counts count', 'ticks tick', 'pulses pulse', 'raw', 'digits digit', 'steps step', 'p.u. pu',
    'a.u. au', 'increments inc') for word in words.lower().split()}
"""Words for units of a drive that are none of the package's: such an effort stays as it is."""


class Unit(NamedTuple):
    """A unit: the factor that converts a value to SI units, and what it measures."""

    factor: float
    dimension: str      # angle, length, time, force, torque, current or temperature, or a rate


@lru_cache(maxsize=4096)
def parse_unit(text: str) -> Unit | None:
    """Return a unit from its text, None if it is not known.

    ``counts/4096`` is a 4096th of a turn. A factor may precede any unit: ``2.69mA``.
    """
    text = text.strip().lower().replace('\u03bc', 'µ')
    if text in _SYMBOLS:
        return Unit(*_SYMBOLS[text])
    match = _FACTOR.fullmatch(text)
    if match is None:
        return None
    factor, symbol = float(match[1] or 1.0), re.sub(r'[·⋅*.\- ]', '', match[2])
    known, (above, _, below) = _SYMBOLS.get(symbol), symbol.partition('/')
    one, other = _SYMBOLS.get(above), _SYMBOLS.get(below)
    if (counts := _COUNTS.fullmatch(symbol)) and float(counts[1]):
        known = _TURN / float(counts[1]), 'angle' + '/time' * bool(counts[2])
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
            return Unit(unit.factor, dimension)
    return None


# Names.

SIGNALS = tuple(DIMENSIONS)
STATES = ('position', 'velocity', 'effort')
"""Signals of joint states."""
# Signals whose unit a signal takes if none is given for it.
_SAME_UNIT = {'current': ('effort',), 'command': ('current', 'effort'),
              'reference_position': ('position',), 'reference_velocity': ('velocity',)}
# What a word of a name says: a quantity; 'none' of the signals, though another word may be that of
# one; where it is from; or nothing, except next to a number, as in joint_1. A torque from 'outside'
# is applied, one 'behind' is measured behind the gear.
_ROLES = {word: role for role, words in {
    'time': 'time times t timestamp timestamps stamp sec secs second seconds elapsed date datetime',
    'position': 'position positions pos q qpos angle angles ang theta phi displacement',
    'velocity': 'velocity velocities vel dq qd qdot qvel omega speed speeds dtheta',
    'effort': 'effort efforts eff torque torques tau taus trq moment force forces qfrc',
    'current': 'current currents curr cur i iq amp amps',
    'direction': 'direction dir', 'load': 'load wrench',
    'temperature': 'temperature temperatures temp temps',
    'none': 'ddq qdd acc acceleration accelerations accel error errors err limit limits max min '
            'peak std variance gain constant kp ki kd kt power energy status mode bits duration '
            'dur bus supply battery batt electrical elec',
    'surely measured': 'actual act measured meas present feedback fb sensed',
    'measured': 'observed observation observations obs mean avg average read real applied '
                'estimated est estimate',
    'target': 'target reference ref desired des demand goal setpoint set planned action',
    'command': 'command commanded cmd',
    'outside': 'external ext interaction sensor person human hand', 'behind': 'link output',
    'nothing': 'joint joints state states motor motors mot rotor robot arm actuator servo axis '
               'drive data value values msg filtered filt angular shaft encoder field header id in '
               'log unix utc ros since start system host epoch'}.items() for word in words.split()}
_QUANTITIES = {'time', 'position', 'velocity', 'effort', 'current', 'direction', 'load',
               'temperature'}
_TARGETS = {'position': 'reference_position', 'velocity': 'reference_velocity',
            'effort': 'command', 'current': 'command'}
_OF_UNIT = {'time': 'time', 'angle': 'position', 'angle/time': 'velocity', 'torque': 'effort',
            'current': 'current', 'temperature': 'temperature'}
# Units that are more often something else, unless they are the last word; and after these words,
# which are of a linear axis as much as of another, a last m or N is one.
_LAST_ONLY = {'s', 'A', 'C', 'V', 'W', 'sec', 'secs', 'second', 'seconds', 'min', 'in', 'rot'}
_LENGTHS = {'position', 'displacement', 'velocity', 'speed', 'force'}
_BRACKET = re.compile(r'\s*[\[(]([^\])]*)[\])]\s*$')
_WORD, _CAMEL = re.compile(r'[^\W\d_]+|\d+'), re.compile(r'(?<=[a-z])(?=[A-Z])')
# The name of a topic, before a joint.
_TOPIC = re.compile(r'^/?(.*/)?joint_states/')


class Reading(NamedTuple):
    """What the name of a column says."""

    signal: str = ''        # one of `DIMENSIONS`, or '' if the name tells none
    key: tuple[str, ...] = ()   # identifies the joint among all spellings, () if there is none
    joint: str = ''         # as it is written
    unit: str = ''          # as written; '' if there is none
    torque: bool = False    # whether the quantity is a torque or force
    measured: bool = False  # whether it says that it is: of effort and current, this one is used
    aim: bool = False       # whether it says that it is a target or command


@lru_cache(maxsize=65536)
def read_name(name: str) -> Reading:
    """Return what a column's name says."""
    bare, unit = _TOPIC.sub('', name.strip()), ''
    if match := _BRACKET.search(bare):
        text = re.sub(r'^in\s+', '', match[1].strip())
        if parse_unit(text) or text.lower() in OTHER_UNITS or re.search(r'[^\w\s.,:_-]', text):
            bare, unit = bare[:match.start()], text
    words = _parts(bare)
    lower = [word.lower() for _, word in words]
    roles = [_ROLES.get(word, '') for word in lower]
    if lower == ['d']:
        return Reading('direction')
    if 'none' in roles:
        return Reading(unit=unit)
    found = [k for k, role in enumerate(roles) if role in _QUANTITIES]
    # In `i_q` the q is no position, in `RadPerSec` the second no time.
    telling = [k for k in found if not (lower[k] == 'q' and 'i' in lower)]
    telling = [k for k in telling if roles[k] != 'time'] or telling
    quantity, of_unit = roles[telling[-1]] if telling else '', set[int]()
    if not unit:
        unit, of_unit = _unit_in(words, set(telling), quantity and _signal(quantity, roles))
    if not quantity and (known := parse_unit(unit)):
        quantity = _OF_UNIT.get(known.dimension, '')
    # So servos call their own load, which is no torque.
    signal = _signal(quantity, roles) if (quantity, 'present' in lower) != ('load', True) else ''
    said = {'surely measured', 'measured', 'target', 'command', 'outside' if signal == 'load' else
            'behind' if signal in ('link_torque', 'position', 'velocity') else ''} - {''}
    rest = [k for k, role in enumerate(roles)
            if k not in found and k not in of_unit and role not in said]
    joint = [k for k in rest if roles[k] != 'nothing']
    if signal == 'time':
        # A group says whose clock it is.
        plain = not joint or words[joint[-1]][0] < max(map(bare.rfind, '.:/'))
        return Reading('time' if plain else '', unit=unit)
    return Reading(signal, tuple(lower[k] for k in joint), _label(bare, words, rest, joint), unit,
                   quantity in ('effort', 'load'), 'surely measured' in roles,
                   'target' in roles or 'command' in roles)


def _signal(quantity: str, roles: Sequence[str]) -> str:
    """Return the signal of a quantity, '' for none, with the roles of a name's words."""
    if 'target' in roles or 'command' in roles:
        # `reference` alone is the position, `command` alone the current.
        return _TARGETS.get(quantity or ('current' if 'command' in roles else 'position'), '')
    if quantity == 'effort':
        return 'link_torque' if 'behind' in roles else (
            'load' if 'outside' in roles or 'load' in roles else 'effort')
    return quantity


def _unit_in(words: list[tuple[int, str]], used: set[int], signal: str) -> tuple[str, set[int]]:
    """Return the unit among the words of a name that the signal can have, and its places.

    It is of one to three words: mA, rad s, N m, deg per s.
    """
    plain = [word for _, word in words]
    lengths = any(plain[k].lower() in _LENGTHS for k in used)
    for size in (3, 2, 1):
        for first in range(len(plain) - size, -1, -1):
            part, places = plain[first:first + size], {*range(first, first + size)}
            above, below = part[0], part[-1]
            short = len(above) == 1 or above.lower() in _LAST_ONLY
            if places & used or above.isdigit() or below.isdigit() or (
                    size == 3 and part[1].lower() not in ('per', 'p')) or (
                    size == 1 and short and not (first + 1 == len(plain) and (
                        above in _LAST_ONLY or (lengths and above in 'mN')))):
                continue
            text = above if size == 1 else (
                f'{above}·{below}' if size == 2 and below.lower() == 'm' else f'{above}/{below}')
            if unit_of(signal, text) if signal else len(text) > 1 and parse_unit(text):
                return text, places
    return next(((OTHER_UNITS[word.lower()], {k}) for k, word in enumerate(plain)
                 if word.lower() in OTHER_UNITS and (len(word) > 1 or word in _LAST_ONLY)),
                ('', set()))


def _label(name: str, words: list[tuple[int, str]], rest: list[int], joint: list[int]) -> str:
    """Return the joint's name as it is written: a group, or words with neutral ones beside them."""
    if not joint:
        return ''
    first, last, group = joint[0], joint[-1], max(map(name.rfind, '.:/'))
    if words[last][0] < group:
        return name[:group]
    while first - 1 in rest:
        first -= 1
    while last + 1 in rest:
        last += 1
    label = name[words[first][0]:words[last][0] + len(words[last][1])]
    if {*range(first, last + 1)} <= {*rest} and label.count('[') == label.count(']'):
        return label
    return '_'.join(words[k][1] for k in joint)


def _parts(name: str) -> list[tuple[int, str]]:
    """Return the words of a name, each with its place; mA and degC are one word."""
    found = []
    for match in _WORD.finditer(name):
        begin = match.start()
        for word in [match[0]] if match[0].isdigit() or parse_unit(match[0]) else _CAMEL.split(
                match[0]):
            found.append((begin, word))
            begin += len(word)
    return found


# What the user tells, and what is made of it.

@dataclass(frozen=True)
class Layout:
    """The user's description of a table's columns, and of what no column holds.

    Parameters
    ----------
    columns : dict of str to str
        Signal to column; signals are time, position, velocity, effort, current, command,
        direction, load, link_torque, temperature, reference_position and reference_velocity.
        Columns of other signals are found by their names; ``''`` is no column.
    units : dict of str to str
        Signal to unit, such as ``{'position': 'deg', 'time': 'ms'}``; ``counts/4096`` means encoder
        counts, 4096 per turn, and ``2.69mA`` that one count is 2.69 mA. The default is SI units.
        Those of position, velocity and effort count for joint states in messages, too.
    rate : float, optional
        Rows per second, Hz, of a table without times.
    stiffness, damping : float, optional
        k_p in N·m/rad and k_d in N·m·s/rad of a position controller. Effort is then
        k_p (target - position) - k_d velocity.
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
    stiffness: float | None = None
    damping: float | None = None
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
            if unit_of(signal, unit) or (signal == 'effort' and other_unit(unit)):
                continue
            possible = ', '.join(_EXAMPLES[one] for one in DIMENSIONS[signal] if one in _EXAMPLES)
            others = '; values in V, %, counts, PWM or another of a drive stay as they are'
            raise InputError(f'{signal} cannot be in {unit!r}; its units are {possible or "none"}, '
                             'with a factor before them if needed, as in 2.69mA'
                             + others * (signal == 'effort'))

    def unit(self, signal: str) -> str:
        """Return the unit that is given for a signal, or what it shares its unit with; or ''."""
        return next((self.units[one] for one in (signal, *_SAME_UNIT.get(signal, ()))
                     if one in self.units), '')

    def naming(self, names: Sequence[str], where: object) -> Layout:
        """Return the layout with a table's own names; raises InputError if one is missing.

        A name may be given without its unit.
        """
        columns = {}
        for signal, name in self.columns.items():
            alike = [one for one in ('', *names) if one == name] or [
                one for one in names
                if _BRACKET.sub('', one).strip().casefold() == name.strip().casefold()]
            if len(alike) != 1:
                raise InputError(f'{where}: has no column {name!r}, but {_listed(names)}')
            columns[signal], = alike
        return replace(self, columns=columns)


@dataclass(frozen=True)
class Column:
    """A used column: its name, signal, joint and unit, and the factor to SI units."""

    name: str
    signal: str     # effort for current, too
    joint: str
    unit: str
    factor: float
    dimension: str = ''     # what the unit measures, such as angle; '' if it is not known
    key: tuple[str, ...] = ()
    stated: bool = False    # whether the unit was given, by the user or in the name
    rival: str = ''         # another column that is as good, by its name


@dataclass
class Assignment:
    """The used columns of a table."""

    columns: list[Column]
    layout: Layout              # with the table's names
    notes: list[str]            # what was guessed
    chosen: str | None = None   # the joint whose columns the user named

    @property
    def joints(self) -> list[str]:
        """Names of the joints; a single joint without a name is ''."""
        return list(dict.fromkeys(c.joint for c in self.columns if c.signal == 'position'))

    @property
    def effort_is_current(self) -> bool:
        """Whether efforts are in A."""
        return any(c.dimension == 'current' for c in self.columns if c.signal == 'effort')

    @property
    def linear(self) -> bool:
        """Whether positions are lengths: values are then in m and N."""
        return any(c.dimension == 'length' for c in self.columns if c.signal == 'position')

    def of(self, signal: str, joint: str) -> Column | None:
        """Return the column of a joint's signal, or None; what names no joint is everyone's."""
        shared = signal in ('time', 'temperature') or '' not in self.joints
        return next((column for name in (joint, *([''] if shared else [])) for column in
                     self.columns if (column.signal, column.joint) == (signal, name)), None)

    def signal_in(self, table: Mapping[str, np.ndarray], signal: str, joint: str = ''
                  ) -> np.ndarray | None:
        """Return a joint's signal in SI units from the columns of a table, or None."""
        column = self.of(signal, joint)
        return None if column is None else column.factor * table[column.name]


def assign(names: Sequence[str], layout: Layout | None, where: object, plan: bool = False
           ) -> Assignment:
    """Assign signals to a table's columns; `where` names the table in messages.

    Columns without a name are left out. A `plan` has no effort, and its targets are positions where
    there are no others. Raises InputError, with the way to declare it, if a column is missing or a
    unit is not known.
    """
    names = [name for name in names if name]
    layout = (layout or Layout()).naming(names, where)
    columns, own = _columns(names, layout, where, plan)
    used, unclear = _of_joints(columns, own, where), list[str]()
    needed = {'time': not layout.rate, 'position': True, 'effort': not (layout.stiffness or plan),
              'reference_position': bool(layout.stiffness)}
    for one in [column for column in used if column.rival]:
        unclear += [f'which column is the {one.signal}, {one.name!r} or {one.rival!r}? Name it '
                    f'with --columns {one.signal}={one.name}']
        if needed.get(one.signal):
            raise InputError(f'{where}: {unclear[-1]}')
        used.remove(one)    # nothing depends on it
    signals = {column.signal for column in used}
    if missing := [signal for signal, wanted in needed.items() if wanted and signal not in signals]:
        raise InputError(f'{where}: {_missing(missing, names, layout, signals)}')
    in_ampere = {c.dimension == 'current' for c in used if c.signal == 'effort'}
    if len(in_ampere) > 1:
        raise InputError(f'{where}: some joints have a current, others an effort: name the columns '
                         'of one joint with --columns')
    # Without the torque constant, a commanded torque says nothing beside a current.
    used = [c for c in used if c.signal != 'command' or c.dimension == 'current'
            or in_ampere != {True}]
    used.sort(key=lambda c: (SIGNALS.index(c.signal), names.index(c.name)))
    named = {signal for signal, name in layout.columns.items() if name} - {'time'}
    joints = {c.key: c.joint if c.key else '' for c in used if c.signal == 'position'}
    if len(joints) == 1:
        joints = {key: joint if joint and not named else layout.joint
                  for key, joint in joints.items()}
    elif named and layout.joint and layout.joint not in joints.values():
        joints[own] = layout.joint
    used = [replace(c, joint=joints.get(c.key, '')) for c in used]
    stated = {(c.signal, c.dimension): c.name for c in used if c.stated}
    for effort, place, remedy in _APART:
        if {('effort', effort), ('position', place)} <= stated.keys():
            raise InputError(
                f'{where}: {stated["effort", effort]!r} is a {effort}, and the position '
                f'{stated["position", place]!r} a{"n" * (place == "angle")} {place}: {remedy}')
    # Forces move a linear axis.
    if ('effort', 'force') in stated:
        used = [replace(c, dimension='length', unit='m') if c.signal == 'position'
                and not c.stated else c for c in used]
    return Assignment(used, layout, unclear + _notes(used, layout),
                      joints.get(own, '') if named and len(joints) > 1 else None)


def _columns(names: Sequence[str], layout: Layout, where: object, plan: bool = False
             ) -> tuple[list[Column], tuple[str, ...]]:
    """Return the best column for each signal of each joint, and the joint of the user's columns."""
    told = {name: _named(signal, name, layout, where)
            for signal, name in layout.columns.items() if name}
    none = {_kind(signal) for signal, name in layout.columns.items() if not name}
    # Without their numbers, the columns of sibling joints have one name.
    alike = {_pattern(name): signal for name, signal in told.items()
             if signal != 'time' and name != _pattern(name).strip('#') != ''}
    first = next((layout.columns[signal] for signal in ('position', 'effort', 'current', 'velocity')
                  if layout.columns.get(signal)), '')
    # Where the user's columns have a number, it is the joint's.
    numbered = bool(re.search(r'\d', first))
    own, kinds = _key(first, numbered), {*map(_kind, told.values())}
    best: dict[tuple[str, tuple[str, ...]], tuple[tuple[int, ...], Column]] = {}
    for name in names:
        reading, sibling = read_name(name), _pattern(name) in alike
        signal = told.get(name) or alike.get(_pattern(name)) or reading.signal
        key = () if signal == 'time' else own if name in told else _key(name, numbered)
        reading = reading._replace(
            signal=signal.removeprefix('reference_') if plan else signal, key=key,
            joint='_'.join(key) if numbered and sibling else reading.joint)
        kind = _kind(reading.signal)
        if kind in {'', *none} or (name not in told and kind in kinds and key in (own, ())):
            continue
        column = _column(name, reading, layout)
        if column is None:
            if name in told:
                raise InputError(f'{where}: {_say_unit(name, reading)}')
            continue
        # By the name's unit, whatever the user's is.
        other = bool(reading.unit) and unit_of(reading.signal, reading.unit) is None
        rank = (name not in told, not sibling, kind == 'effort' and not reading.measured, other,
                SIGNALS.index(reading.signal), plan and signal != reading.signal)
        lowest, chosen = best.get((kind, key), (rank, column))
        if rank < lowest or chosen is column:
            best[kind, key] = rank, column
        elif rank == lowest:
            best[kind, key] = rank, replace(chosen, rival=name)
    return [column for _, column in best.values()], own


def _named(signal: str, name: str, layout: Layout, where: object) -> str:
    """Return the signal of a column that the user named; only names that mean it are torques."""
    reading = read_name(name)
    if (signal, reading.signal) == ('effort', 'current'):
        return 'current'
    if signal == 'effort' and not (reading.torque or reading.unit or layout.unit('effort')):
        raise InputError(f'{where}: column {name!r}: its name tells no unit: say what one of it '
                         'is, --unit effort=N·m, or A, V, %, or 2.69mA')
    return signal


def _pattern(name: str) -> str:
    return re.sub(r'\d+', '#', name)


def _key(name: str, numbered: bool) -> tuple[str, ...]:
    """Return what tells the joint of a column: its numbers, or the words of its name."""
    return tuple(re.findall(r'\d+', name)) if numbered else read_name(name).key


def _kind(signal: str) -> str:
    return 'effort' if signal == 'current' else signal


def _column(name: str, reading: Reading, layout: Layout) -> Column | None:
    """Return a column in the unit of the layout, else of its name, else the SI unit.

    It is None if the unit is not known, and the column is no effort: of that, values in a unit such
    as V or % stay as they are.
    """
    signal, given = reading.signal, layout.unit(reading.signal)
    if signal == 'current' and given and unit_of('current', given) is None:
        signal = 'effort'   # 62N: the force of 1 A
    text = given or reading.unit
    default = 'N·m' if reading.torque and signal == 'command' else _SI[signal]
    unit, told = unit_of(signal, text or default), parse_unit(text or default)
    # The torque constant may make a current of an effort without a unit.
    said = text or default * (signal != 'effort')
    if unit and told and '/' in unit.dimension and '/' not in told.dimension:
        said += '/s'
    if unit is None:
        if text and _kind(signal) != 'effort':
            return None
        factor, said = (other_unit(text) if text else None) or (1.0, said)
        unit = Unit(factor, '')
    return Column(name, _kind(signal), reading.joint, said, *unit, reading.key, bool(text))


def _of_joints(columns: Sequence[Column], own: tuple[str, ...], where: object) -> list[Column]:
    """Return the columns of joints with position and effort, of the user's (`own`) and of none."""
    positions, efforts = ({c.key: None for c in columns if c.signal == signal}
                          for signal in ('position', 'effort'))
    if len(positions) == len(efforts) == 1:
        # The only position and the only effort are of one joint, however they are named.
        columns = [replace(c, key=next(iter(positions))) if c.key in efforts and (
            c.key or c.signal == 'effort') else c for c in columns]
        efforts = positions
    both = {key for key in positions if key in efforts}
    if not both and len(efforts) > 1 < len(positions):
        raise InputError(f'{where}: which effort is of which joint? Name the columns of one with '
                         '--columns position=NAME,effort=NAME; there are ' + _listed(
                             [c.name for c in columns if c.signal in ('position', 'effort')]))
    # An effort that names no joint is that of any, but not beside those that name theirs.
    return [c for c in columns if c.key in {*(both or positions), own, ()} and not (
        both and () not in both and not c.key and c.signal in ('position', 'effort'))]


def without_time(names: Sequence[str], layout: Layout, where: object
                 ) -> tuple[Column, Column] | None:
    """Return the columns of velocity and effort of a table of steady states, else None.

    Its rows are means at constant speeds, without time and position. Raises InputError if it has
    several joints or speeds, and none is named.
    """
    columns, own = _columns([*filter(None, names)], layout.naming(names, where), where)
    signals = {column.signal for column in columns}
    if layout.rate or signals & {'time', 'position'}:
        return None
    # A commanded speed is that of the means where none is measured.
    wanted = 'velocity' if 'velocity' in signals else 'reference_velocity'
    speeds, efforts = ([c for c in columns if c.signal == kind and (not own or c.key in (own, ()))]
                       for kind in (wanted, 'effort'))
    pairs = [(speed, effort) for speed in speeds for effort in efforts
             if speed.key == effort.key or () in (speed.key, effort.key)
             if layout.joint in ('', speed.joint, effort.joint)]
    if len(pairs) > 1 or any(c.rival for pair in pairs for c in pair):
        raise InputError(f'{where}: which speed and which effort? Name one with --joint, or both '
                         f'with --columns velocity=NAME,effort=NAME; there are {_listed(names)}')
    return pairs[0] if pairs else None


def _missing(missing: Sequence[str], names: Sequence[str], layout: Layout, signals: set[str]
             ) -> str:
    """Return what is asked if signals are missing: the unit, or the command to copy."""
    for name in names:
        reading = read_name(name)
        if reading.signal in missing and _column(name, reading, layout) is None:
            return _say_unit(name, reading)
    hints = {'time': ', or the rows per second with --rate HZ', 'effort': (
        ', or the gains of the position controller with --stiffness and --damping: effort is then '
        'k_p (target - position) - k_d velocity' if 'reference_position' in signals else
        ', a command only if the drive is known to follow it' if 'command' in signals else '')}
    said = ', the '.join('effort or current' if one == 'effort' else one.replace('_', ' ')
                         for one in missing)
    return (f'which column is the {said}? Name it with --columns '
            f'{",".join(f"{one}=NAME" for one in missing)}'
            f'{"".join(hints.get(one, "") for one in missing)}; there are {_listed(names)}'
            + '; files with a signal each are joined by a plus: q.csv+tau.csv' * (len(signals) < 2))


def _say_unit(name: str, reading: Reading) -> str:
    return (f'column {name!r}: {reading.unit!r} does not tell what a {reading.signal} of 1 is: '
            f'say it, for instance with --unit {unit_to_give(reading.signal)}')


def unit_to_give(signal: str) -> str:
    """Return what ``--unit`` may say of a signal, to be copied."""
    return f'{signal}=' + {
        'position': 'counts/4096 (counts in a turn), deg, turn or rad', 'effort': '2.69mA, counts '
        'or N·m', 'time': 'ms, or 0.01s', 'velocity': '0.229rpm, deg/s or rad/s'
        }.get(signal, _SI[signal])


def _listed(names: Sequence[str]) -> str:
    return ', '.join(map(repr, names[:200])) + ' …' * bool(names[200:])


def _notes(used: Sequence[Column], layout: Layout) -> list[str]:
    """Return notes: what was told by names, and asked for instead of measured."""
    named = layout.columns.values()
    # A column named after its signal is no matter of words; other joints need no line of their own.
    alike: dict[tuple[str, str], list[Column]] = {}
    for c in used:
        if c.name not in named and c.name.lower() != f'{c.joint}.{c.signal}'.strip('.').lower():
            alike.setdefault((c.signal, c.unit), []).append(c)
    told = ', '.join(
        f'{first.joint}.{first.signal}'.lstrip('.') + f'={first.name}'
        + f' in {first.unit}' * bool(first.unit) + f' and {len(others)} alike' * bool(others)
        for first, *others in alike.values())
    return [f'columns guessed from their names: {told} (override with --columns and --unit)'
            ] * bool(told) + [
        f'{c.name}: by its name an effort that was asked for, not measured: friction is in it only '
        'if the drive gives just this' for c in used
        if c.name in named and c.signal == 'effort' and read_name(c.name).aim]
