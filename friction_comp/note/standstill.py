# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tests whether an untouched joint starts by itself."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from friction_comp.compensation.law import law_parameters
from friction_comp.model.friction_model import Breakaway
from friction_comp.note.published import FALSE_START
from friction_comp.simulation.batch import closed_loops
from friction_comp.simulation.joint_parameters import joint_parameters
from friction_comp.simulation.random_sequence import random_states

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.note.published import Experiment

SAMPLE_TIME = 1e-3
# The direction is announced so long after the joint came to rest, s.
ANNOUNCED = 0.5


@dataclass(frozen=True)
class Standstill:
    """Outcome of many standstills; in false starts the joint went farther than `FALSE_START`."""

    false_starts: int
    farthest: float
    """rad"""
    standstills: int
    duration: float
    """s in all"""


def with_breakaway_error(model: FrictionModel, error: float) -> FrictionModel:
    """Return the model with breakaway means too large by a share."""
    both = model.breakaway
    assert both is not None, 'an identified model has breakaway currents'
    return replace(model, breakaway=Breakaway(
        both.positive_mean * (1.0 + error), both.negative_mean * (1.0 + error),
        both.positive_std, both.negative_std))


def stand_still(experiment: Experiment, model: FrictionModel, law: str, seed: int,
                error: float = 0.1, gain: float = 0.9, standstills: int = 360,
                each: float = 10.0) -> Standstill:
    """Leave the joint alone with a direction announced, again and again.

    Every standstill, of `each` s, is a new rest with breakaway levels of its own: one rest of an
    hour would try a single pair of them. Half of them have d = 1, half d = -1. The breakaway
    currents in use are too large by the share `error`; `gain` is the breakaway_gain.
    """
    count = round(each / SAMPLE_TIME)
    still, direction = np.zeros((2, count)), np.zeros((2, count))
    direction[:, round(ANNOUNCED / SAMPLE_TIME):] = [[1.0], [-1.0]]
    _, extremes, _ = closed_loops(
        np.tile(joint_parameters(experiment.model()), standstills),
        random_states((seed, 2), standstills),
        np.tile(law_parameters(with_breakaway_error(model, error), law, gain), standstills),
        (still, still, direction), np.arange(standstills) % 2, released=0,
        sample_time=SAMPLE_TIME, every=0)
    farthest = np.abs(extremes).max(axis=1)
    return Standstill(int(np.sum(farthest > FALSE_START)), float(farthest.max()), standstills,
                      standstills * each)
