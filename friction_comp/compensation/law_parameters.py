# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the compensation laws know of a joint, parameters and state: the law's words.

Compiled code reads the fields of two records by name; checkers of types read the two classes.
Parameters come from a model, with safe defaults.
"""

from __future__ import annotations

from collections.abc import Sequence
import math

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import Breakaway

NONE, KINETIC, PAPER, CONTINUOUS, DESIRED = range(5)
LAWS = dict(zip(('none', 'kinetic', 'paper', 'continuous', 'desired'), range(5)))

# Share of friction that is fed forward where a model does not say how sure it is: with a model 1.10
# times the true friction, 1 % is still left to the gear. And its bounds where a model does.
SHARE = 0.9
LEAST_SHARE, LARGEST_SHARE = 0.80, 0.96
# R is presliding plus its standard deviation, at most this multiple of presliding; this multiple
# where that is unknown. A joint that moves a count farther than this and its backlash slips.
LONGER = 1.5
# Share of R, beyond half to one encoder count, that is no motion: of a joint that rests, or that
# nobody pushes; and the play of the operator, so that no vibration of a held joint moves z. Of the
# slip distance while something is announced: who creeps under a preload still rests.
STILL = 0.05
# rad; if the model has no presliding distance: a long one for R, a short one for what is motion.
# Measured geared joints had 0.1 to 1 mrad.
DEFAULT_PRESLIDING, SHORT_PRESLIDING = 1e-3, 5e-4
DEFAULT_RESOLUTION = 1e-5
# rad/s: the note's range.
DEFAULT_FASTEST = math.radians(100.0)


class Parameters:
    """Parameters of one joint's law."""

    law: int                # one of the laws above
    limit: float            # of the current, A
    sample_time: float      # s
    resolution: float       # of the encoder, rad
    upper: float            # plateaus of Eq. 6, A
    lower: float
    steepness: float        # of Eq. 6, s/rad
    shift: float            # of Eq. 6, rad/s
    viscous: float          # of Eq. 6, A·s/rad
    break_positive: float   # breakaway at this position, magnitudes, A
    break_negative: float
    gain: float             # share of breakaway at rest
    share: float            # share of friction that is fed forward
    distance: float         # R, rad
    play: float             # of the operator, rad; less than that is no motion
    slip: float             # more than the gear yields under the preload, rad
    identified: float       # fastest identified speed, rad/s
    lowest: float           # position limits, rad; infinite if there are none
    highest: float


class State:
    """State of one joint's law; zeros before the first sample."""

    started: int
    time: float             # of the last sample used, s
    step: float             # from the one before, s
    position: float         # rad
    speed: float            # rad/s; over whole counts; travel and s since the last of these
    count_speed: float
    counted: float
    counting: float
    doubt: float            # for how long samples have been implausible, s
    dropped: float          # how many samples were
    z: float                # of the operator, -1..1
    element: float          # what z would be by displacement alone
    driven: float           # position behind the operator's play, rad
    saved: float            # in the tank, rad
    still_time: float       # for how long the joint has been still, s, and where, rad
    still_position: float
    rest_position: float    # where it rested last, rad
    mode: int               # one of those above
    aim: float              # announced and acted on, and for how long something else has been, s
    lasted: float
    since: float            # s since z was led, or since this way began; where that was, rad
    begin: float
    yields: float           # rad that the joint may yield to the preload
    trust: float            # in the drive, and what it was at the last rest; 2 once it is restored
    trusted: float
    heading: float          # of this way, -1, 0 or 1; its farthest point, rad; top speed, rad/s
    farthest: float
    top: float
    is_fresh: int           # whether it began without help, and nobody slowed down on it
    outward: float          # direction of the movement announced last, 0 once it is over
    end: float              # of that movement, rad
    beyond: int             # whether the joint has been beyond that
    current: float          # given last, A; and friction's part before limits
    friction: float
    blends: float           # s for which a new model or law still comes in


def _record(kind: type) -> np.dtype:
    return np.dtype([(name, np.int64 if word == 'int' else float)
                     for name, word in kind.__annotations__.items()], align=True)


