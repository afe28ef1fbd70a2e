# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects of a simulated joint that its model file lacks, for tests of refinement.

Only the simulated plant knows them: refinement has to find them in recordings.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
import math
from pathlib import Path
from typing import Any

from numba import njit
import numpy as np

from friction_comp.errors import (
    check_document,
    check_list,
    check_mapping,
    check_number,
    errors_name,
    InputError,
)
from friction_comp.files import read_yaml

FORMAT = 'friction_comp_undeclared'
VERSION = 1
_KEYS = ('format', 'version', 'effects', 'thermal', 'notes')
COLUMNS = 10

(STRIBECK, VISCOUS_SHAPE, DIRECTION, OFFSET, GRAVITY, COGGING, FRICTION_RIPPLE, BUMP, LOAD,
 TEMPERATURE, WARM_UP, HYSTERESIS, REST, BACKLASH) = range(14)

Bounds = tuple[float | None, float, float]
"""Default of a parameter, None where it must be given; lowest and highest value."""


def _any(default: float | None = None) -> Bounds:
    return default, -math.inf, math.inf


def _positive(default: float | None = None) -> Bounds:
    return default, 1e-9, math.inf


_RIPPLE = {'amplitude': _any(), 'frequency': _positive(), 'phase': _any(0.0), 'slope': _any(0.0)}
# By name: code, and parameters in the order of the columns of `undeclared_torque`. Torques are in
# N·m at the joint, angles in rad, times in s, others as noted. `level` is that of friction.
EFFECTS: dict[str, tuple[int, dict[str, Bounds]]] = {
    # level + amplitude·exp(-(|v|/velocity)^exponent)
    'stribeck': (STRIBECK, {
        'amplitude': _any(), 'velocity': _positive(), 'exponent': (1.0, 0.1, 5.0)}),
    # level + amplitude·|v/velocity|^exponent; exponent below 1 sub-linear, above 1 super-linear
    'viscous_shape': (VISCOUS_SHAPE, {
        'amplitude': _any(), 'velocity': _positive(1.0), 'exponent': (None, 0.05, 5.0)}),
    # level ± (coulomb + viscous·|v|): plus in positive, minus in negative direction
    'direction': (DIRECTION, {'coulomb': _any(0.0), 'viscous': _any(0.0)}),
    # constant torque against which the motor has to work
    'offset': (OFFSET, {'torque': _any()}),
    # torque amplitude·sin(x + phase)
    'gravity': (GRAVITY, {'amplitude': _any(), 'phase': _any(0.0)}),
    # torque amplitude·(1 + slope·|v|)·sin(frequency·x + phase); frequency in periods per joint turn
    'cogging': (COGGING, _RIPPLE),
    # the same, added to the level of friction
    'friction_ripple': (FRICTION_RIPPLE, _RIPPLE),
    # level + amplitude·exp(-(x - position)²/(2·width²))
    'bump': (BUMP, {'amplitude': _any(), 'position': _any(), 'width': _positive()}),
    # level + coefficient·|load|
    'load': (LOAD, {'coefficient': _any()}),
    # level·(1 + coefficient·(temperature - reference)), coefficient 1/K
    'temperature': (TEMPERATURE, {'coefficient': _any(), 'reference': _any(25.0)}),
    # level·(1 + share·exp(-t/time_constant))
    'warm_up': (WARM_UP, {'share': _any(), 'time_constant': _positive()}),
    # a second Dahl element: torque z, dz/dx = stiffness·(1 - z·sgn(dx)/torque)
    'hysteresis': (HYSTERESIS, {'torque': _positive(), 'stiffness': _positive()}),
    # torque ±`torque` behind a backlash: none across the gap, rising with stiffness where it ends
    'backlash': (BACKLASH, {
        'torque': _positive(), 'gap': _positive(), 'stiffness': _positive()}),
    # level·(1 + share·s); s grows to 1 with the time at rest and decays with the distance slid
    'rest': (REST, {'share': _any(), 'time_constant': _positive(), 'distance': _positive(0.05)}),
}

