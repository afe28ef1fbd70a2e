# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The one shape of an effect."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
import math

import numpy as np

from friction_comp.errors import InputError

VARIABLES = (
    'velocity', 'direction', 'position', 'acceleration', 'load', 'temperature', 'time', 'history')

SHARPEST_ONLINE = 0.01


@dataclass(frozen=True)
class Scene:
    """What a set of recordings covers: the frame within which constants are searched.

    Parameters
    ----------
    transition : float
        Velocity in rad/s over which friction changes sign: tanh(v/transition).
    speed : float
        95th percentile of the speed while moving, rad/s.
    slowest : float
        Speed in rad/s below which samples count as standstill.
    lowest, highest : float
        Range of position in rad (1st to 99th percentile).
    duration : float
        Length of the longest recording in s.
    sample_time : float
        Of the recordings, s.
    temperature : float
        Median temperature in degrees Celsius.
    gear_ratio : float
        n; a hint for spatial frequencies.
    resolution : float
        Smallest step of the recorded position in rad.
    both_directions : bool
        Whether there is motion in both directions.
    """

    transition: float
    speed: float
    slowest: float
    lowest: float
    highest: float
    duration: float
    sample_time: float
    temperature: float = 25.0
    gear_ratio: float = 1.0
    resolution: float = 0.0
    both_directions: bool = True


class Effect(ABC):
    """One term of the drive's current, in A: coefficients times columns of a design matrix.

    Subclasses set the class attributes and write `columns` and `grid`.

    Parameters
    ----------
    parameters : dict
        ``coefficients`` (A, one per column) and the nonlinear constants, plain numbers in SI units.

    Attributes
    ----------
    name : str
        The word in model files and reports.
    variable : str
        What the effect depends on, one of `VARIABLES`.
    needs : tuple of str
        Signals of `Samples` beyond position and velocity it cannot do without.
    constants : dict
        Name of every nonlinear constant and how refinement searches around a grid point: the
        half width of the bracket as a factor ('log', width), as a difference ('linear', width in
        units of the constant `scale_of` returns), or None where it is not searched.
    repeatable : bool
        Whether a model may have it several times, with other constants.
    """

    name = ''
    variable = ''
    needs = ()
    constants = {}
    repeatable = False

    def __init__(self, parameters):
        parameters = dict(parameters)
        coefficients = parameters.pop('coefficients', None)
        if coefficients is None:
            raise InputError('coefficients are missing')
        if not isinstance(coefficients, (list, tuple, np.ndarray)):
            raise InputError('coefficients must be a list of numbers')
        self.coefficients = [_finite('coefficients', value) for value in coefficients]
        unknown = set(parameters) - set(self.constants)
        if unknown:
            raise InputError(f'unknown parameters: {sorted(map(str, unknown))}')
        missing = set(self.constants) - set(parameters)
        if missing:
            raise InputError(f'missing parameters: {sorted(missing)}')
        self.values = {name: _finite(name, parameters[name]) for name in self.constants}
        self.check(self.values)

    @property
    def parameters(self):
        """Constants and coefficients as plain values."""
        return {**self.values, 'coefficients': list(self.coefficients)}

    @classmethod
    def check(cls, values):
        """Raise `InputError` where constants make no sense."""
        for name, value in values.items():
            if name in _POSITIVE and value <= 0:
                raise InputError(f'{name} must be positive, not {value!r}')

    @classmethod
    @abstractmethod
    def grid(cls, scene):
        """Return the constants worth trying in a scene: a list of dicts."""

    @classmethod
    @abstractmethod
    def columns(cls, samples, **constants):
        """Return the design matrix, shape (N, M), for `Samples` with velocity."""

    def current(self, samples):
        """Return the effect's current in A, shape (N,)."""
        for signal in self.needs:
            if getattr(samples, signal) is None:
                raise InputError(f"effect '{self.name}' needs {signal}, which is not recorded")
        matrix = self.columns(samples, **self.values)
        if matrix.shape[1] != len(self.coefficients):
            raise InputError(f"effect '{self.name}' takes {matrix.shape[1]} coefficients, "
                             f'not {len(self.coefficients)}')
        return matrix @ np.asarray(self.coefficients)

    def online(self):
        """Return a fresh `OnlineTerm` for the compensator, or None where it cannot be fed back."""
        return None

    def why_left_out(self):
        """Return why the compensator cannot apply the effect; empty where it can."""
        return '' if self.online() is not None else 'cannot be computed from the live signals'

    def describe(self):
        """Return the effect in words, one sentence."""
        return f'{self.name} ({self.variable})'

    def formula(self):
        """Return the effect's formula with its numbers, in A."""
        return self.name

    def to_dict(self):
        """Return the model file's entry."""
        return {'name': self.name, 'variable': self.variable, 'parameters': self.parameters}


class OnlineTerm(ABC):
    """An effect as the compensator evaluates it, one sample at a time.

    `needs` names the live signals beyond position and velocity that it cannot do without:
    any of 'temperature', 'load'.
    """

    needs = ()

    @abstractmethod
    def update(self, time, position, velocity, temperature=None, load=None):
        """Return the current in A for this sample; s, rad, rad/s, degrees Celsius, N·m."""

    def reset(self):
        """Forget all history."""


class StaticTerm(OnlineTerm):
    """An online term that is a plain function of the latest sample.

    Parameters
    ----------
    function : callable
        ``function(time, position, velocity, temperature, load)`` in A.
    needs : tuple of str
    """

    def __init__(self, function, needs=()):
        self._function = function
        self.needs = needs

    def update(self, time, position, velocity, temperature=None, load=None):
        """Return the current in A for this sample."""
        return self._function(time, position, velocity, temperature, load)


def gentle(transition):
    """Return the velocity over which a term that is fed back may change sign, in rad/s.

    A recording may show that friction turns round within a thousandth of a radian a second. Fed
    back as sharply, every count of the encoder would set off the whole term.
    """
    return max(transition, SHARPEST_ONLINE)


def sign(velocity, transition):
    """Return the sign of friction, which passes through zero smoothly as Eq. 6 does."""
    return np.tanh(velocity / transition)


def geometric(lowest, highest, number):
    """Return numbers that grow by a constant factor."""
    return [float(value) for value in np.geomspace(lowest, highest, number)]


def _finite(name, value):
    if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
        raise InputError(f'{name} must be numbers, not {value!r}')
    if not math.isfinite(value):
        raise InputError(f'{name} must be finite, not {value!r}')
    return float(value)


_POSITIVE = (
    'transition', 'velocity', 'reference', 'exponent', 'frequency', 'width', 'distance',
    'time_constant', 'speed')
