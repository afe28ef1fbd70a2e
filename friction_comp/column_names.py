# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the name of a column: which quantity it is, measured or target, and of which joint.

A name is split into words, at separators, between letters and digits, and where upper case begins.
Words of the vocabulary give the quantity and whether it is a target; what remains names the joint.
No name of a particular robot is listed: ``actual_q_2``, ``a1 position [rad]``, ``posAct`` and
``observation.state[0]`` follow from the same rule.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
import re

from friction_comp.units import parse_unit, unit_of

# Quantity to the words that mean it; several words that stand together are joined by '+'.
_QUANTITIES = {
    'time': 'time times t timestamp timestamps stamp sec secs second seconds elapsed date datetime',
    'position': 'position positions pos q qpos angle angles theta phi displacement '
                'observation+state',
    'velocity': 'velocity velocities vel vels velo dq qd qdot qvel q+dot dot+q omega speed speeds '
                'dtheta theta+dot thetadot',
    'effort': 'effort efforts torque torques tau taus trq moment force forces frc qfrc tau+m '
              'tau+j',
    'current': 'current currents i iq im i+q i+m curr amp amps',
    'direction': 'direction dir',
    'load': 'load tau+b tau+ext wrench',
    'link_torque': 'jts torque+sensor+joint joint+torque+sensor tau+link',
    'temperature': 'temperature temperatures temp temps',
    'target': 'action',
    # What is none of the signals, though one of its words is.
    '': 'ddq qdd qddot acc acceleration accelerations accel ddtheta error errors err limit limits '
        'max min std variance gain kp kd present+load id voltage power energy status bits',
}
_MEASURED = {'actual', 'act', 'measured', 'meas', 'present', 'feedback', 'fb', 'observed', 'sensed',
             'observation', 'obs', 'mean', 'avg', 'average', 'real', 'applied', 'estimated', 'est'}
_TARGET = {'target', 'tgt', 'reference', 'ref', 'desired', 'des', 'goal', 'command', 'commanded',
           'cmd', 'setpoint', 'set', 'sp', 'computed'}
# A torque with one of these words is applied to the joint from outside, or behind the gear.
_OUTSIDE = {'external', 'ext', 'interaction', 'sensor', 'person', 'human', 'hand', 'backdriving',
            'contact', 'load', 'driving', 'back'}
_BEHIND = {'link', 'output'}
# Words that say nothing, except next to a number: joint_1.
_NEUTRAL = {'joint', 'joints', 'states', 'state', 'motor', 'motors', 'rotor', 'robot', 'arm',
            'actuator', 'servo', 'axis', 'drive', 'data', 'value', 'values', 'msg', 'raw',
            'filtered', 'filt', 'angular', 'rotational', 'mechanical', 'mech', 'shaft', 'encoder',
            'field', 'unix', 'utc', 'ros', 'system', 'epoch', 'log'}
_SECOND_CHOICE = {'motor', 'motors', 'rotor', 'raw', 'filtered', 'filt'}
# Quantities that torque becomes with words of `_OUTSIDE` or `_BEHIND`, and targets of quantities.
_TARGETS = {'position': 'reference_position', 'velocity': 'reference_velocity',
            'effort': 'command', 'current': 'command', 'target': 'reference_position'}
_BRACKET = re.compile(r'\s*[\[(]([^\])]*)[\])]\s*$')
_WORD = re.compile(r'[^\W\d_]+|\d+')
_CAMEL = re.compile(r'(?<=[a-z])(?=[A-Z])')
# A last word that may be a unit; single letters that are more often something else are none.
_LAST = re.compile(r'_((?!m$|N$)[^\W\d_]+)$')


@dataclass(frozen=True)
class Reading:
    """What the name of a column says.

    `key` identifies the joint among all spellings, () if there is none; `joint` is its name.
    """

    signal: str = ''        # one of columns.SIGNALS, or '' if the name tells none
    key: tuple[str, ...] = ()
    joint: str = ''
    unit: str = ''          # as written; '' if the name has none
    torque: bool = False    # whether a command is a torque rather than a current
    rank: int = 0           # of several columns for one signal, the lowest is used


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
    if match and (parse_unit(match[1]) is not None or not re.search(r'\d', match[1])):
        return replace(_read_plain(name[:match.start()]), unit=match[1].strip())
    match = _LAST.search(name)
    if match and parse_unit(match[1]) is not None:
        shorter = _read_plain(name[:match.start()])
        if shorter.signal and unit_of(shorter.signal, match[1]) is not None:
            return replace(shorter, unit=match[1])
    return _read_plain(name)


def _read_plain(name: str) -> Reading:
    """Return what a name without a unit says."""
    short = re.sub(r'^/?(.*/)?joint_states/', '', name)
    left, _, right = short.replace('/', '.').rpartition('.')
    if left:
        signal = _read_words(right)
        joint = [word.lower() for _, word in _parts(left)]
        if signal.signal and not signal.key and not set(joint) <= _vocabulary():
            return replace(signal, key=_distinctive(joint), joint=short[:len(left)])
    return _read_words(name)


def _read_words(bare: str) -> Reading:
    words = _parts(bare)
    lower = [word.lower() for _, word in words]
    quantity, used = _quantity_in(lower)
    sources = {word for word in lower if word in _MEASURED | _TARGET}
    if quantity is None and len(lower) == 1 and lower[0] == 'd':
        return Reading('direction')
    aims = bool(sources & _TARGET) or lower[:2] == ['q', 'd']
    if quantity is None:
        # `reference` alone is the position, `command` alone the current.
        if not sources & _TARGET:
            return Reading()
        quantity = 'current' if sources & {'command', 'commanded', 'cmd'} else 'target'
    if not quantity:
        return Reading()
    signal, special = _signal(quantity, lower, aims)
    rest = [k for k, word in enumerate(lower) if not (
        k in used or word in _MEASURED | _TARGET or word in special
        or (aims and lower[:2] == ['q', 'd'] and k == 1))]
    key = _distinctive([lower[k] for k in rest])
    if signal == 'time' and key:
        return Reading()
    rank = int(any(word in _SECOND_CHOICE for word in lower))
    return Reading(signal, key, _label(bare, words, lower, rest) if key else '', '',
                   signal == 'command' and quantity == 'effort', rank)


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
        for word in _CAMEL.split(match[0]):
            found.append((begin, word))
            begin += len(word)
    return found


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
                if quantity == '':
                    return '', set()
                # `load` beside a torque says where the torque acts.
                if not (quantity == 'load' and found == 'effort'):
                    found = quantity
                used |= set(range(k, k + size))
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
