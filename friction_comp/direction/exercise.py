# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Movements shown to a person, with the directions announced: the note's, and YAML files.

An exercise may be made of a movement that a person guided, in the same tempo. Reversals are where a
joint turns by more than a hand trembles, rests where it does not leave a place; between them it
moves one way. Waypoints stand at the reversals and at the ends of the rests of any joint, and where
a monotone curve through the others would leave the path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from friction_comp.errors import (
    check_document,
    check_list,
    check_mapping,
    check_number,
    check_whole_number,
    errors_name,
    InputError,
)
from friction_comp.files import read_yaml

FORMAT, VERSION = 'friction_comp_exercise', 1
_UNITS = {'deg': math.pi / 180.0, 'rad': 1.0}
_KEYS = {'format', 'version', 'unit', 'joints', 'repetitions', 'announcement', 'steps'}
# Angles that differ by less, rad, are the same position.
_SAME = 1e-9
# Longest step and exercise, s, and farthest angle, rad.
_LONGEST, _FARTHEST = 86_400.0, 1e3
# Of a guided movement: rate, Hz; a turn by less, rad, is no reversal; a place is held if it is not
# left by more, rad, for so long, s; rest before the first movement, so that it can be announced, s.
_DEGREE = math.pi / 180.0
_RATE, _TURN, _PLACE, _REST, _FIRST_REST = 100.0, 1.0 * _DEGREE, 0.4 * _DEGREE, 0.4, 1.0


