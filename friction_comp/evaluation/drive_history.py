# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A drive's friction from recording to recording, compared with one model of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from friction_comp.errors import errors_name
from friction_comp.model.differentiation import DEFAULT_SETTINGS, differentiate
from friction_comp.model.friction_model import FrictionModel
from friction_comp.recordings.history import History

# Share of the top speed from which on a joint slides.
_SLIDES = 0.1


@dataclass(frozen=True)
class RecordedFriction:
    """What one recording says of a drive's friction.

    Parameters
    ----------
    name, day : str
        Of the recording, and its ISO date.
    seconds : float
        How much of it is kept.
    level : float
        Friction in sliding, as a share of the model's.
    level_error : float
        Standard error of it.
    error : float
        RMS of measured minus predicted current in sliding, A.
    temperature : float or None
        Mean of the motor's, degrees Celsius.
    """

    name: str
    day: str
    seconds: float
    level: float
    level_error: float
    error: float
    temperature: float | None

    def as_dict(self) -> dict[str, Any]:
        """Return what report.json holds."""
        return dict(vars(self))


def recorded_friction(history: History, model: FrictionModel) -> list[RecordedFriction]:
    """Return the friction of each recording that shows sliding.

    Friction is the part of the current that Eq. 6 predicts; its level is the factor of Eq. 6 that,
    with the model's other effects as they are, leaves the least error.

    Parameters
    ----------
    history : History
    model : FrictionModel

    Raises
    ------
    InputError
        If the model needs a signal that was not recorded.
    """
    recorded = []
    for one, samples in zip(history.recordings, history.samples()):
        with errors_name(one.name):
            predicted = model.predict(samples)
            measured = model.measured(samples)
        velocity = np.asarray(differentiate(
            samples, model.differentiation or DEFAULT_SETTINGS).velocity)
        speed = np.abs(velocity)
        slides = speed > _SLIDES * np.percentile(speed, 95)
        if slides.sum() < 100:
            continue
        friction, left = model.sigmoid(velocity)[slides], (measured - predicted)[slides]
        power = float(friction @ friction)
        change = float(friction @ left) / power
        rest = left - change * friction
        # Neighbours resemble each other: seconds count, and not samples.
        seconds = len(left) * samples.sample_time
        doubt = float(np.std(rest)) / np.sqrt(power / len(left)) / np.sqrt(max(seconds - 1.0, 1.0))
        recorded.append(RecordedFriction(
            one.name, one.day, len(samples) * samples.sample_time, 1.0 + change, doubt,
            float(np.sqrt(np.mean(left ** 2))),
            None if samples.temperature is None else float(np.mean(samples.temperature))))
    return recorded
