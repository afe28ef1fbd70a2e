# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the name of a column: which quantity it is, measured or target, and of which joint.

Words of the vocabulary give the quantity, whether it is a target, and the unit; what remains names
the joint. Where no word gives the quantity, the unit does, as in ``encoder_rad``. No name of a
particular robot is listed: ``actual_q_2``, ``a1 position [rad]``, ``posAct`` and
``observation.state[0]`` follow from the same rule. Words are English and German.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
import re

from friction_comp.units import parse_unit, unit_of

# Quantity to the words that mean it; several words that stand together are joined by '+'.
_QUANTITIES = {
    'time': 'time times t timestamp timestamps stamp sec secs second seconds elapsed date datetime '
            'zeit zeitstempel datum uhrzeit',
    'position': 'position positions pos q qpos angle angles ang theta phi displacement '
                'winkel gelenkwinkel lage observation+state',
    'velocity': 'velocity velocities vel vels velo dq qd qdot qvel q+dot dot+q omega speed speeds '
                'dtheta theta+dot thetadot geschwindigkeit winkelgeschwindigkeit drehzahl',
    'effort': 'effort efforts eff torque torques tau taus trq tor moment force forces frc qfrc '
              'tau+m tau+j drehmoment motormoment kraft',
    'current': 'current currents i iq im i+q i+m cur curr amp amps strom motorstrom',
    'direction': 'direction dir',
    'load': 'load tau+b tau+ext wrench',
    'link_torque': 'jts torque+sensor+joint joint+torque+sensor tau+link',
    'temperature': 'temperature temperatures temp temps temperatur motortemperatur',
    # No signals, though one of the words may be that of a signal: an electrical angle is a multiple
    # of the shaft's, by the pairs of poles.
    '': 'ddq qdd qddot acc acceleration accelerations accel ddtheta error errors err limit limits '
        'max min peak std variance gain constant kp ki kd kt present+load id voltage power energy '
        'status bits duration dur bus supply battery batt current+state current+mode cur+state '
        'cur+mode electrical+angle electrical+position '
        'electrical+degrees elec+angle elec+pos angle+elec theta+elec',
}
_SURELY_MEASURED = {'actual', 'act', 'measured', 'meas', 'present', 'feedback', 'fb', 'sensed',
                    'ist', 'istwert', 'gemessen'}
_MEASURED = _SURELY_MEASURED | {'observed', 'observation', 'observations', 'obs', 'mean', 'avg',
                                'average', 'real', 'applied', 'estimated', 'est', 'estimate'}
_TARGET = {'target', 'tgt', 'reference', 'ref', 'desired', 'des', 'goal', 'command', 'commanded',
           'cmd', 'cmptd', 'setpoint', 'set', 'sp', 'computed', 'planned', 'requested', 'demand',
           'demanded', 'action', 'soll', 'sollwert'}
# A torque with one of these words is applied to the joint from outside, or behind the gear.
_OUTSIDE = {'external', 'ext', 'interaction', 'sensor', 'person', 'human', 'hand', 'backdriving',
            'contact', 'load', 'driving', 'back'}
_BEHIND = {'link', 'output'}
# Words that say nothing, except next to a number: joint_1.
_NEUTRAL = {'joint', 'joints', 'states', 'state', 'motor', 'motors', 'mot', 'rotor', 'robot', 'arm',
            'actuator', 'servo', 'axis', 'drive', 'data', 'value', 'values', 'msg', 'raw',
            'filtered', 'filt', 'angular', 'rotational', 'mechanical', 'mech', 'shaft', 'encoder',
            'field', 'rms', 'unix', 'utc', 'ros', 'system', 'epoch', 'log', 'gelenk', 'achse',
            'antrieb'}
# Words beside a time: since when it counts, or whose it is.
_CLOCK = {'since', 'from', 'start', 'started', 'begin', 'boot', 'today', 'day', 'midnight', 'wall',
          'clock', 'relative', 'rel', 'monotonic', 'host', 'device', 'total'}