@dataclass(frozen=True)
class ReferenceMovement:
    """The note's movement (section 2.6): to and fro, each way after a standstill.

    The direction d is announced during the standstill before, and returns to 0 when the movement
    begins to decelerate, so that the compensation does not drive the joint beyond the target.
    Raises InputError if a number is out of range, or no phase of constant velocity is left.
    """

    amplitude: float = math.radians(40.0)  # between the ends, rad; negative: negative way first
    speed: float = math.radians(20.0)  # of the constant velocity phase, rad/s
    # s from standstill to that speed, by a raised cosine, and from it to standstill.
    acceleration_time: float = 0.5
    standstill: float = 2.0  # before each movement, s
    announcement: float = 1.0  # time by which the direction is announced before the movement, s
    repetitions: int = 10
    compensated: bool = True  # False keeps the direction at 0 throughout: the note's case 1

    def __post_init__(self) -> None:
        for name in ('speed', 'acceleration_time', 'standstill'):
            check_number(getattr(self, name), f'movement.{name}', above=0.0)
        if not math.isfinite(self.amplitude) or self.amplitude == 0.0:
            raise InputError('movement.amplitude must be finite and not 0')
        if not 0.0 <= self.announcement <= self.standstill:
            raise InputError('movement.announcement must be between 0 and the standstill')
        if self.repetitions < 1:
            raise InputError('movement.repetitions must be at least 1')
        if self.constant_time <= 0.0:
            raise InputError(
                f'movement.amplitude of {self.amplitude} rad is too short to reach the speed of '
                f'{self.speed} rad/s within {self.acceleration_time} s')

    @property
    def constant_time(self) -> float:
        """Duration of the constant velocity phase in s."""
        return abs(self.amplitude) / self.speed - self.acceleration_time

    @property
    def movement_time(self) -> float:
        """Duration of one movement in s, standstill not counted."""
        return self.constant_time + 2.0 * self.acceleration_time

    @property
    def duration(self) -> float:
        """Duration of the whole exercise in s, including a last standstill."""
        return 2.0 * self.repetitions * (self.standstill + self.movement_time) + self.standstill

    def begins(self, movement: int) -> float:
        """Return when movement 0, 1, 2 … begins, s; even ones are in the first direction."""
        return self.standstill + movement * (self.standstill + self.movement_time)

    def end(self, direction: float) -> float:
        """Return where the movement in a direction ends, rad; NaN for 0."""
        if direction == 0.0:
            return math.nan
        return self.amplitude if direction * self.amplitude > 0.0 else 0.0

    def at(self, time: ArrayLike) -> tuple[Any, Any, Any]:
        """Return position (rad), velocity (rad/s) and direction (-1, 0, +1) at times in s."""
        time = np.asarray(time, dtype=float)
        period = self.standstill + self.movement_time
        movement = np.floor(time / period)
        over = (movement >= 2 * self.repetitions) | (time < 0.0)
        forth = movement % 2 == 0
        since = time - movement * period - self.standstill
        travelled, speed = self._profile(since)
        sign = math.copysign(1.0, self.amplitude)
        announced = (since >= -self.announcement) & (
            since < self.acceleration_time + self.constant_time)
        position, velocity, direction = (np.where(over, 0.0, values) for values in (
            np.where(forth, travelled, abs(self.amplitude) - travelled) * sign,
            np.where(forth, speed, -speed) * sign,
            np.where(announced & self.compensated, np.where(forth, sign, -sign), 0.0)))
        if time.ndim == 0:
            return float(position), float(velocity), int(direction)
        return position, velocity, direction.astype(int)

    def _profile(self, since: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return angle and speed of a positive movement that began `since` seconds ago."""
        ramp, top = self.acceleration_time, self.speed
        since = np.clip(since, 0.0, self.movement_time)
        left = self.movement_time - since
        near = np.minimum(np.minimum(since, left), ramp)
        angle = 0.5 * top * (near - ramp / math.pi * np.sin(math.pi * near / ramp))
        travelled = np.where(left < ramp, abs(self.amplitude) - angle, np.where(
            since < ramp, angle, top * (since - 0.5 * ramp)))
        return travelled, 0.5 * top * (1.0 - np.cos(math.pi * near / ramp))


class ExerciseScript:
    """A movement of several joints through waypoints, with the announced direction of each joint.

    Each joint follows a monotone cubic (Fritsch and Carlson 1980): it stops or reverses only at
    waypoints. A movement from rest is announced ahead; the direction changes where the joint
    reverses, and returns to 0 when it begins to decelerate to rest. `times`, (K,), of the waypoints
    and `announcement` are in s, `positions`, (K, J), in rad from the beginning.
    """

    def __init__(self, joints: Sequence[str], times: np.ndarray, positions: np.ndarray,
                 announcement: float) -> None:
        # Imported only here: most exercises have no script, and start sooner without scipy.
        from scipy.interpolate import PchipInterpolator

        self.joints = list(joints)
        self.duration = float(times[-1])
        self.times, self.positions, self.announcement = times, positions, announcement
        self._paths = [PchipInterpolator(times, column) for column in positions.T]
        self._speeds = [path.derivative() for path in self._paths]
        self._announced = [_announcements(times, column, speed, announcement)
                           for column, speed in zip(positions.T, self._speeds)]

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position (rad), velocity (rad/s), direction (-1, 0, +1), (J,), at a time in s."""
        inside = min(max(time, 0.0), self.duration)
        moving = 0.0 <= time <= self.duration
        position = np.array([float(path(inside)) for path in self._paths])
        velocity = np.array([float(speed(inside)) for speed in self._speeds]) * moving
        return position, velocity, np.array([sign for sign, _ in self._spans_at(time)])

    def ends(self, time: float) -> np.ndarray:
        """Return where the announced movements end, rad, shape (J,); NaN where none is."""
        return np.array([end for _, end in self._spans_at(time)])

    def _spans_at(self, time: float) -> list[tuple[int, float]]:
        return [next(((sign, last) for begin, end, sign, last in spans if begin <= time < end),
                     (0, math.nan)) for spans in self._announced]

    def of(self, joints: Sequence[str]) -> ExerciseScript:
        """Return the exercise for these joints, in order; InputError if another one moves."""
        if unknown := sorted(set(self.joints) - set(joints)):
            raise InputError(f'the exercise moves {", ".join(unknown)}, but the joints are '
                             f'{", ".join(joints)}')
        columns = dict(zip(self.joints, self.positions.T))
        still = np.zeros(len(self.times))
        return ExerciseScript(
            joints, self.times, np.column_stack([columns.get(name, still) for name in joints]),
            self.announcement)


def load_exercise(path: str | Path) -> ExerciseScript:
    """Read an exercise; an InputError names the file, the step, and what is wrong with it."""
    document = read_yaml(path)
    with errors_name(path):
        return exercise_of(document)


def exercise_of(document: Any) -> ExerciseScript:
    """Return the exercise that the content of a YAML file describes."""
    document = check_document(document, 'an exercise', FORMAT, VERSION, _KEYS)
    unit = document.get('unit')
    if unit not in tuple(_UNITS):
        raise InputError(f'unit must be deg or rad, not {unit!r}')
    joints = document.get('joints')
    if (not isinstance(joints, list) or not joints or len(set(map(str, joints))) != len(joints)
            or not all(isinstance(name, str) and name for name in joints)):
        raise InputError('joints must be a list of distinct names')
    announcement = check_number(
        document.get('announcement', 1.0), 'announcement', least=0.0, most=_LONGEST)
    # All are computed at the start.
    count = check_whole_number(
        document.get('repetitions', 1), 'repetitions', least=1, most=10_000)
    steps = check_list(document.get('steps'), 'steps')
    if not steps:
        raise InputError('steps must be a list of holds and movements')
    return ExerciseScript(joints, *_waypoints(steps, joints, _UNITS[unit], count), announcement)


def _waypoints(steps: list[Any], joints: list[str], unit: float,
               count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times in s, (K,), and positions in rad, (K, J), of the repeated steps."""
    times, positions = [0.0], [np.zeros(len(joints))]
    for index, step in enumerate(steps, 1):
        time, position = _step(f'steps[{index}]', step, joints, positions[-1], unit)
        times.append(times[-1] + time)
        positions.append(position)
    if 'hold' not in steps[0]:
        raise InputError('steps[1] must be a hold: a movement from rest has to be announced')
    if 'hold' not in steps[-1]:
        # The joints come to rest before the exercise ends or repeats.
        times.append(times[-1] + _step('steps[1]', steps[0], joints, positions[-1], unit)[0])
        positions.append(positions[-1])
    if count > 1 and np.abs(positions[-1]).max() > _SAME:
        raise InputError('the last step must lead back to 0 if there are repetitions')
    once, angles = np.array(times), np.array(positions)
    return (np.concatenate([once[bool(k):] + k * once[-1] for k in range(count)]),
            np.concatenate([angles[bool(k):] for k in range(count)]))


def _step(name: str, step: Any, joints: list[str], before: np.ndarray,
          unit: float) -> tuple[float, np.ndarray]:
    """Return the duration of a step in s and the positions at its end, rad."""
    if isinstance(step, dict) and set(step) == {'hold'}:
        return check_number(step['hold'], f'{name}.hold', above=0.0, most=_LONGEST), before
    if not isinstance(step, dict) or set(step) not in ({'to', 'time'}, {'to', 'speed'}):
        raise InputError(f"{name} must have 'hold' (s), or 'to' with either 'time' (s) or 'speed'")
    position = before.copy()
    for joint, angle in check_mapping(step['to'], f'{name}.to', joints).items():
        position[joints.index(joint)] = unit * check_number(
            angle, f'{name}.to.{joint}', least=-_FARTHEST / unit, most=_FARTHEST / unit)
    distance = float(np.abs(position - before).max())
    if distance < _SAME:
        raise InputError(f'{name} moves nothing: use a hold')
    if 'time' in step:
        return check_number(step['time'], f'{name}.time', above=0.0, most=_LONGEST), position
    speed = unit * check_number(step['speed'], f'{name}.speed', above=0.0)
    return check_number(distance / speed, f'{name}: the time', most=_LONGEST), position


def _announcements(times: np.ndarray, position: np.ndarray, speed: Any,
                   announcement: float) -> list[tuple[float, float, int, float]]:
    """Return begin (s), end (s), direction and last position of each movement of one joint."""
    steps = np.diff(position)
    signs = np.where(np.abs(steps) < _SAME, 0, np.sign(steps)).astype(int)
    # A plan may stand for a sample at its turn, less than 0.05 s, which is no rest.
    for k in np.flatnonzero(signs[1:-1] == 0) + 1:
        if signs[k - 1] and signs[k + 1] and times[k + 1] - times[k] < 0.05:
            signs[k] = signs[k + 1]
    # A movement extends over all steps in the same direction.
    firsts = np.flatnonzero(np.diff(signs, prepend=2))
    spans: list[tuple[float, float, int, float]] = []
    stopped = 0.0
    for first, after in zip(firsts, [*firsts[1:], len(signs)]):
        # Movements by less than 2 mrad are rounding errors of a plan.
        if signs[first] == 0 or abs(position[after] - position[first]) < 2e-3:
            continue
        begin, end = float(times[first]), float(times[after])
        if first == 0 or signs[first - 1] == 0:
            # Not before the previous movement has stopped: until then, its direction remains.
            begin = max(stopped, begin - announcement)
        stopped = end
        if after == len(signs) or signs[after] == 0:
            end = _decelerates(times[first:after + 1], speed)
        spans.append((begin, end, int(signs[first]), float(position[after])))
    return spans


def _decelerates(times: np.ndarray, speed: Any) -> float:
    """Return when a movement through waypoints begins to decelerate to its final rest, s."""
    grid = np.unique(np.concatenate([
        np.linspace(begin, end, max(3, 400 // len(times)))
        for begin, end in zip(times, times[1:])]))
    # Backwards in time, the speed grows until there; a plan's samples make it uneven.
    speeds = np.abs(speed(grid))[::-1]
    falls = np.append(speeds < 0.97 * np.maximum.accumulate(speeds), True)
    return float(grid[::-1][np.argmax(speeds[:np.argmax(falls)])])


def teach(joints: Sequence[str], time: np.ndarray, position: np.ndarray
          ) -> tuple[dict[str, Any], float]:
    """Return the exercise file of a guided movement, and when in the recording it begins, s.

    Time is in s, (N,), position in rad, (N, J). Raises InputError if nothing moves.
    """
    # Imported only here, as in `ExerciseScript`.
    from scipy.signal import butter, sosfiltfilt

    if not time[-1] - time[0] > 2.0 * _REST:
        raise InputError(f'{time[-1] - time[0]:.2g} s are too short for an exercise')
    even = np.arange(time[0], time[-1], 1.0 / _RATE)
    raw = np.column_stack([np.interp(even, time, column) for column in position.T])
    # Voluntary movement has little above 4 Hz, tremor begins there.
    path = sosfiltfilt(butter(2, 4.0, fs=_RATE, output='sos'), raw, axis=0)
    shaped, keys = zip(*(_one_way(column) for column in path.T))
    shape = np.column_stack(shaped)
    # The smallest angle in the file is 0.01 degrees.
    shape = np.round((shape - shape[0]) / (0.01 * _DEGREE)) * 0.01 * _DEGREE
    if np.abs(shape).max() < _TURN:
        raise InputError(f'no joint moves by more than {_TURN / _DEGREE:.0f} degree')
    knots = _add_where_far(even, shape, sorted({0, len(even) - 1, *(k for own in keys
                                                                    for k in own)}))
    moving = np.flatnonzero(np.abs(np.diff(shape[knots], axis=0)).max(axis=1) > 0.0)
    # Without the time before the first movement and after the last one.
    knots = knots[moving[0]:moving[-1] + 2]
    steps: list[dict[str, Any]] = [{'hold': _FIRST_REST}]
    for before, after in zip(knots, knots[1:]):
        duration = round(float(even[after] - even[before]), 3)
        moved = shape[after] - shape[before]
        if not moved.any():
            steps.append({'hold': duration})
            continue
        steps.append({'to': {joint: round(float(shape[after, j] / _DEGREE), 2)
                             for j, joint in enumerate(joints) if moved[j] != 0.0},
                      'time': duration})
    steps.append({'hold': _FIRST_REST})
    return {'format': FORMAT, 'version': VERSION, 'unit': 'deg', 'joints': list(joints),
            'announcement': 1.0, 'steps': steps}, float(even[knots[0]]) - _FIRST_REST


def _one_way(path: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Return a path that moves one way between its reversals and rests, and their indices."""
    from scipy.signal import find_peaks

    # The extremes from which the path turns back by more than _TURN.
    keys = [int(k) for sign in (1.0, -1.0) for k in find_peaks(sign * path, prominence=_TURN)[0]]
    for begin, end in _rests(path):
        # A rest at a reversal stands in its place.
        keys = [k for k in keys if not begin < k < end] + [begin, end]
    keys = sorted({0, len(path) - 1, *keys})
    shaped = path.copy()
    for begin, end in _rests(path):
        shaped[begin:end + 1] = np.median(path[begin:end + 1])
    for first, last in zip(keys, keys[1:]):
        low, high = sorted((shaped[first], shaped[last]))
        part = np.clip(shaped[first:last + 1], low, high)
        up = shaped[last] >= shaped[first]
        shaped[first:last + 1] = (np.maximum if up else np.minimum).accumulate(part)
    return shaped, keys


def _rests(path: np.ndarray) -> list[tuple[int, int]]:
    """Return first and last index of each longest part that stays at a place."""
    rests, begin = [], 0
    while begin < len(path):
        inside = np.abs(path[begin:] - path[begin]) <= _PLACE
        end = begin + (int(np.argmin(inside)) if not inside.all() else len(inside)) - 1
        if end - begin >= _REST * _RATE:
            # From when the joint is at the place, to when it leaves.
            there = begin + np.flatnonzero(
                np.abs(path[begin:end + 1] - np.median(path[begin:end + 1])) <= _PLACE / 4.0)
            rests.append((int(there[0]), int(there[-1])))
            begin = end + 1
        else:
            begin += 1
    return rests


def _add_where_far(time: np.ndarray, shape: np.ndarray, knots: list[int]) -> np.ndarray:
    """Return `knots` and as many more as bring the curve near to `shape` everywhere."""
    from scipy.interpolate import PchipInterpolator

    while True:
        curve = PchipInterpolator(time[knots], shape[knots])(time)
        far = np.abs(curve - shape).max(axis=1)
        added = [begin + int(np.argmax(far[begin:end])) for begin, end in zip(knots, knots[1:])
                 if far[begin:end].max() > 0.5 * _TURN]
        if not added:
            return np.array(knots)
        knots = sorted({*knots, *added})
