# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the name of a column: which quantity it is, measured or target, its unit, and the joint.

A name is a row of words. Each is a quantity, a source, a unit, or says nothing; what remains names
the joint. Where no word is a quantity, the unit tells it, as in ``encoder_rad``. There is no other
rule: values are not looked at, no robot is listed, and what is not understood is declared.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
import re

from friction_comp.tables.units import OTHER_UNITS, parse_unit, unit_of

_QUANTITIES = {word: quantity for quantity, words in {
    'time': 'time times t timestamp timestamps stamp sec secs second seconds elapsed date datetime',
    'position': 'position positions pos q qpos angle angles ang theta phi displacement',
    'velocity': 'velocity velocities vel dq qd qdot qvel omega speed speeds dtheta',
    'effort': 'effort efforts eff torque torques tau taus trq moment force forces qfrc',
    'current': 'current currents curr cur i iq amp amps',
    'direction': 'direction dir', 'load': 'load wrench',
    'temperature': 'temperature temperatures temp temps',
    # No signals, though another word may be that of one.
    '': 'ddq qdd acc acceleration accelerations accel error errors err limit limits max min peak '
        'std variance gain constant kp ki kd kt power energy status mode bits duration dur bus '
        'supply battery batt electrical elec'}.items() for word in words.split()}
_SURELY = {'actual', 'act', 'measured', 'meas', 'present', 'feedback', 'fb', 'sensed'}
_MEASURED = _SURELY | {'observed', 'observation', 'observations', 'obs', 'mean', 'avg', 'average',
                       'real', 'applied', 'estimated', 'est', 'estimate'}
_TARGET = {'target', 'reference', 'ref', 'desired', 'des', 'goal', 'command', 'commanded', 'cmd',
           'setpoint', 'set', 'planned', 'action'}
# A torque with one of these words is applied from outside, or measured behind the gear.
_OUTSIDE = {'external', 'ext', 'interaction', 'sensor', 'person', 'human', 'hand', 'load'}
_BEHIND = {'link', 'output'}
# Words that say nothing, except next to a number: joint_1.
_NEUTRAL = {'joint', 'joints', 'state', 'states', 'motor', 'motors', 'mot', 'rotor', 'robot', 'arm',
            'actuator', 'servo', 'axis', 'drive', 'data', 'value', 'values', 'msg', 'filtered',
            'filt', 'angular', 'shaft', 'encoder', 'field', 'header', 'id', 'in', 'log', 'unix',
            'utc', 'ros', 'since', 'start', 'system', 'host', 'epoch'}
_TARGETS = {'position': 'reference_position', 'velocity': 'reference_velocity',
            'effort': 'command', 'current': 'command'}
_OF_UNIT = {'time': 'time', 'angle': 'position', 'counts': 'position', 'angle/time': 'velocity',
            'counts/time': 'velocity', 'torque': 'effort', 'current': 'current',
            'temperature': 'temperature'}
# Units that are more often something else, unless they are the last word; and after these words,
# which are of a linear axis as much as of another, a last m or N is one.
_LAST_ONLY = {'s', 'A', 'C', 'V', 'W', 'sec', 'secs', 'second', 'seconds', 'min', 'in', 'rot'}
_LENGTHS = {'position', 'displacement', 'velocity', 'speed', 'force'}
_BRACKET = re.compile(r'\s*[\[(]([^\])]*)[\])]\s*$')
_WORD, _CAMEL = re.compile(r'[^\W\d_]+|\d+'), re.compile(r'(?<=[a-z])(?=[A-Z])')
# The name of a topic, before a joint.
_TOPIC = re.compile(r'^/?(.*/)?joint_states/')