_MOTOR = {'motor', 'motors', 'mot', 'rotor'}
_SECOND_CHOICE = _MOTOR | {'raw', 'filtered', 'filt'}
# Quantities that torque becomes with words of `_OUTSIDE` or `_BEHIND`, and targets of quantities.
_TARGETS = {'position': 'reference_position', 'velocity': 'reference_velocity',
            'effort': 'command', 'current': 'command', 'target': 'reference_position'}
# Quantity that the unit gives if no word of a name does. A length may be that of anything.
_OF_UNIT = {'time': 'time', 'angle': 'position', 'counts': 'position', 'angle/time': 'velocity',
            'counts/time': 'velocity', 'torque': 'effort', 'current': 'current',
            'temperature': 'temperature'}
_BRACKET = re.compile(r'\s*[\[(]([^\])]*)[\])]\s*$')
_WORD = re.compile(r'[^\W\d_]+|\d+')
_CAMEL = re.compile(r'(?<=[a-z])(?=[A-Z])')
# Units that the package does not know: a column in one of them is in none of its own.
OTHER_UNITS = {'%', 'percent', 'pct', 'v', 'mv', 'w', 'lsb', 'tick', 'ticks', 'count', 'counts',
               'pulse', 'pulses', 'inc', 'increments', 'grad', 'raw', 'p.u.', 'pu', 'a.u.', 'au',
               'edeg', 'erpm'}
# Words of a name that say such a unit, where the name says no quantity of the package.
_SAYING = {'volt': 'V', 'volts': 'V', 'voltage': 'V', 'duty': '%', 'pwm': 'PWM', 'watts': 'W',
           **{unit: unit for unit in ('percent', 'pct', 'lsb', 'tick', 'ticks', 'count', 'counts',
                                      'pulse', 'pulses', 'increments', 'raw')}}
# Others of a drive's effort, which names do not give.
_OF_DRIVES = {'pwm', 'duty', '‰', 'permille', 'digit', 'digits', 'step', 'steps'}
# Units that are more often something else, unless they are the last word.
_LAST_ONLY = {'A', 's', 'C', 'sec', 'seconds'}
_NEVER = {'m', 'N', 'h', 'in', 'rot', 'rotation'}   # of a motor, of an input, of what rotates
# At the end of a name, or before a number: metres and newtons, if the table tells a linear axis.
_LINEAR = re.compile(r'(.*[^\W_][\W_]+)([mN])((?:[\W_]\d+)?)')
# Words that tell it, and those that tell an axis that turns.
_OF_LINEAR = {'force', 'forces', 'frc', 'kraft'}
_OF_TURNING = {'torque', 'torques', 'tau', 'taus', 'trq', 'tor', 'moment', 'drehmoment',
               'motormoment', 'angle', 'angles', 'ang', 'angular', 'rotational', 'theta', 'phi',
               'winkel', 'gelenkwinkel', 'omega', 'dtheta', 'thetadot', 'drehzahl',
               'winkelgeschwindigkeit'}
# In brackets before a unit, this is no inch, unless an inch-pound or inch-ounce: `Force (in N)`.
_PREPOSITION = re.compile(r'^in\s+(?!lb|oz)', re.IGNORECASE)
_DAYS = {'date', 'datum'}           # less than the time of the day beside them
# A time of these alone, without `from` or `since`, is one moment.
_MOMENTS, _SINCE = {'start', 'started', 'begin', 'boot'}, {'from', 'since'}
_AS_POINT = str.maketrans('/:', '..')   # between a group, as a topic or a device, and a quantity
# A mark that no joint's name has: brackets with one hold a unit, if an unknown one.
_MARK = re.compile(r'[^\w\s.,:_-]')


@dataclass(frozen=True)
class Reading:
    """What the name of a column says."""

    signal: str = ''        # one of columns.SIGNALS, or '' if the name tells none
    key: tuple[str, ...] = ()   # identifies the joint among all spellings, () if there is none
    joint: str = ''
    unit: str = ''          # as written, also where the signal is not told; '' if there is none
    torque: bool = False    # whether a command is a torque rather than a current
    rank: int = 0           # of several columns for one signal, the lowest is used
    measured: bool = False  # whether it says that it is: of effort and current, this one is used


def _distinctive(words: list[str]) -> tuple[str, ...]:
    return tuple(word for word in words if word not in _NEUTRAL)