# Effects of the joint itself rather than of its friction, stored as attributes of `Undeclared`.
JOINT_EFFECTS: dict[str, dict[str, Bounds]] = {
    'inertia': {'inertia': (None, 0.0, math.inf)},
    'actuation_lag': {'lag': (None, 0.0, 1.0)},
    'torque_constant': {'factor': (None, 0.1, 10.0)},
}
THERMAL: dict[str, Bounds] = {
    'ambient': (25.0, -273.15, math.inf), 'initial': (None, -273.15, math.inf),
    'heating': (0.0, 0.0, math.inf), 'time_constant': _positive(600.0)}

# Number of state variables of each effect that has any.
_MEMORY = {HYSTERESIS: 3, REST: 4, BACKLASH: 2}


@dataclass
class Undeclared:
    """Undeclared effects of one joint."""

    # Rows: code, up to eight parameters, and the index of the row's first state variable.
    table: np.ndarray = field(default_factory=lambda: np.zeros((0, COLUMNS)))
    memory_size: int = 0        # number of state variables of the effects; they start at zero
    inertia: float = 0.0        # kg·m², added to the joint's own
    actuation_lag: float = 0.0  # s, of a first-order lag between current and torque
    torque_constant_factor: float = 1.0     # true torque constant / declared one
    # For `warmed_up`: ambient and initial temperature, degrees Celsius, heating, K/A², and time
    # constant, s.
    thermal: np.ndarray = field(default_factory=lambda: np.array([25.0, 25.0, 0.0, 600.0]))

    @classmethod
    def from_effects(cls, effects: Iterable[Any], thermal: Any = None) -> Undeclared:
        """Create from dicts with `name` and `parameters`, and a dict like `THERMAL`."""
        rows, result = [], cls()
        for entry in effects:
            if not isinstance(entry, dict) or 'name' not in entry:
                raise InputError(f'an undeclared effect needs a name: {entry!r}')
            name = str(entry['name'])
            where = f"undeclared effect '{name}'"
            check_mapping(entry, where, ('name', 'parameters'))
            given = entry.get('parameters') or {}
            if name in EFFECTS:
                code, wanted = EFFECTS[name]
                row = np.zeros(COLUMNS)
                values = list(_read(given, wanted, where).values())
                row[0], row[1:1 + len(values)], row[-1] = code, values, result.memory_size
                result.memory_size += _MEMORY.get(code, 0)
                rows.append(row)
            elif name in JOINT_EFFECTS:
                own = _read(given, JOINT_EFFECTS[name], where)
                result.inertia += own.get('inertia', 0.0)
                result.actuation_lag += own.get('lag', 0.0)
                result.torque_constant_factor *= own.get('factor', 1.0)
            else:
                raise InputError(
                    f"unknown {where}; known: {', '.join([*EFFECTS, *JOINT_EFFECTS])}")
        if rows:
            result.table = np.array(rows)
        if thermal is not None:
            ambient = check_mapping(thermal, 'thermal').get('ambient', THERMAL['ambient'][0])
            constants = _read({'initial': ambient, **thermal}, THERMAL, 'thermal')
            result.thermal = np.array(list(constants.values()))
        return result

    @classmethod
    def from_file(cls, path: str | Path) -> Undeclared:
        """Create from a YAML file."""
        content = read_yaml(path)
        with errors_name(path):
            document = check_document(
                content, 'a file of undeclared effects', FORMAT, VERSION, _KEYS)
            return cls.from_effects(
                check_list(document.get('effects'), 'effects'), document.get('thermal'))


def _read(given: Any, wanted: dict[str, Bounds], where: str) -> dict[str, float]:
    check_mapping(given, where, wanted)
    values = {}
    for name, (default, lowest, highest) in wanted.items():
        value = given.get(name, default)
        if value is None:
            raise InputError(f'{where} needs {name}')
        values[name] = check_number(value, f'{where}: {name}', least=lowest, most=highest)
    return values


