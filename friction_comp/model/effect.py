# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What effects are: signals and coverage that define them, their base class, and one that is live.

Everything specific to an effect is in its own class.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import namedtuple
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
import math
import re
from typing import Any, NamedTuple

import numpy as np

from friction_comp.errors import check_interval, InputError, listed, mapping, number
from friction_comp.samples import Samples

RESISTS, CARRIES, NEITHER = 'resists', 'carries', 'neither'
"""Roles of an effect: it dissipates energy, as friction; it is a torque that does not depend on the
direction of motion, as gravity; or it is not a torque."""


class Signals(NamedTuple):
    """The signals that a formula may use: arrays over samples, or one sample's numbers."""

    time: Any = 0.0           # s since the recording began, or since the compensator did
    position: Any = 0.0       # rad
    velocity: Any = 0.0       # rad/s
    acceleration: Any = 0.0   # rad/s²
    load: Any = 0.0           # back-driving torque, N·m
    temperature: Any = 0.0    # degrees Celsius
    sign: Any = 0.0           # sign of friction, -1..1, which passes through zero smoothly
    memory: Any = 0.0         # state of an effect that has one
    rigid_body: Any = 0.0     # torque that the joint supplies for the links of the arm, N·m
    coupling: Any = 0.0       # current that the motor needs because of other joints, A


@dataclass(frozen=True)
class Coverage:
    """The ranges that a set of recordings covers, within which constants are searched."""

    transition: float         # rad/s over which friction changes sign: tanh(v/transition)
    speed: float              # 95th percentile of the speed while moving, rad/s
    slowest: float            # rad/s below which samples count as standstill
    lowest: float             # ends of the range of position, 1st and 99th percentile, rad
    highest: float
    duration: float           # of the longest recording, s
    temperature: float = 25.0         # median, degrees Celsius
    resolution: float = 0.0           # smallest step of the recorded position, rad
    both_directions: bool = True      # whether there is motion in both
    passed_again: float = 1.0         # share of the motion at places that were passed twice or more
    slow: float = 0.0                 # 5th percentile of the speed while moving, rad/s
    reversals: float = math.inf       # of the direction of motion
    rest_duration: float = math.inf          # how long the joint stood still, s
    distinct_positions: float = math.inf       # distinct positions that the encoder gave
    temperature_span: float = math.inf        # range of the motor temperature, K
    # Standard deviation of the speed while moving as a share of its mean.
    speed_spread: float = math.inf
    linear: bool = False              # whether positions are in m

    @property
    def span(self) -> float:
        """Width of the range of position in rad, never zero: constants are shares of it."""
        return max(self.highest - self.lowest, 1e-9)


@dataclass(frozen=True)
class ResidualView:
    """A residual from which effects propose constants: arrays of shape (R,)."""

    coverage: Coverage
    position: Any                     # rad
    velocity: Any                     # rad/s
    sign: Any                         # sign of friction, -1..1
    residual: Any                     # A
    sample_time: float                # s
    # Loads of the terms of the fit, see `Effect.load_share`.
    load_shares: list[dict[str, float]]


@dataclass(frozen=True)
class SearchRange:
    """How a constant is searched around an initial value."""

    # Half width of the bracket: a factor, or a number of units if `unit` is given.
    width: float
    # Size of one unit, for constants searched on a linear scale; without it, it is logarithmic.
    unit: Callable[[Coverage, dict[str, float]], float] | None = None
    # Lowest and highest value; beyond them the effect is another one.
    limits: Callable[[Coverage, dict[str, float]], tuple[float, float]] = lambda *_: (
        -math.inf, math.inf)


Tried = Sequence[float] | np.ndarray | Callable[[Coverage], Sequence[float] | np.ndarray]
"""Values of a constant that a search tries, or how they follow from what is covered."""


def turns_seldom(coverage: Coverage) -> bool:
    """Return whether the joint stays within two turns: something can happen at one position."""
    return coverage.span <= 4.0 * math.pi


def too_coarse(coverage: Coverage) -> bool:
    """Return whether the encoder gave too few positions to see lag, presliding and the like."""
    # With fewer, a hundredth of the range is a step or two.
    return coverage.distinct_positions < 150