@cache
def _vocabulary() -> set[str]:
    return {word for phrase in _phrases() for word in phrase} | _MEASURED | _TARGET | _NEUTRAL


@cache
def _phrases() -> dict[tuple[str, ...], str]:
    return {tuple(word.split('+')): quantity for quantity, words in _QUANTITIES.items()
            for word in words.split()}


def read_name(name: str) -> Reading:
    """Return what a column's name says."""
    name = name.strip()
    match = _BRACKET.search(name)
    text = _PREPOSITION.sub('', match[1].strip()) if match else ''
    if match and (parse_unit(text) is not None or _MARK.search(text)
                  or text.lower() in OTHER_UNITS):
        return _read_plain(name[:match.start()], text)
    return _read_plain(name)


def is_other_unit(text: str) -> bool:
    """Return whether a text is a unit in which an effort stays as it is, such as V or 0.1 %."""
    return text.strip().lstrip('+-.0123456789').strip(' *').lower() in OTHER_UNITS | _OF_DRIVES


def read_of_axis(name: str) -> Reading:
    """Return what a column's name says in a table of a linear axis: ``q_m`` is in metres."""
    reading, match = read_name(name), _LINEAR.fullmatch(name.strip())
    if not match or reading.unit or (
            reading.signal and unit_of(reading.signal, match[2]) is None):
        return reading
    return read_name(f'{match[1]}{match[3]} [{match[2]}]')


def is_linear(name: str, signal: str, unit: str) -> bool | None:
    """Return whether a column of motion or effort tells a linear axis; None if it tells neither.

    Of its `unit`, '' without one, an ``N`` at the end of its name, and its words, the first tells.
    """
    if signal not in ('position', 'velocity', 'reference_position', 'reference_velocity', 'effort'):
        return None
    if unit:
        known = unit_of(signal, unit)
        of = known.dimension.split('/')[0] if known else ''
        return {'length': True, 'force': True, 'angle': False, 'torque': False}.get(of)
    match = _LINEAR.fullmatch(name.strip())
    if match and match[2] == 'N' and signal == 'effort':
        return True
    words = {word.lower() for _, word in _parts(name)}
    return False if words & _OF_TURNING else True if words & _OF_LINEAR else None


def is_of_motor(name: str) -> bool:
    """Return whether a name says that a motor is measured, perhaps before its gear."""
    return bool({word.lower() for _, word in _parts(name)} & _MOTOR)


def in_turns_of(name: str) -> str:
    """Return the make of a drive that reports turns and calls a position so; '' if none does."""
    words = [word.lower() for _, word in _parts(name)]
    estimated = [word for word in words if not word.isdigit()][-2:] == ['pos', 'estimate']
    return 'ODrive' if estimated or {'odrive', 'odrv'} & set(words) else ''


def other_unit_in(name: str) -> str:
    """Return the unit that a word of a name says, of those that are none of the package's; or ''.

    ``LeftAppliedVolts`` is in V, and ``duty_cycle`` in %.
    """
    return next((_SAYING[word.lower()] for _, word in _parts(name) if word.lower() in _SAYING), '')


def is_target(name: str) -> bool:
    """Return whether a name says that what it names is no measurement, but a target or command."""
    words = {word.lower() for _, word in _parts(name)}
    return bool(words & _TARGET or {word.removesuffix('s') for word in words} & _TARGET)


def plain_name(name: str) -> str:
    """Return a column's name without a unit in brackets behind it, for comparing."""
    return _BRACKET.sub('', name).strip().casefold()


def _read_plain(name: str, unit: str = '') -> Reading:
    """Return what a name without brackets says; `unit` is what was in them."""
    short = re.sub(r'^/?(.*/)?joint_states/', '', name)
    left, _, right = short.translate(_AS_POINT).rpartition('.')
    if left and right.count('[') == right.count(']'):
        reading = _read_words(right, unit)
        joint = [word.lower() for _, word in _parts(left)]
        if reading.signal == 'time':
            return reading
        if reading.signal and not reading.key and not set(joint) <= _vocabulary():
            return replace(reading, key=_distinctive(joint), joint=short[:len(left)])
    return _read_words(name, unit)