@njit(cache=True)
def undeclared_torque(table: np.ndarray, memory: np.ndarray, t: float, x: float, v: float,
                      load: float, temperature: float, rest_time: float, base_level: float
                      ) -> tuple[float, float]:
    """Return the driving torque and the level of friction that undeclared effects add, N·m.

    Must be called in time order, with a `memory` of the run's own that begins as zeros. `t`, `x`
    and `v` are in s, rad and rad/s; the person applies `load` N·m; the joint has been sticking for
    `rest_time` s; the declared friction at this velocity is `base_level` N·m.
    """
    resisting = 0.0
    level = 0.0
    speed = abs(v)
    sign = 1.0 if v > 0 else (-1.0 if v < 0 else 0.0)
    for k in range(table.shape[0]):
        code = int(table[k, 0])
        a, b, c, d = table[k, 1], table[k, 2], table[k, 3], table[k, 4]
        m = int(table[k, 9])
        if code == STRIBECK:
            level += a * math.exp(-(speed / b) ** c)
        elif code == VISCOUS_SHAPE:
            level += a * (speed / b) ** c
        elif code == DIRECTION:
            level += sign * (a + b * speed)
        elif code == OFFSET:
            resisting += a
        elif code == GRAVITY:
            resisting += a * math.sin(x + b)
        elif code == COGGING:
            resisting += a * max(0.0, 1.0 + d * speed) * math.sin(b * x + c)
        elif code == FRICTION_RIPPLE:
            level += a * max(0.0, 1.0 + d * speed) * math.sin(b * x + c)
        elif code == BUMP:
            level += a * math.exp(-0.5 * ((x - b) / c) ** 2)
        elif code == LOAD:
            level += a * abs(load)
        elif code == TEMPERATURE:
            level += base_level * a * (temperature - b)
        elif code == WARM_UP:
            level += base_level * a * math.exp(-t / b)
        elif code == HYSTERESIS:
            # Dahl's equation is exact over a monotone step dx: z tends to ±torque exponentially.
            if memory[m + 2] == 0.0:
                memory[m] = x
                memory[m + 2] = 1.0
            step = x - memory[m]
            memory[m] = x
            if step != 0.0:
                goal = a if step > 0 else -a
                memory[m + 1] = goal + (memory[m + 1] - goal) * math.exp(-abs(step) * b / a)
            resisting += memory[m + 1]
        elif code == REST:
            # memory: s now, s when the rest began, last position, whether it is initialised
            if memory[m + 3] == 0.0:
                memory[m + 2] = x
                memory[m + 3] = 1.0
            if rest_time > 0.0:
                memory[m] = 1.0 - (1.0 - memory[m + 1]) * math.exp(-rest_time / b)
            else:
                memory[m] *= math.exp(-abs(x - memory[m + 2]) / c)
                memory[m + 1] = memory[m]
            memory[m + 2] = x
            level += base_level * a * memory[m]
        elif code == BACKLASH:
            # memory: where the friction's body is, whether it is initialised; first in its middle
            if memory[m + 1] == 0.0:
                memory[m] = x
                memory[m + 1] = 1.0
            reach = 0.5 * b + a / c
            memory[m] = min(x + reach, max(x - reach, memory[m]))
            away = x - memory[m]
            resisting += math.copysign(c * max(0.0, abs(away) - 0.5 * b), away)
    return -resisting, level


@njit(cache=True)
def warmed_up(temperature: float, current: float, step: float, thermal: np.ndarray) -> float:
    """Return the motor temperature, °C, after a time step, s, at a current, A; of first order."""
    goal = thermal[0] + thermal[2] * current * current
    return goal + (temperature - goal) * math.exp(-step / thermal[3])
