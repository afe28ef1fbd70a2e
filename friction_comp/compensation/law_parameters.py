# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Computes a joint's law parameters from its model, with safe defaults."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from friction_comp.compensation.law_fields import (
    CONTINUOUS,
    DESIRED,
    KINETIC,
    NONE,
    PAPER,
    PARAMETERS,
)
from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import Breakaway

LAWS = {'none': NONE, 'kinetic': KINETIC, 'paper': PAPER, 'continuous': CONTINUOUS,
        'desired': DESIRED}

# Margin for model errors: with a model 1.10 times the true friction, 1 % is still left to the gear.
SHARE = 0.9
SLOW_SHARE = 0.89
# The operator reverses over the presliding distance plus its uncertainty, at most this multiple of
# presliding; this multiple where the uncertainty is unknown. A joint that moves farther than this
# multiple and its backlash under its preload slips.
LONGER = 1.5
# Backlash of the operator as a share of its distance, beyond one count: it prevents vibration of a
# joint that a hand holds. Where presliding is known, less is needed.
BACKLASH, KNOWN_BACKLASH = 0.15, 0.05
# Share of R, beyond one and a half counts, by which a joint that moves against its preload is
# pushed that way: more than flicker and a tremor of a tenth of friction, less than a rest allows.
AGAINST = 0.05
# Presliding is known if it has a standard deviation, and at least this many counts: an encoder
# resolves no fewer.
KNOWN_COUNTS = 2.0
# rad; if the model has no presliding distance. Measured geared joints had 0.1 to 1 mrad.
DEFAULT_PRESLIDING = 1e-3
DEFAULT_RESOLUTION = 1e-5
# rad/s: the note's range, and the slowest speed of a usual table.
DEFAULT_FASTEST = math.radians(100.0)
DEFAULT_SLOWEST = math.radians(1.0)
# Multiples of the identified speeds above which help fades and above which nothing is fed forward:
# a drive that has two thirds of its model's friction stays below 1.25 of them. And multiple above
# which a sample is considered implausible.
FADE_FROM, FADE_TO = 1.15, 1.5
UNBELIEVABLE = 3.0
# rad; longest way of a person in a hurry, faster than identified. A drive that lost friction goes
# on.
HURRIED_WAY = math.radians(60.0)
# The current may exceed friction by the model, beside what other effects carry, by this factor.
BOUND = 1.25
# s within which the current may change from full friction in one direction to the other.
TURN_TIME = 0.02
# s over which the preload rises, and the speed in rad/s below which it does: a compliant gear would
# overshoot.
LEAD_TIME = 0.1
LEAD_SPEED = 0.01
# Factor on the trust in a drive that slipped under its preload; a movement restores as much as it
# takes from one. And factor after an early slip: the drive is taken for one that has lost as much
# friction as the law is made for.
LOWERED = 0.94
EARLY = 0.70
# Distance in R from rest over which breakaway friction holds the joint; it fades over the same
# distance again.
START_DISTANCE = 3.0
# The margin of the share on a way of this multiple of R covers a full reversal of z beyond what
# displacement does; so far a way must go before it saves anything.
SAVING = 20.0
# Share of the top speed of a way below which help is given back: a larger one takes help from who
# stops, a smaller one from who turns round.
TURN_SHARE = 0.15
# Smallest trust after the joint was faster than identified.
LEAST_TRUST = 0.5
# Smallest share left to a joint that gains or loses speed after the start of its movement; duration
# of the start, and averaging time of the usual speed, s.
LEAST_CHANGING = 0.95
START_TIME = 0.5
# rad; no one is pushed farther than this by accident.
MOVED = math.radians(1.0)
SOFT_END = math.radians(5.0)


def law_parameters(model: FrictionModel, law: str = 'continuous', breakaway_gain: float = 0.9,
                   current_limit: float | None = None, sample_time: float = 1e-3) -> np.ndarray:
    """Return the kernel's parameters of one joint.

    Parameters
    ----------
    model : FrictionModel
    law : {'continuous', 'desired', 'paper', 'kinetic', 'none'}
        `desired` is that of a joint whose controller follows a reference: friction in the direction
        announced, however the joint moves. The last two never apply the breakaway term, or no
        current at all: the note's case 1, and the bare drive.
    breakaway_gain : float
        Share of the mean breakaway current that is applied at rest, at most; 0.9 in the note.
    current_limit : float, optional
        A; the drive's own when omitted or larger.
    sample_time : float
        Expected s between samples, used for the first one.

    Returns
    -------
    ndarray of law_fields.PARAMETERS, shape (1,)

    Raises
    ------
    InputError
        If an argument is out of range.
    """
    if law not in LAWS:
        raise InputError(f'law must be one of {", ".join(LAWS)}, not {law!r}')
    if not (math.isfinite(breakaway_gain) and 0.0 <= breakaway_gain <= 2.0):
        raise InputError(f'breakaway_gain must be between 0 and 2, not {breakaway_gain!r}')
    limit = model.drive.current_limit
    if current_limit is not None:
        if not (math.isfinite(current_limit) and current_limit >= 0.0):
            raise InputError(f'current_limit must not be negative, not {current_limit!r}')
        limit = min(limit, float(current_limit))
    if not (math.isfinite(sample_time) and sample_time > 0.0):
        raise InputError(f'sample_time must be positive, not {sample_time!r}')
    p = np.zeros(1, PARAMETERS)
    p['law'] = LAWS[law]
    p['limit'], p['sample_time'] = limit, sample_time
    sigmoid = model.sigmoid
    for name in ('upper', 'lower', 'steepness', 'shift', 'viscous'):
        p[name] = getattr(sigmoid, name)
    p['share'], p['slow_share'] = SHARE, SLOW_SHARE
    p['bound'], p['lead_time'], p['lead_speed'] = BOUND, LEAD_TIME, LEAD_SPEED
    p['least_trust'], p['lowered'], p['early'] = LEAST_TRUST, LOWERED, EARLY
    p['least_changing'] = LEAST_CHANGING
    # The preload is the gain's share of breakaway. A hand that pushes on gets what is left to the
    # law's own share.
    gain = breakaway_gain if model.breakaway is not None else 0.0
    p['gain'], p['start_share'], p['preload'] = gain, max(gain, SHARE), min(1.0, gain / SHARE)
    set_breakaway(p[0], model.breakaway)
    _set_distances(p, model)
    p['rest_time'], p['bad_time'], p['start_time'] = 0.15, 0.02, START_TIME
    _set_speeds(p, model)
    return p


