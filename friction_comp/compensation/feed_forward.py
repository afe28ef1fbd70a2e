# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the motor gets with a model: the law is run on it, at rest and in steady sliding.

Two models, or a model and the breakaway currents of identification, are compared by what reaches
the motor, not by their terms: the same friction may be written in several ways.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from friction_comp.compensation.law import CompensationLaw
from friction_comp.compensation.law_parameters import DEFAULT_FASTEST, SHARE
from friction_comp.model.effects.base import RESISTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.samples import Samples

# s: sample time, at rest, from standstill to speed, and at speed.
_STEP, _REST, _START, _STEADY = 0.005, 0.6, 0.4, 0.6
# Share of the fastest identified speed.
_SPEED = 0.5
CHANGED = 1.0 - SHARE
"""Relative change that is told with a warning: the margin that the law leaves for model errors."""


class FeedForward(NamedTuple):
    """Currents in the positive and the negative direction, A; magnitudes."""

    rest: np.ndarray        # at rest, with the direction announced
    sliding: np.ndarray     # sliding at `speed`
    friction: np.ndarray    # what the model predicts there
    speed: float            # rad/s

    def compared(self, other: FeedForward) -> list[str]:
        """Return what feeds forward clearly more or less than in another model, as text."""
        return [
            f'{place}, {self_value:.3g} A instead of {other_value:.3g} A'
            for place, mine, others in (('at rest', self.rest, other.rest),
                                        ('sliding', self.sliding, other.sliding))
            for self_value, other_value in [_most_different(mine, others)]
            if abs(self_value - other_value) > CHANGED * max(self_value, other_value)]

    def lacking(self, model: FrictionModel) -> list[str]:
        """Return where the law feeds forward clearly less or more than the model says, as text.

        At rest that is the gain times breakaway, in sliding the law's share of friction.
        """
        said = [('sliding', *_most_different(self.sliding, SHARE * self.friction))]
        if model.breakaway is not None:
            both = np.array([model.breakaway.positive_mean, -model.breakaway.negative_mean])
            said.append(('at rest', *_most_different(self.rest, SHARE * both)))
        return [f'{place}, {given:.3g} A of {wanted / SHARE:.3g} A'
                for place, given, wanted in said
                if abs(given - wanted) > CHANGED * max(given, wanted)]


def _most_different(one: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    side = int(np.abs(one - other).argmax())
    return float(one[side]), float(other[side])


def feed_forward(model: FrictionModel) -> FeedForward:
    """Return what the continuous law feeds forward of a model's friction.

    Without effects that carry, and without those whose signals a joint alone does not have.
    """
    bare = replace(model, arm=None, position_limits=None, effects=[
        effect for effect in model.effects
        if effect.role == RESISTS and not effect.needs and not effect.not_fed_back])
    speed = _SPEED * model.largest_speed(DEFAULT_FASTEST)
    both = [_one_direction(bare, sign, speed) for sign in (1.0, -1.0)]
    rest, sliding, friction = np.abs(np.array(both)).T
    return FeedForward(rest, sliding, friction, speed)


def _one_direction(model: FrictionModel, sign: float, speed: float) -> Iterable[float]:
    """Return the current at rest, in sliding, and the friction predicted there, A."""
    law = CompensationLaw([model], sample_time=_STEP)
    time = np.arange(0.0, _REST + _START + _STEADY, _STEP)
    velocity = sign * speed * np.clip((time - _REST) / _START, 0.0, 1.0)
    position = np.cumsum(velocity) * _STEP
    currents = np.array([law.update(t, [q], None, [sign])[0] for t, q in zip(time, position)])
    # From the middle of a turn, and over the last tenth, so that ripple averages out.
    last = time > time[-1] - _STEADY / 2.0
    nothing = np.zeros_like(time)
    friction = model.current(Samples(time=time, position=position, velocity=velocity,
                                     acceleration=nothing, current=nothing))
    resting = int(_REST / _STEP) - 1
    return currents[resting], currents[last].mean(), friction[last].mean()