def _read_words(bare: str, unit: str) -> Reading:
    """Return what a name without its unit says; `unit` is '' if it had none in brackets."""
    words = _parts(bare)
    lower = [word.lower() for _, word in words]
    quantity, used = _quantity_in(lower)
    sources = {word for word in lower if word in _MEASURED | _TARGET}
    aims = bool(sources & _TARGET) or lower[:2] == ['q', 'd']
    if quantity is None and lower == ['d']:
        return Reading('direction')
    if quantity == '':
        return Reading(unit=unit)
    by_unit = quantity is None
    if quantity is None:
        unit, of_unit = (unit, set()) if unit else _unit_in(words, used, '')
        known = parse_unit(unit)
        quantity = _OF_UNIT.get(known.dimension) if known else None
        if quantity is None and aims:
            # `reference` alone is the position, `command` alone the current.
            quantity = 'current' if sources & {'command', 'commanded', 'cmd'} else 'target'
        if quantity is None:
            return Reading(unit=unit)
    signal, special = _signal(quantity, lower, aims)
    if not by_unit:
        unit, of_unit = (unit, set()) if unit else _unit_in(words, used, signal)
    rest = [k for k, word in enumerate(lower) if k not in used | of_unit and not (
        word in _MEASURED | _TARGET or word in special
        or (aims and lower[:2] == ['q', 'd'] and k == 1))]
    if signal == 'time':
        clocks = {lower[k] for k in rest} <= _NEUTRAL | _CLOCK
        less = _DAYS & set(lower) or (_MOMENTS & set(lower) and not _SINCE & set(lower))
        return Reading(signal if clocks else '', unit=unit, rank=int(bool(less)))
    key = _distinctive([lower[k] for k in rest])
    rank = 2 * by_unit + any(word in _SECOND_CHOICE for word in lower)
    return Reading(signal, key, _label(bare, words, lower, rest) if key else '', unit,
                   signal == 'command' and quantity == 'effort', rank,
                   bool(sources & _SURELY_MEASURED))


def _unit_in(words: list[tuple[int, str]], used: set[int], signal: str) -> tuple[str, set[int]]:
    """Return the unit among the words of a name that the signal can have, and its places.

    Two words are a quotient or a product: ``deg_s`` and ``N_m``. It is '' if there is none.
    """
    spelt = ['' if k in used else word for k, (_, word) in enumerate(words)]
    for size in (3, 2, 1):
        for first in range(len(spelt) - size, -1, -1):
            part = spelt[first:first + size]
            for text in _spellings(part, first + size == len(spelt)):
                # A single letter, as in phase_A, does not tell a quantity.
                fits = unit_of(signal, text) if signal else len(text) > 1 and parse_unit(text)
                if fits:
                    return text, set(range(first, first + size))
    other = [k for k, word in enumerate(spelt) if word.lower() in OTHER_UNITS - {'raw', 'v', 'w'}]
    return (spelt[other[-1]], {other[-1]}) if other and signal else ('', set())


def _spellings(part: list[str], last: bool) -> list[str]:
    """Return the units that one to three words may mean."""
    if not all(part):
        return []
    if len(part) == 1:
        word, = part
        if word in _NEVER or (word in _LAST_ONLY and not last):
            return []
        # Capitals are more often those of a name in capitals, or of a word, than prefixes.
        written = {'nm': 'Nm', 'mnm': 'mNm', 'ma': 'mA'}
        return [word] if len(word) == 1 else [written.get(word.lower(), word.lower()), word]
    above, middle, below = part[0], part[1].lower(), part[-1]
    if len(part) == 3:
        return [f'{above.lower()}/{below}'] if middle in ('per', 'p') else []
    if above.lower() == 'in':
        return _spellings(part[1:], last)
    return [f'{above}·{below}'] if below.lower() == 'm' else [f'{above.lower()}/{below}']