def set_breakaway(p: np.void, breakaway: Breakaway | None,
                  shifts: tuple[float, float] = (0.0, 0.0)) -> None:
    """Set the breakaway friction at this position in a joint's parameters.

    Parameters
    ----------
    p : record of law_fields.PARAMETERS
        Changed in place.
    breakaway : Breakaway or None
        Without it nothing is led at rest, and near standstill nothing is known but that friction
        is unlikely to be less than eight tenths of sliding friction.
    shifts : tuple of float
        What to add to the magnitudes of the positive and negative mean, A.
    """
    if breakaway is None:
        p['break_positive'], p['break_negative'] = 0.8 * p['upper'], -0.8 * p['lower']
        return
    p['break_positive'] = max(0.0, breakaway.positive_mean + shifts[0])
    p['break_negative'] = max(0.0, -breakaway.negative_mean + shifts[1])


def knows_presliding(model: FrictionModel) -> bool:
    """Return whether presliding is known, and how surely."""
    known, count = model.presliding, model.drive.position_resolution or DEFAULT_RESOLUTION
    return (known is not None and known.std is not None
            and known.distance >= KNOWN_COUNTS * count)


def _set_distances(p: Any, model: FrictionModel) -> None:
    """Set what is in rad: R of the friction operator, and the distances that follow from it."""
    count = model.drive.position_resolution or DEFAULT_RESOLUTION
    # Where presliding is unknown, the default already is a large one.
    distance, slip, backlash = LONGER * DEFAULT_PRESLIDING, DEFAULT_PRESLIDING, BACKLASH
    if model.presliding is not None:
        distance = slip = LONGER * model.presliding.distance
        slip += model.presliding.backlash or 0.0
        if knows_presliding(model):
            distance = min(distance, model.presliding.distance + (model.presliding.std or 0.0))
            backlash = KNOWN_BACKLASH
    # What the share leaves to the gear covers friction that reverses over a longer distance, or R.
    left = (1.0 - SHARE) * float(np.maximum(p['upper'], -p['lower'])[0])
    for effect in model.effects:
        friction, reversal = (not effect.not_fed_back and effect.dahl_friction()) or (0.0, 0.0)
        if friction > left:
            distance = max(distance, LONGER * reversal)
    distance += 2.0 * count
    p['resolution'], p['distance'] = count, distance
    p['turn_distance'] = distance * (0.5 if knows_presliding(model) else 2.0)
    p['saving_distance'], p['turn_share'] = SAVING * distance, TURN_SHARE
    p['backlash'] = backlash * distance + count
    p['slip'] = slip + 4.0 * count
    p['still_distance'] = distance / 16.0 + 1.5 * count
    p['against'] = AGAINST * distance + 1.5 * count
    p['start_distance'], p['moved_distance'] = START_DISTANCE * distance, max(MOVED, 8.0 * distance)
    if model.position_limits is not None:
        p['lowest'], p['highest'] = model.position_limits
        p['soft_end'] = SOFT_END


def _set_speeds(p: Any, model: FrictionModel) -> None:
    slowest, fastest = DEFAULT_SLOWEST, DEFAULT_FASTEST
    speeds = np.abs((model.lookup_table or {}).get('speeds') or [])
    if len(speeds) and 0.0 < speeds.max() < math.inf:
        slowest = min(max(float(speeds[speeds > 0.0].min()), math.radians(1.0)),
                      math.radians(5.0))
        fastest = float(speeds.max())
    fastest = max(fastest, *(model.recorded.speeds if model.recorded else ()), 0.0)
    p['slow'], p['identified'] = slowest, fastest
    p['fade_from'], p['fade_to'] = FADE_FROM * fastest, FADE_TO * fastest
    p['hurried_way'] = HURRIED_WAY
    p['fastest'] = UNBELIEVABLE * fastest
    p['turn_time'] = TURN_TIME