PARAMETERS, STATE = _record(Parameters), _record(State)


def law_parameters(model: FrictionModel, law: str = 'continuous', breakaway_gain: float = 0.9,
                   current_limit: float = math.inf, sample_time: float = 1e-3) -> np.ndarray:
    """Return the kernel's parameters of one joint: PARAMETERS, shape (1,).

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
    """
    if law not in LAWS:
        raise InputError(f'law must be one of {", ".join(LAWS)}, not {law!r}')
    for name, value, least, most in (
            ('breakaway_gain', breakaway_gain, 0.0, 2.0), ('sample_time', sample_time, 1e-9, 1e9),
            ('current_limit', current_limit, 0.0, math.inf)):
        if not least <= value <= most:
            raise InputError(f'{name} must be between {least:g} and {most:g}, not {value!r}')
    limit = min(model.drive.current_limit, current_limit)
    p = np.zeros(1, PARAMETERS)
    p['law'], p['limit'], p['sample_time'] = LAWS[law], limit, sample_time
    for name in ('upper', 'lower', 'steepness', 'shift', 'viscous'):
        p[name] = getattr(model.sigmoid, name)
    p['gain'] = breakaway_gain if model.breakaway is not None else 0.0
    unknown = model.friction_uncertainty
    p['share'] = SHARE if unknown is None else min(
        LARGEST_SHARE, max(LEAST_SHARE, 1.0 - 2.0 * unknown))
    set_breakaway(p[0], model.breakaway)
    _set_distances(p, model)
    # A log seldom holds the fastest movement.
    p['identified'] = max(model.largest_speed(DEFAULT_FASTEST),
                          0.0 if model.lookup_table else DEFAULT_FASTEST)
    p['lowest'], p['highest'] = model.position_limits or (-math.inf, math.inf)
    return p


def set_breakaway(p: np.void, breakaway: Breakaway | None,
                  shifts: Sequence[float] = (0.0, 0.0)) -> None:
    """Set the breakaway friction at this position in a joint's parameters.

    `shifts` are added to the magnitudes of the positive and negative mean, A.
    """
    if breakaway is None:
        # Near standstill nothing is known but that friction is unlikely to be less.
        p['break_positive'], p['break_negative'] = 0.8 * p['upper'], -0.8 * p['lower']
        return
    p['break_positive'] = max(0.0, breakaway.positive_mean + shifts[0])
    p['break_negative'] = max(0.0, -breakaway.negative_mean + shifts[1])


def knows_presliding(model: FrictionModel) -> bool:
    """Return whether presliding is known, and how surely: an encoder resolves no fewer counts."""
    known, count = model.presliding, model.drive.position_resolution or DEFAULT_RESOLUTION
    return known is not None and known.std is not None and known.distance >= 2.0 * count


def _set_distances(p: np.ndarray, model: FrictionModel) -> None:
    """Set what is in rad: R of the friction operator, and the distances that follow from it."""
    count, known = model.drive.position_resolution or DEFAULT_RESOLUTION, model.presliding
    distance = slip = LONGER * (known.distance if known else DEFAULT_PRESLIDING)
    if known is not None and knows_presliding(model):
        distance = min(distance, known.distance + (known.std or 0.0))
    # What the share leaves to the gear covers friction that reverses over a longer distance, or R.
    left = (1.0 - SHARE) * max(model.sigmoid.upper, -model.sigmoid.lower)
    for effect in model.effects:
        friction, reversal = (not effect.not_fed_back and effect.dahl_friction()) or (0.0, 0.0)
        if friction > left:
            distance = max(distance, LONGER * reversal)
    # A presliding of few counts is over by the first, which then is motion: beyond half of it. One
    # that nobody knows may be short.
    short = distance if knows_presliding(model) else min(distance, SHORT_PRESLIDING)
    p['play'] = STILL * (short + 2.0 * count) + min(count, max(0.5 * count, 0.1 * short))
    p['resolution'], p['distance'] = count, distance + 2.0 * count
    p['slip'] = slip + count + (known.backlash or 0.0 if known else 0.0)