def common_name(names: Sequence[str]) -> str:
    """Return what names begin with that may name a joint though it is a quantity: ``phi_tau``.

    It is '' where the names have nothing in common.
    """
    starts = [[word for _, word in _parts(name) if word.lower() not in _NEUTRAL] for name in names]
    alike = []
    for words in zip(*starts):
        if len({word.lower() for word in words}) > 1:
            break
        alike.append(words[0])
    quantities = {word for phrase in _phrases() for word in phrase}
    return alike[0] if alike and alike[0].lower() in quantities - _MEASURED else ''


def skeleton(name: str) -> str:
    """Return a name with its numbers replaced, the same for the columns of sibling joints."""
    pattern = re.sub(r'\d+', '#', name)
    return pattern if '#' in pattern and pattern.strip('#') else ''


def numbers(name: str) -> tuple[str, ...]:
    """Return the numbers in a name."""
    return tuple(re.findall(r'\d+', name))


def _parts(name: str) -> list[tuple[int, str]]:
    """Return the words of a name, each with its place."""
    found = []
    for match in _WORD.finditer(name):
        begin = match.start()
        # mA and degC are one word.
        whole = parse_unit(match[0]) is not None
        for camel in [match[0]] if whole else _CAMEL.split(match[0]):
            for word in _unglued(camel):
                found.append((begin, word))
                begin += len(word)
    return found


@cache
def _unglued(word: str) -> tuple[str, ...]:
    """Return the words of ``qdes`` and ``actpos``, which no mark separates."""
    lower = word.lower()
    sources, known = _MEASURED | _TARGET, _phrases()
    if lower not in _vocabulary():
        for k in range(1, len(word)):
            for one, other in ((lower[:k], lower[k:]), (lower[k:], lower[:k])):
                # A single letter that is not of a position is part of another word: test.
                quantity = known.get((one,), '')
                if other in sources and quantity in _TARGETS and (len(one) > 1 or one == 'q'):
                    return word[:k], word[k:]
    return (word,)


def _quantity_in(words: list[str]) -> tuple[str | None, set[int]]:
    """Return the quantity that words name and the indices of the words, the longest phrase first.

    Of several, the last is it, as in ``torque_sensor_temperature``.
    """
    phrases = _phrases()
    found: str | None = None
    used: set[int] = set()
    k = 0
    while k < len(words):
        for size in (3, 2, 1):
            quantity = phrases.get(tuple(words[k:k + size]))
            if quantity is not None and k + size <= len(words):
                numbered = words[k] == 'id' and ''.join(words[k + 1:k + 2]).isdigit()
                if quantity == '' and not numbered:
                    return '', set()
                # `load` beside a torque says where the torque acts, `id` beside a number which
                # motor it is, not a current in the direction of the flux.
                if not numbered:
                    used |= set(range(k, k + size))
                    if not (quantity == 'load' and found == 'effort'):
                        found = quantity
                k += size
                break
        else:
            k += 1
    return found, used


def _signal(quantity: str, words: list[str], aims: bool) -> tuple[str, set[str]]:
    """Return the signal of a quantity with its other words, and the words that decided it."""
    if quantity in ('effort', 'load') and not aims:
        if quantity == 'effort' and _BEHIND & set(words):
            return 'link_torque', _BEHIND
        if quantity == 'load' or _OUTSIDE & set(words):
            return 'load', _OUTSIDE
    if aims or quantity == 'target':
        return _TARGETS.get(quantity, ''), set()
    if quantity in ('position', 'velocity'):
        return quantity, _BEHIND
    return quantity, set()


def _label(name: str, words: list[tuple[int, str]], lower: list[str], rest: list[int]) -> str:
    """Return the joint's name as it is written, with neutral words that stand beside it."""
    joint = [k for k in rest if lower[k] not in _NEUTRAL]
    # /joint_states/elbow: the name of a topic is no part of the joint's.
    topic = {k for k in range(len(lower) - 1) if lower[k:k + 2] == ['joint', 'states']}
    outer = set(rest) - topic - {k + 1 for k in topic}
    first, last = joint[0], joint[-1]
    while first - 1 in outer:
        first -= 1
    while last + 1 in outer:
        last += 1
    if set(range(first, last + 1)) <= set(rest):
        return name[words[first][0]:words[last][0] + len(words[last][1])]
    return '_'.join(words[k][1] for k in rest if first <= k <= last)
