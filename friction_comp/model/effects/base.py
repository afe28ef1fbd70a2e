# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The one shape of an effect."""

from __future__ import annotations

from abc import ABC, abstractmethod

VARIABLES = (
    'velocity', 'direction', 'position', 'acceleration', 'load', 'temperature', 'time', 'history')


class Effect(ABC):
    """One term of the drive's current, in A.

    Subclasses set `name` (the word in model files and reports) and `variable` (what the effect
    depends on, one of `VARIABLES`).

    Parameters
    ----------
    parameters : dict
        Everything the formula needs, as plain numbers or lists of numbers in SI units.
    """

    name = ''
    variable = ''

    def __init__(self, parameters):
        self.parameters = dict(parameters)

    @abstractmethod
    def current(self, samples):
        """Return the effect's current in A, shape (N,), for `Samples` with velocity."""

    def online(self):
        """Return a fresh `OnlineTerm` for the compensator, or None where it cannot be fed back."""
        return None

    def why_left_out(self):
        """Return why the compensator cannot apply the effect; empty where it can."""
        return '' if self.online() is not None else 'cannot be computed from the live signals'

    def describe(self):
        """Return the effect in words, one sentence."""
        return f'{self.name} ({self.variable})'

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
