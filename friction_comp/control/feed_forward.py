# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the motor gets with a model: the law is run on it, at rest and in steady sliding.

Two models are compared by what reaches the motor, not by their terms: the same friction may be
written in several ways.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from friction_comp.compensation.law import CompensationLaw
from friction_comp.model.effect import RESISTS
from friction_comp.model.friction_model import FrictionModel

# s: sample time, at rest, from standstill to speed, and at speed.
_STEP, _REST, _START, _STEADY = 0.005, 0.6, 0.4, 0.6


class FeedForward(NamedTuple):
    """Currents in the positive and the negative direction, A, magnitudes, shape (2,)."""

    rest: np.ndarray        # with the direction announced
    sliding: np.ndarray


def feed_forward(model: FrictionModel) -> FeedForward:
    """Return what the continuous law feeds forward of a model's friction.

    Without effects that carry, and without those whose signals a joint alone does not have.
    """
    bare = replace(model, arm=None, position_limits=None, effects=[
        effect for effect in model.effects
        if effect.role == RESISTS and not effect.needs and not effect.not_fed_back])
    speed = 0.5 * float(CompensationLaw([bare]).parameters['identified'][0])
    return FeedForward(*np.abs([_one_direction(bare, sign, speed) for sign in (1.0, -1.0)]).T)


def changes(before: FeedForward, after: FeedForward) -> list[str]:
    """Return where by a tenth more or less is fed forward than before, as text.

    That is the margin that the law leaves for errors of a model.
    """
    texts = []
    for place, old, new in zip(('at rest', 'sliding'), before, after):
        side = int(np.abs(new - old).argmax())
        if abs(new[side] - old[side]) > 0.1 * max(new[side], old[side]):
            texts.append(f'{place}, {new[side]:.3g} A instead of {old[side]:.3g} A')
    return texts


def _one_direction(model: FrictionModel, sign: float, speed: float) -> tuple[float, float]:
    """Return the currents at rest and in sliding, A."""
    law = CompensationLaw([model], sample_time=_STEP)
    time = np.arange(0.0, _REST + _START + _STEADY, _STEP)
    position = np.cumsum(sign * speed * np.clip((time - _REST) / _START, 0.0, 1.0)) * _STEP
    currents = np.array([law.update(t, [q], None, [sign])[0] for t, q in zip(time, position)])
    # From the middle of a turn, and over the last tenth, so that ripple averages out.
    return currents[int(_REST / _STEP) - 1], currents[time > time[-1] - _STEADY / 2.0].mean()
