# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the compensation laws know of a joint, parameters and state: the law's words.

Compiled code reads the fields of two records by name; checkers of types read the two classes.
Where the parameters come from is in `law_parameters`; docs/compensation_law.md has the table.
"""

from __future__ import annotations

from numba import config
import numpy as np

NONE, KINETIC, PAPER, CONTINUOUS, DESIRED = range(5)
FREE, LEADING, HELD = range(3)
"""The continuous law follows displacement; raises the preload of a joint at rest; holds it."""


class Parameters:
    """Parameters of one joint's law."""

    upper: float            # plateaus of Eq. 6, A
    lower: float
    steepness: float        # of Eq. 6, s/rad
    shift: float            # of Eq. 6, rad/s
    viscous: float          # of Eq. 6, A·s/rad
    break_positive: float   # breakaway at this position, magnitudes, A
    break_negative: float
    gain: float             # share of breakaway at rest, of the law as printed
    start_share: float      # of breakaway friction, at most, until the joint has started
    preload: float          # z of the preload
    share: float            # share of friction in sliding, and near standstill
    slow_share: float
    bound: float            # largest current as a multiple of friction
    lowered: float          # factors on trust: of a slip, and of an early one
    early: float
    least_trust: float
    least_changing: float   # share left to a joint that gains or loses speed
    distance: float         # R, rad
    turn_distance: float    # behind the farthest point: there a joint has turned, rad
    saving_distance: float  # way that pays for one reversal of z, rad
    turn_share: float       # of the top speed, below which help is given back
    backlash: float         # of the operator, rad
    slip: float             # more than the gear yields under the preload, rad
    still_distance: float   # rest is less than this, rad
    against: float          # moved farther against its preload, the joint is pushed, rad
    start_distance: float   # over which breakaway friction holds, rad
    moved_distance: float   # a movement is more than this, rad
    resolution: float       # of the encoder, rad
    lowest: float           # position limits and the way before them, rad
    highest: float
    soft_end: float
    rest_time: float        # for which a joint must be still, s
    lead_time: float        # in which the preload rises, s
    start_time: float       # of a movement, s
    bad_time: float         # for which a current is held in doubt, s
    sample_time: float      # s
    slow: float             # slowest identified speed, rad/s
    lead_speed: float       # below which z is led, rad/s
    identified: float       # fastest speed that was, rad/s
    fade_from: float        # above which help fades, and where nothing is left, rad/s
    fade_to: float
    hurried_way: float      # longest way faster than identified at full trust, rad
    fastest: float          # that is believed, rad/s
    limit: float            # of the current, A
    turn_time: float        # in which the current may turn round at most, s
    law: int                # one of the laws above


class State:
    """State of one joint's law; zeros before the first sample."""

    time: float             # of the last sample used, s
    step: float             # from the one before, s
    position: float         # rad
    seen: float             # position of the last sample received, rad
    half_speed: float       # speed after one filter and after both, rad/s
    speed: float
    z: float                # of the operator, -1..1
    backlash_position: float    # behind the backlash, rad
    still_time: float       # for how long the joint has been still, s, and where, rad
    still_position: float
    rest_position: float    # where it rested last, rad
    lead_position: float    # where leading began, and the farthest it yielded while held, rad
    yielded: float
    gives_way: float        # preload that goes, since somebody pushes against it
    ramp: float             # z while it is led
    since: float            # s since leading, or the movement, began
    pace: float             # averaged speed, rad/s
    slowest: float          # lowest and usual pace since the start, rad/s
    usual: float
    sliding: float          # s of sliding
    withheld: float         # share withheld while speed changes
    trust: float            # in the drive, and what it was at the last rest
    trusted: float
    yields: float           # rad that the joint may yield to the preload
    doubt: float            # for how long samples have been implausible, s
    direction: float        # announced last, and for how long, s
    lasted: float
    aim: float              # direction acted on, and where it came, rad
    aim_position: float
    outward: float          # direction of the movement announced last, 0 once it is over
    end: float              # of that movement, rad
    heading: float          # of this way; its farthest point, top speed, rad/s, and length, rad
    farthest: float
    top: float
    way: float
    saved: float            # share of a reversal that the way has paid for
    swing: float            # since it stood or the law changed z: way, rad, and least v²/x, rad/s²
    least: float
    pushed_speed: float     # at the last push of this way that a sensor felt, rad/s, or infinite
    current: float          # given last, A, and its parts
    friction: float
    kinetic: float
    breakaway: float
    bump: float             # what is left of the old current after a change, A
    dropped: float          # counts for inspection: samples, slips, and s beyond identified speeds
    slips: float
    overspeed: float
    started: int
    agreed: int             # samples that agree with each other
    mode: int               # one of those above
    displaced: int          # whether the joint has moved since its last rest
    changed: int            # whether the parameters have changed
    slowing: int            # whether help is being given back
    slowed: int             # whether it was on this way: 1; and the joint went on: 2
    beyond: int             # whether the joint has been beyond the end of its movement


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
