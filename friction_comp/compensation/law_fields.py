# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the compensation laws know of a joint, parameters and state: the law's words.

Compiled code reads the fields of two records by name; checkers of types read the two classes.
Where the parameters come from is in `law_parameters`.
"""

from __future__ import annotations

from numba import config
import numpy as np

NONE, KINETIC, PAPER, CONTINUOUS, DESIRED = range(5)
FREE, LEADING, HELD = range(3)
"""The joint moves; z goes to the announced direction at a joint that rests; it rests."""
RESTED, TURNED, SLOWED, WENT_ON = range(4)
"""A way that began at rest without help; any other; one on which help was given back, for who
slowed down; and one on which the joint then went on."""


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
    slip: float             # more than the gear yields under the preload, rad
    identified: float       # fastest identified speed, rad/s
    lowest: float           # position limits, rad; none if they are equal
    highest: float


class State:
    """State of one joint's law; zeros before the first sample."""

    started: int
    time: float             # of the last sample used, s
    step: float             # from the one before, s
    position: float         # rad
    speed: float            # rad/s; and after the first of two filters
    half_speed: float
    ahead: float            # by which the reported velocity has led positions of late, rad
    doubt: float            # for how long samples have been implausible, s
    dropped: float          # how many samples were
    z: float                # of the operator, -1..1
    element: float          # what z would be by displacement alone
    play: float             # position behind the operator's play, rad
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
    way: int                # of which kind, one of those above
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


def zeros(count: int, fields: np.dtype) -> np.ndarray:
    """Return records of zeros, shape (J,), for compiled code or for plain Python.

    With ``NUMBA_DISABLE_JIT=1`` nothing is compiled, and plain Python reads the fields by name too.
    """
    records = np.zeros(count, fields)
    return records.view(np.recarray) if config.DISABLE_JIT else records