_POSITIVE = ('transition', 'velocity', 'reference', 'exponent', 'frequency', 'width', 'distance',
             'gap', 'time_constant', 'speed')
# Parts of the load that effects put on the gear, constants of those that use it.
LOADS = ('cosine', 'sine', 'slope', 'offset', 'inertia')
# Signals of which a recording has a range.
_VALUES = ('position', 'acceleration', 'load', 'temperature', 'rigid_body', 'coupling')


class Effect(ABC):
    """One term of the drive's current, in A: coefficients times columns.

    A subclass sets the class attributes, implements `columns` (its formula for arrays and single
    samples) and `grid`, and overrides other defaults as needed. `parameters` has the
    ``coefficients`` (A, one per column) and the nonlinear constants, plain numbers in SI units;
    `valid_range` the lowest and highest value of signals in `range_margins`, beyond which it is
    constant.
    """

    name = ''           # in model files and reports
    # What it depends on: velocity, direction, position, acceleration, load, temperature, time,
    # history, or other joints.
    variable = ''
    role = RESISTS      # or CARRIES, or NEITHER
    # Signals of `Samples` that it needs besides position and velocity.
    needs: tuple[str, ...] = ()
    # Every nonlinear constant, and how it is searched; None if it is not. `transition`, over which
    # friction changes sign, rad/s, is common to all effects of a fit.
    constants: dict[str, SearchRange | None] = {}
    # Values of constants, of which a search tries all combinations.
    tried: dict[str, Tried] = {}
    # Whether recordings can show it.
    shown_by: tuple[Callable[[Coverage], bool], ...] = ()
    units: tuple[str, ...] = ()     # of each coefficient; A stands for that of the recording
    # One sentence, its term of the model's formula in A, and what moves the state in that term, for
    # `str.format` with `symbols`.
    summary = equation = state_equation = ''
    factors: dict[str, str] = {}    # of the term, by the constant that is zero without it
    # Physically possible sign of the first coefficients: 1, -1, or 0 for either.
    signs: tuple[int, ...] = ()
    # Effect of which it is another form: a model has one of them at most.
    form_of: type[Effect] | None = None
    max_count = 1       # of effects of the class in a model, with different constants
    # Whether every drive may have it: refinement then starts with it.
    in_first_model = False
    holds_on_another_day = True     # whether it is expected in other recordings of the drive
    fades_in_sliding = False    # whether it vanishes while the joint slides on, or faster
    has_memory = False      # whether it has a `step`: a sample's value depends on earlier ones
    not_fed_back = ''   # why the compensator must not apply it; empty if it may
    live: dict[str, float] = {}     # constants that differ as the compensator applies it
    # Whether it is fed back only in motion: at rest it would move an untouched joint.
    fed_back_in_motion = False
    is_load = False     # whether it is the measured load, with a coefficient of -1/(k_t·n)
    weight = False      # whether it supports the limb, which the robot's controller may already do
    # Which of `LOADS` its coefficients are; of one that loads the teeth at rest, the span in rad
    # below which the offset of Eq. 6 is part of that load.
    loads: tuple[str, ...] = ()
    offset_within: float | None = None
    uses_inner_load = False     # whether its constants are the load of other effects, `LOADS`
    # Signals beyond whose recorded range, and this share of it on either side, it is constant; inf
    # for one that is limited only where the effect may be another one, see `with_range`.
    range_margins: dict[str, float] = {}
    Constants: Any

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.has_memory = cls.step is not Effect.step
        cls.uses_inner_load = {*LOADS} <= {*cls.constants}
        # Compiled code also reads constants by name, and finds the type by this path.
        cls.Constants = namedtuple('Constants', tuple(cls.constants))  # type: ignore[misc]
        cls.Constants.__module__ = cls.__module__
        cls.Constants.__qualname__ = f'{cls.__qualname__}.Constants'

    def __init__(self, parameters: dict[str, Any],
                 valid_range: dict[str, Any] | None = None) -> None:
        self.valid_range = mapping(check_interval, self.range_margins)(valid_range, 'valid_range')
        own = {name: number(above=0.0) if name in _POSITIVE else number()
               for name in self.constants}
        known = mapping({**own, 'coefficients': listed(number())})(parameters, 'parameters')
        missing = [name for name in ('coefficients', *own) if known.get(name) is None]
        if missing:
            raise InputError(f'parameters: {", ".join(missing)} missing')
        self.coefficients = list(known['coefficients'])
        self.values = {name: known[name] for name in self.constants}

    @property
    def parameters(self) -> dict[str, Any]:
        """Constants and coefficients as plain values."""
        return {**self.values, 'coefficients': list(self.coefficients)}

    # To be overridden.

    @staticmethod
    @abstractmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return the columns, of the shape of the signals.

        Use only arithmetic, `abs` and numpy's elementwise functions, since it is run with arrays,
        with single numbers and in compiled code. `c` has the constants by name.
        """

    @classmethod
    def grid(cls, coverage: Coverage) -> list[dict[str, float]]:
        """Return the constants to try on recordings with this coverage, without `transition`."""
        values = (np.asarray(of(coverage) if callable(of) else of).tolist()
                  for of in cls.tried.values())
        return [dict(zip(cls.tried, combination)) for combination in product(*values)]

    @classmethod
    def propose(cls, view: ResidualView) -> list[dict[str, float]]:
        """Return the constants to try for a residual; by default those of `grid`."""
        return [cls.with_loads(constants, view.load_shares)
                for constants in cls.points(view.coverage)]

    @classmethod
    def signs_with(cls, constants: dict[str, float]) -> tuple[int, ...]:
        """Return the physically possible sign of the first coefficients; by default `signs`."""
        return cls.signs

    @classmethod
    def can_show(cls, coverage: Coverage) -> bool:
        """Return whether recordings with this coverage can show it."""
        return all(shows(coverage) for shows in cls.shown_by)

    @classmethod
    def load_share(cls, coefficients: Sequence[float], constants: dict[str, float]
                   ) -> dict[str, float]:
        """Return its share of the load on the teeth, by `LOADS`."""
        return dict(zip(cls.loads, coefficients))

    @classmethod
    def with_loads(cls, constants: dict[str, Any],
                   shares: Sequence[dict[str, float]]) -> dict[str, Any]:
        """Return the constants with the loads of other effects, if it `uses_inner_load`."""
        return constants if not cls.uses_inner_load else {**constants, **{
            name: float(sum(share.get(name, 0.0) for share in shares)) for name in LOADS}}

    @staticmethod
    def step(state: float, dt: float, dq: float, velocity: float, c: Any) -> float:
        """Return the state one sample later, for effects with `has_memory`, by plain arithmetic.

        It is also compiled, for long recordings. `dt` (s) and `dq` (rad) are the changes since the
        previous sample, `velocity` is the present one, rad/s.
        """
        return state

    @staticmethod
    def start(sign: Any, c: Any) -> Any:
        """Return the state at the start of a segment."""
        return 0.0 * sign

    @classmethod
    def memory(cls, samples: Samples, sign: Any, c: Any) -> Any:
        """Return the state at every sample, shape (N,), by `step` within each segment."""
        if not cls.has_memory:
            return 0.0
        begins, start = segment_starts(samples), cls.start(sign + np.zeros(len(samples)), c)
        time, position, velocity = (np.ascontiguousarray(values, dtype=float) for values in (
            samples.time, samples.position, samples.velocity))
        # Up to so many samples, states are computed without a compiler.
        if len(samples) > 4000:
            from friction_comp.model.compiled import all_states, KINDS, Memory

            if cls.name in KINDS:
                own = {name: getattr(c, name) for name in Memory._fields if hasattr(c, name)}
                return np.asarray(all_states(KINDS.index(cls.name), time, position, velocity,
                                             begins, np.asarray(start, float), Memory(**own)))
        changes = zip(np.diff(time, prepend=0.0).tolist(), np.diff(position, prepend=0.0).tolist(),
                      velocity.tolist(), begins.tolist(), start.tolist(), strict=True)
        states, state = [], 0.0
        for dt, dq, speed, is_first, first in changes:
            state = first if is_first else cls.step(state, dt, dq, speed, c)
            states.append(state)
        return np.array(states)

    def dahl_friction(self) -> tuple[float, float] | None:
        """Return the friction that reverses as in Dahl's model, A, and its distance; or None."""
        return None

    def doubt(self) -> str:
        """Return why no drive may have the effect with these coefficients; empty if one may."""
        return ''

    def symbols(self) -> dict[str, Any]:
        """Return the values that its texts name: coefficients {A}, {B}, … and constants.

        Of two coefficients, {size} and {angle} (degrees) are those of their wave.
        """
        a, b = (*self.coefficients, 0.0, 0.0)[:2]
        return {**self.values, **dict(zip('ABCDEFGH', self.coefficients)),
                'size': math.hypot(a, b), 'angle': math.degrees(math.atan2(b, a))}

    def describe(self) -> str:
        """Return a description of the effect, one sentence."""
        return self.summary.format(**self.symbols()) or f'{self.name} ({self.variable})'

    def formula(self) -> str:
        """Return the effect's term with its numbers, in A; see `friction_numbers.formula_of`."""
        factors = ''.join(text for name, text in self.factors.items() if self.values[name])
        text = (self.equation + factors).format(**self.symbols()).replace('- -', '+ ')
        # Without the parts of a load that are zero.
        return re.sub(r' ?[+-]0(?![.\d])(·[\w/()]+)?(?=[ |])', '', text) or self.name

    def state_formula(self) -> str:
        """Return what moves the state that its term names, with its numbers; '' without one."""
        return self.state_equation.format(**self.symbols())

    # Not to be overridden.

    @classmethod
    def points(cls, coverage: Coverage) -> list[dict[str, float]]:
        """Return the points of `grid`, with the transition that all effects of a fit share."""
        common = {'transition': coverage.transition} if 'transition' in cls.constants else {}
        return [{**point, **common} for point in cls.grid(coverage)]

    @classmethod
    def matrix(cls, samples: Samples, constants: dict[str, float], sliding: bool = False
               ) -> np.ndarray:
        """Return the design matrix, shape (N, M), for `Samples` with velocity.

        If `sliding`, samples do not follow each other, and a memory is that of steady sliding.
        """
        c = cls.Constants(**constants)
        sign: Any = 0.0
        if 'transition' in constants:
            sign = np.tanh(np.asarray(samples.velocity) / c.transition)
        memory = cls.start(sign, c) if sliding and cls.has_memory else cls.memory(samples, sign, c)
        x = Signals(samples.time, samples.position, samples.velocity, samples.acceleration,
                    samples.load, samples.temperature, sign, memory, samples.rigid_body,
                    samples.coupling)
        columns = cls.columns(x, c)
        # Each column contiguous in memory, as solvers of coefficients need it.
        result = np.empty((len(columns), len(samples)))
        for index, column in enumerate(columns):
            result[index] = column
        return result.T

    def reads(self) -> set[str]:
        """Return the signals beside velocity and time of which its value depends on the value."""
        c, start = self.Constants(**self.values), {'velocity': 1.0, 'sign': 1.0}
        start['memory'] = self.start(1.0, c) if self.has_memory else 0.0
        # A NaN in gives a NaN out where the value depends on the signal.
        with np.errstate(invalid='ignore'):
            return {name for name in _VALUES if any(map(
                np.isnan, self.columns(Signals(**{**start, name: math.nan}), c)))}

    @classmethod
    def check_signals(cls, samples: Samples) -> None:
        """Raise InputError if the effect needs a signal that the samples lack."""
        for signal in cls.needs:
            if getattr(samples, signal) is None:
                raise InputError(f"effect '{cls.name}' needs {signal}, which is not recorded")

    def current(self, samples: Samples, sliding: bool = False) -> np.ndarray:
        """Return the effect's current in A, shape (N,); `sliding` as of `matrix`."""
        self.check_signals(samples)
        within = {name: np.clip(getattr(samples, name), *ends)
                  for name, ends in self.valid_range.items() if getattr(samples, name) is not None}
        matrix = self.matrix(samples.with_(**within), self.values, sliding)
        if matrix.shape[1] != len(self.coefficients):
            raise InputError(f"effect '{self.name}' takes {matrix.shape[1]} coefficients, "
                             f'not {len(self.coefficients)}')
        return matrix @ np.asarray(self.coefficients)

    def to_dict(self) -> dict[str, Any]:
        """Return the model file's entry."""
        entry = {'name': self.name, 'variable': self.variable, 'parameters': self.parameters}
        if self.valid_range:
            entry['valid_range'] = {name: list(ends) for name, ends in self.valid_range.items()}
        return entry


