# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares a drive's friction in each recording of a history with one model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friction_comp.errors import errors_name
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


def recorded_friction(history: History, model: FrictionModel) -> list[RecordedFriction]:
    """Return the friction in each recording that shows sliding, or raise InputError.

    The level is the factor of Eq. 6 with the least squared error beside the model's other effects.
    """
    recorded = []
    for recording, samples in zip(history.recordings, history.samples()):
        with errors_name(recording.name):
            error = model.measured(samples) - model.predict(samples)
        velocity = np.asarray(model.differentiated(samples).velocity)
        speed = np.abs(velocity)
        sliding = speed > _SLIDING * top_speed(speed)
        if sliding.sum() < 100:
            continue
        friction = model.sigmoid(velocity)[sliding]
        residual = error[sliding]
        change = float(friction @ residual / (friction @ friction))
        # Neighbouring samples are correlated: count seconds as independent, not samples.
        seconds = len(residual) * samples.sample_time
        level_error = float(np.std(residual - change * friction) / np.sqrt(
            np.mean(friction ** 2) * max(seconds - 1.0, 1.0)))
        recorded.append(RecordedFriction(
            recording.name, recording.day, len(samples) * samples.sample_time, 1.0 + change,
            level_error, rms(residual),
            None if samples.temperature is None else float(np.mean(samples.temperature))))
    return recorded
