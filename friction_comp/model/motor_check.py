# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Checks a model before its currents are sent to a motor.

A valid file may have a mistake: 99.5 A instead of 0.0995 A, the file of another joint, a missing
coefficient. Over the motion that it was identified on, its friction, breakaway currents and effects
must therefore be of similar size, and below the drive's limit.
"""

from __future__ import annotations

from collections.abc import Collection
import math

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.effect import Effect, RESISTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.samples import Samples

CURRENT, TORQUE = 'A', 'N·m'
"""Units in which a motor can be commanded; `notes.unit` of a model is A if it is not given."""

RECORD_AGAIN = 'record again'
"""The verdict of refinement on data that do not support a model."""

# rad/s; the note's largest speed, used if the file does not give the largest identified speed.
_SPEED = math.radians(100.0)
# s, Hz: a movement to and fro, and the rate at which it is sampled.
_PERIOD, _RATE = 5.0, 100.0
# Range of motor temperatures, degrees Celsius.
_COLD, _WARM = 10.0, 60.0
# Largest and smallest ratio of breakaway, and of effects that are friction, to sliding friction.
# The note's drives have 1.05, measured gears 0.8 to 2.
_LARGEST_RATIO, _SMALLEST_RATIO = 5.0, 0.2
# Exponents of friction laws are between 0.5 and 2.
_STEEPEST = 10.0
# Share of the sigmoid's span by which a fit, never exact, may decrease where it should increase.
_DIP = 0.1
# Share of the largest current in the table by which the sigmoid may miss it.
_MISS = 0.5


def check_for_motor(model: FrictionModel, joint: str = '', joints: Collection[str] = ()) -> None:
    """Raise InputError, with the reason, if the currents of a model must not be sent to a motor.

    `joint` uses the model; it must not be that of another of the `joints` that are driven together.
    """
    if model.joint != joint and model.joint in joints:
        raise InputError(f"this is the model of joint '{model.joint}', not of '{joint}'")
    if not model.friction_known:
        raise InputError('it has no sigmoid: nothing has measured the friction of this drive yet. '
                         'Identify the joint, or refine a recording of it, and give the new file')
    unit = unit_of(model)
    if unit not in (CURRENT, TORQUE):
        raise InputError(
            f"notes.unit: its figures are in '{unit}', not in A or N·m: they are no current. "
            "Convert the recording's effort and refine it again")
    motion = _motion(model)
    friction = _check_sigmoid(model, motion)
    resisting = [_check_effect(model, effect, motion, friction) for effect in model.effects]
    _check_breakaway(model, friction + sum(resisting))


def unit_of(model: FrictionModel) -> str:
    """Return the unit of the model's currents by its notes."""
    return str(model.notes.get('unit') or CURRENT)


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


def _motion(model: FrictionModel) -> Samples:
    speed = model.largest_speed(_SPEED)
    time = np.arange(0.0, 2.0 * _PERIOD, 1.0 / _RATE)
    turn = 2.0 * math.pi / _PERIOD
    return Samples(
        time=time, position=-speed / turn * np.cos(turn * time),
        velocity=speed * np.sin(turn * time), acceleration=speed * turn * np.cos(turn * time),
        current=np.zeros(time.size), load=model.drive.torque_per_current * np.sin(3.0 * time),
        temperature=np.linspace(_COLD, _WARM, time.size), rigid_body=np.zeros(time.size),
        coupling=np.zeros(time.size))


def _check_sigmoid(model: FrictionModel, motion: Samples) -> float:
    velocity = np.asarray(motion.velocity)
    speeds = np.linspace(velocity.min(), velocity.max(), 401)
    current = np.asarray(model.sigmoid(speeds), dtype=float)
    if not np.isfinite(current).all():
        raise InputError('sigmoid: its currents are not finite')
    if not current[0] < 0.0 < current[-1]:
        raise InputError(
            f'sigmoid: {_said(model, current[-1])} forwards and {_said(model, current[0])} '
            'backwards do not have the sign of friction')
    span = current[-1] - current[0]
    if (np.maximum.accumulate(current) - current).max() > _DIP * span:
        raise InputError('sigmoid: it falls with speed; use the effect stribeck for such friction')
    largest = np.abs(current).max()
    _check_limit(model, largest, f'sigmoid: {_said(model, largest)} at {speeds[-1]:.3g} rad/s is')
    _check_table(model)
    return float(largest)


def _said(model: FrictionModel, figure: float) -> str:
    return f'{figure:.4g} {unit_of(model)}'


def _check_limit(model: FrictionModel, current: float, what: str) -> None:
    if current > model.drive.current_limit:
        raise InputError(
            f'{what} more than drive.current_limit of {_said(model, model.drive.current_limit)}: '
            'give the limit of the motor there')


def _check_table(model: FrictionModel) -> None:
    table = model.lookup_table or {}
    # Refinement fits another sigmoid to recordings and keeps the table.
    if model.differentiation or not table.get('speeds'):
        return
    currents = np.asarray(table['currents'], dtype=float)
    miss = np.abs(model.sigmoid(table['speeds']) - currents).max()
    if miss > _MISS * np.abs(currents).max():
        raise InputError(
            f'sigmoid: it misses the lookup_table, which it was fitted to, by {_said(model, miss)}')


def _check_effect(model: FrictionModel, effect: Effect, motion: Samples, friction: float) -> float:
    """Return the largest current that an effect adds to sliding friction, A."""
    for name, value in effect.values.items():
        if name == 'exponent' and value > _STEEPEST:
            raise InputError(f"effect '{effect.name}': exponent {value:g} is above {_STEEPEST:g}")
    with np.errstate(all='ignore'):
        current = effect.current(motion)
    if not np.isfinite(current).all():
        raise InputError(f"effect '{effect.name}' gives currents that are not finite")
    largest = float(np.abs(current).max(initial=0.0))
    if effect.not_fed_back:
        return 0.0
    if effect.role == RESISTS:
        if largest > _LARGEST_RATIO * friction:
            raise InputError(
                f"effect '{effect.name}': {_said(model, largest)} are too many beside sliding "
                f'friction of {_said(model, friction)}')
        return largest
    _check_limit(model, largest, f"effect '{effect.name}': {_said(model, largest)} are")
    return 0.0


def _check_breakaway(model: FrictionModel, friction: float) -> None:
    if model.breakaway is None:
        return
    for side, mean, spread, plateau in (
            ('positive', model.breakaway.positive_mean, model.breakaway.positive_std,
             model.sigmoid.upper),
            ('negative', -model.breakaway.negative_mean, model.breakaway.negative_std,
             -model.sigmoid.lower)):
        _check_limit(model, mean, f'breakaway.{side}: {_said(model, mean)} is')
        if mean > _LARGEST_RATIO * friction or mean < _SMALLEST_RATIO * plateau:
            raise InputError(
                f'breakaway.{side}: {_said(model, mean)} does not match sliding friction of '
                f'{plateau:.3g} to {_said(model, friction)}')
        if spread > mean:
            raise InputError(
                f'breakaway.{side}: the standard deviation {_said(model, spread)} is more than the '
                'mean')