def segment_starts(samples: Samples) -> np.ndarray:
    """Return which samples are the first of a segment, bool, shape (N,)."""
    starts = np.zeros(len(samples), dtype=bool)
    starts[[part.start for part in samples.segments()]] = True
    return starts


def with_range(effect: Effect, samples: Samples) -> Effect:
    """Return the effect with a valid range: that of these samples, plus `range_margins`."""
    ranges = {}
    for name, beyond in effect.range_margins.items():
        values = getattr(samples, name)
        if values is not None and len(values) and math.isfinite(beyond):
            # A few outliers are sensor errors.
            low, high = np.percentile(values, (0.1, 99.9))
            more = beyond * (high - low)
            ranges[name] = (float(low - more), float(high + more))
    return type(effect)(effect.parameters, ranges)


SHARPEST_LIVE = 0.01
"""Smallest velocity in rad/s over which a term that is fed back changes sign. A recording may show
a thousandth, but then every encoder count would switch the whole term."""


class LiveTerm:
    """An effect as the compensator evaluates it, one sample at a time, in order of time."""

    def __init__(self, effect: Effect) -> None:
        values = {**effect.values, **effect.live}
        self._transition = None
        if 'transition' in values:
            self._transition = values['transition'] = max(values['transition'], SHARPEST_LIVE)
        self._effect, self._constants = effect, effect.Constants(**values)
        self.needs, self.has_memory = effect.needs, effect.has_memory
        self.reset()

    def reset(self) -> None:
        """Forget the motion."""
        self._state: float | None = None
        self._time = self._position = 0.0

    def update(self, time: float, position: float, velocity: float, **signals: float | None
               ) -> float:
        """Return the current in A for this sample; signals and units as of `_at`, arm at rest."""
        sign = math.tanh(velocity / self._transition) if self._transition else 0.0
        state = self._remember(time, position, velocity)
        value = self._at(position, velocity, sign, state, **signals)
        if self._effect.fed_back_in_motion:
            value *= abs(math.tanh(velocity / SHARPEST_LIVE))
        return value

    def both_sides(self, time: float, position: float, speed: float, **signals: float | None
                   ) -> tuple[float, float]:
        """Return the current in A in the positive and in the negative direction; see `update`.

        As after sliding far enough to complete the reversal, which the caller models.
        """
        state = self._remember(time, position, speed)
        values = []
        for sign in (1.0, -1.0):
            turned = float(self._effect.start(sign, self._constants))
            values.append(self._at(position, sign * abs(speed), sign,
                                   turned if turned != 0.0 else state, **signals))
        return values[0], values[1]

    def _at(self, position: float, velocity: float, sign: float, memory: float,
            temperature: float | None = None, load: float | None = None,
            rigid_body: float | None = None, coupling: float | None = None) -> float:
        # By position, in the order of the fields: arguments by name take twice as long.
        x = Signals(0.0, position, velocity, 0.0, load, temperature, sign, memory, rigid_body,
                    coupling)
        for name, (low, high) in self._effect.valid_range.items():
            value = getattr(x, name)
            # Rarely, since replacing takes longer than evaluating an effect.
            if value is not None and not low <= value <= high:
                x = x._replace(**{name: min(max(value, low), high)})
        return float(sum(gain * column for gain, column in zip(
            self._effect.coefficients, self._effect.columns(x, self._constants))))

    def _remember(self, time: float, position: float, velocity: float) -> float:
        if not self.has_memory:
            return 0.0
        if self._state is None:
            self._state = float(self._effect.start(0.0, self._constants))
        else:
            self._state = self._effect.step(
                self._state, max(0.0, time - self._time), position - self._position, velocity,
                self._constants)
        self._time, self._position = time, position
        return self._state
