# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares a drive's friction in each recording of a history with one model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friction_comp.errors import errors_name
from friction_comp.model.friction_change import recorded_change
from friction_comp.model.friction_model import FrictionModel
from friction_comp.recordings.history import History
from friction_comp.statistics import rms, top_speed

# Share of the top speed above which a joint is sliding.
_SLIDING = 0.1


@dataclass(frozen=True)
class RecordedFriction:
    """A drive's friction in one recording."""

    name: str
    day: str  # ISO date
    seconds: float  # duration of the part that is kept
    level: float  # sliding friction as a share of the model's
    level_error: float  # standard error of that
    error: float  # RMS of measured minus predicted current in sliding, A
    temperature: float | None  # mean of the motor's, degrees Celsius
    one_way: bool  # whether it moved in one direction only, so that an offset counts as friction


def recorded_friction(history: History, model: FrictionModel) -> list[RecordedFriction]:
    """Return the friction in each recording that shows sliding, or raise InputError.

    The level is the factor of `recorded_change`, beside an offset, a weight and an inertia that
    changed.
    """
    recorded = []
    for recording, samples in zip(history.recordings, history.samples()):
        with errors_name(recording.name):
            error = model.measured(samples) - model.predict(samples)
        moved = model.differentiated(model.with_arm(samples))
        speed = np.abs(np.asarray(moved.velocity))
        sliding = speed > _SLIDING * top_speed(speed)
        if sliding.sum() < 100:
            continue
        change = recorded_change(model, error, moved, sliding)
        recorded.append(RecordedFriction(
            recording.name, recording.day, len(samples) * samples.sample_time, 1.0 + change.factor,
            change.error, rms(error[sliding]),
            None if samples.temperature is None else float(np.mean(samples.temperature)),
            change.one_way))
    return recorded
