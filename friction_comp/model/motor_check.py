# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Checks a model before its currents are sent to a motor.

A valid file may have a mistake: 99.5 A instead of 0.0995 A, the file of another joint, a missing
coefficient. Over the motion that it was identified on, its friction, breakaway currents and effects
must therefore be of similar size, and below the drive's limit.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
import math

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.effect import RESISTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.samples import Samples

TORQUE = 'N·m'
"""The unit in which a motor can be commanded beside A."""

RECORD_AGAIN = 'record again'
"""The verdict of refinement on data that do not support a model."""

# rad/s; the note's largest speed, used if the file does not give the largest identified speed.
_SPEED = math.radians(100.0)
# Largest ratio of breakaway, and of effects that are friction, to sliding friction: the note's
# drives have 1.05, measured gears 0.8 to 2.
_LARGEST_RATIO = 5.0


def check_for_motor(model: FrictionModel, joint: str = '', joints: Collection[str] = ()) -> None:
    """Raise InputError, with the reason, if the currents of a model must not be sent to a motor.

    `joint` uses the model; it must not be that of another of the `joints` that are driven together.
    """
    if model.joint != joint and model.joint in joints:
        raise InputError(f"this is the model of joint '{model.joint}', not of '{joint}'")
    if not model.friction_known:
        raise InputError('it has no sigmoid: nothing has measured the friction of this drive yet. '
                         'Identify the joint, or refine a recording of it, and give the new file')
    if model.unit not in ('A', TORQUE):
        raise InputError(
            f"notes.unit: its figures are in '{model.unit}', which is neither a current nor a "
            "torque. Convert the recording's effort and refine it again")
    for fault in _faults(model):
        raise InputError(fault)


def doubts(model: FrictionModel) -> list[str]:
    """Return what the model's file says against it: reasons of the last who measured or judged."""
    notes, verdict = model.notes, model.notes.get('verdict')
    said = notes.get('reasons' if verdict else 'warnings')
    reasons = [str(one).rstrip('.') for one in said] if isinstance(said, (list, tuple)) else []
    if verdict and (reasons or is_to_be_recorded_again(model)):
        return [f'refine says `{verdict}`: {reason}' for reason in reasons or ['it says no reason']]
    return [f'identification says: {reason}' for reason in reasons]


def cautions(model: FrictionModel) -> list[str]:
    """Return what speaks against the numbers of a model: doubts, and what was taken for granted."""
    return [*doubts(model), *(f'Taken for granted: {one}' for one in model.notes.get(
        'assumed', ()))]


def is_to_be_recorded_again(model: FrictionModel) -> bool:
    """Return whether refinement says that the data behind a model do not support it."""
    return bool(model.notes.get('verdict') == RECORD_AGAIN)


def _faults(model: FrictionModel) -> Iterator[str]:
    """Return what no drive has; what comes later relies on what came before."""
    top, limit, motion = model.largest_speed(_SPEED), model.drive.current_limit, _motion(model)
    current = np.asarray(model.sigmoid(np.linspace(-1.0, 1.0, 401) * top), dtype=float)
    friction = resisting = float(np.abs(current).max())

    def say(figure: float) -> str:
        return f'{figure:.4g} {model.unit}'
    above = f'more than drive.current_limit of {say(limit)}: give the limit of the motor there'
    checks = [
        (not np.isfinite(current).all(), 'sigmoid: its currents are not finite'),
        (not current[0] < 0.0 < current[-1], f'sigmoid: {say(current[-1])} forwards and '
         f'{say(current[0])} backwards do not have the sign of friction'),
        # A fit is never exact.
        ((np.maximum.accumulate(current) - current).max() > 0.1 * (current[-1] - current[0]),
         'sigmoid: it falls with speed; use the effect stribeck for such friction'),
        (friction > limit, f'sigmoid: {say(friction)} at {top:.3g} rad/s is {above}')]
    for effect in model.effects:
        name, resists = f"effect '{effect.name}'", effect.role == RESISTS
        with np.errstate(all='ignore'):
            size = float(np.abs(effect.current(motion)).max())
        resisting += size * (resists and not effect.not_fed_back)
        # Exponents of friction laws are between 0.5 and 2.
        exponent = effect.values.get('exponent', 0.0)
        checks += [
            (exponent > 10.0, f'{name}: exponent {exponent:g} is above 10'),
            (not math.isfinite(size), f'{name} gives currents that are not finite'),
            (not effect.not_fed_back and not resists and size > limit,
             f'{name}: {say(size)} are {above}'),
            (not effect.not_fed_back and resists and size > _LARGEST_RATIO * friction,
             f'{name}: {say(size)} are too many beside sliding friction of {say(friction)}')]
    if model.breakaway is not None:
        for side, mean, plateau in (
                ('positive', model.breakaway.positive_mean, model.sigmoid.upper),
                ('negative', -model.breakaway.negative_mean, -model.sigmoid.lower)):
            checks += [
                (mean > limit, f'breakaway.{side}: {say(mean)} is {above}'),
                (mean > _LARGEST_RATIO * resisting or mean < 0.2 * plateau,
                 f'breakaway.{side}: {say(mean)} does not match sliding friction of '
                 f'{plateau:.3g} to {say(resisting)}')]
    return (text for wrong, text in checks if wrong)


def _motion(model: FrictionModel) -> Samples:
    """Return 5 s to and fro at the model's largest speed, twice, with all signals of effects."""
    speed, turn, time = model.largest_speed(_SPEED), 0.4 * math.pi, np.arange(0.0, 10.0, 0.01)
    return Samples(
        time=time, position=-speed / turn * np.cos(turn * time),
        velocity=speed * np.sin(turn * time), acceleration=speed * turn * np.cos(turn * time),
        current=0.0 * time, load=model.drive.torque_per_current * np.sin(3.0 * time),
        temperature=np.linspace(10.0, 60.0, time.size), rigid_body=0.0 * time, coupling=0.0 * time)