@dataclass(frozen=True)
class Reading:
    """What the name of a column says."""

    signal: str = ''        # one of units.DIMENSIONS, or '' if the name tells none
    key: tuple[str, ...] = ()   # identifies the joint among all spellings, () if there is none
    joint: str = ''         # as it is written
    unit: str = ''          # as written; '' if there is none
    torque: bool = False    # whether the quantity is a torque or force
    measured: bool = False  # whether it says that it is: of effort and current, this one is used


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
    if lower == ['d']:
        return Reading('direction')
    found = [k for k, word in enumerate(lower) if word in _QUANTITIES]
    # In `i_q` the q is no position, in `RadPerSec` the second no time.
    telling = [k for k in found if not (lower[k] == 'q' and 'i' in lower)]
    telling = [k for k in telling if _QUANTITIES[lower[k]] != 'time'] or telling
    if any(_QUANTITIES[lower[k]] == '' for k in found):
        return Reading(unit=unit)
    quantity = _QUANTITIES[lower[telling[-1]]] if telling else ''
    of_unit: set[int] = set()
    if not unit:
        unit, of_unit = _unit_in(words, set(telling), _signal(quantity, lower) if quantity else '')
    if not quantity and (known := parse_unit(unit)):
        quantity = _OF_UNIT.get(known.dimension, '')
    signal = _signal(quantity, lower)
    special = _OUTSIDE if signal == 'load' else _BEHIND if signal in (
        'link_torque', 'position', 'velocity') else set()
    rest = [k for k, word in enumerate(lower) if k not in found and k not in of_unit
            and word not in _MEASURED | _TARGET | special]
    if signal == 'time':
        # A group says whose clock it is.
        group = max(map(bare.rfind, '.:/'))
        plain = not {lower[k] for k in rest if words[k][0] > group} - _NEUTRAL
        return Reading('time' if plain else '', unit=unit)
    joint = [k for k in rest if lower[k] not in _NEUTRAL]
    return Reading(signal, tuple(lower[k] for k in joint), _label(bare, words, rest, joint), unit,
                   quantity in ('effort', 'load'), bool(_SURELY & {*lower}))


def _signal(quantity: str, words: list[str]) -> str:
    """Return the signal of a quantity, '' for none, with the other words of a name."""
    others = set(words)
    if others & _TARGET:
        # `reference` alone is the position, `command` alone the current.
        return _TARGETS.get(quantity, '') if quantity else (
            'command' if others & {'command', 'commanded', 'cmd'} else 'reference_position')
    if quantity == 'effort' and others & _BEHIND:
        return 'link_torque'
    if quantity == 'load' and 'present' in others:
        return ''   # so servos call their own, which is no torque
    return 'load' if quantity == 'effort' and others & _OUTSIDE else quantity


def _unit_in(words: list[tuple[int, str]], used: set[int], signal: str) -> tuple[str, set[int]]:
    """Return the unit among the words of a name that the signal can have, and its places."""
    lengths = any(words[k][1].lower() in _LENGTHS for k in used)
    for size in (3, 2, 1):
        for first in range(len(words) - size, -1, -1):
            places = {*range(first, first + size)}
            text = '' if places & used else _unit_of_words(
                [words[k][1] for k in sorted(places)], first + size == len(words), lengths)
            if text and (unit_of(signal, text) if signal else len(text) > 1 and parse_unit(text)):
                return text, places
    return next(((OTHER_UNITS[word.lower()], {k}) for k, (_, word) in enumerate(words)
                 if word.lower() in OTHER_UNITS and (len(word) > 1 or word in _LAST_ONLY)),
                ('', set()))


def _unit_of_words(part: list[str], last: bool, lengths: bool) -> str:
    """Return the unit that one to three words may mean: mA, rad s, N m, deg per s."""
    above, below = part[0], part[-1]
    if above.isdigit() or below.isdigit():
        return ''
    if len(part) == 3:
        return f'{above}/{below}' if part[1].lower() in ('per', 'p') else ''
    if len(part) == 2:
        return f'{above}·{below}' if below.lower() == 'm' else f'{above}/{below}'
    if len(above) == 1 or above.lower() in _LAST_ONLY:
        return above if last and (above in _LAST_ONLY or (lengths and above in 'mN')) else ''
    return above


def _label(name: str, words: list[tuple[int, str]], rest: list[int], joint: list[int]) -> str:
    """Return the joint's name as it is written: a group, or words with neutral ones beside them."""
    if not joint:
        return ''
    first, last = joint[0], joint[-1]
    group = max(map(name.rfind, '.:/'))
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


def is_target(name: str) -> bool:
    """Return whether a name says that what it names is no measurement, but a target or command."""
    words = {word.lower() for _, word in _parts(name)}
    return bool((words | {word.removesuffix('s') for word in words}) & _TARGET)


def plain_name(name: str) -> str:
    """Return a column's name without a unit in brackets behind it, for comparing."""
    return _BRACKET.sub('', name).strip().casefold()


def skeleton(name: str) -> str:
    """Return a name with its numbers replaced, the same for the columns of sibling joints; or ''.

    A name without a number, or of nothing else, has no siblings.
    """
    pattern = re.sub(r'\d+', '#', name)
    return pattern if '#' in pattern and pattern.strip('#') else ''


def numbers(name: str) -> tuple[str, ...]:
    """Return the numbers in a name."""
    return tuple(re.findall(r'\d+', name))
