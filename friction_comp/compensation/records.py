# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Field names of the compensation laws' parameters and state, one record per joint.

Compiled code reads the fields of these records by name. Where their values come from is in
`law_parameters`; docs/compensation_law.md has the table.
"""

from __future__ import annotations

import numpy as np

NONE, KINETIC, PAPER, CONTINUOUS, DESIRED = range(5)
FREE, LEADING, HELD = range(3)
"""The continuous law follows displacement; raises the preload of a joint at rest; holds it."""


def _record(floats: str, integers: str) -> np.dtype:
    return np.dtype([(name, float) for name in floats.split()]
                    + [(name, np.int64) for name in integers.split()], align=True)


PARAMETERS = _record(
    # Friction in A, of Eq. 6 and of breakaway; s/rad, rad/s, A·s/rad.
    'upper lower steepness shift viscous break_positive break_negative '
    # Shares.
    'gain share slow_share bound lowered early least_trust least_changing '
    # Distances in rad.
    'distance saving_distance turn_share backlash slip still_distance start_distance '
    'moved_distance resolution '
    'lowest highest soft_end '
    # Times in s.
    'rest_time lead_time start_time bad_time '
    'sample_time '
    # Speeds in rad/s; bounds on the current in A and A/s.
    'slow lead_speed fade_from fade_to fastest limit slope',
    'law')
"""Parameters of one joint."""

STATE = _record(
    # The last sample used, the last one received, and the last stamp that jumped; s, rad, rad/s.
    'time step position seen half_speed speed leapt '
    # The operator: z in -1..1, position behind the backlash in rad.
    'z backlash_position '
    # Rest: how long, where the joint is, where it rested, where leading began, s and rad; z while
    # it is led, and s since leading or the movement began; the help that stopped last, and where.
    'still_time still_position rest_position lead_position ramp since stopped stop_position '
    # Change of speed: averaged speed in rad/s, the lowest and the usual one since the start, s of
    # sliding, the share withheld.
    'pace slowest usual sliding withheld '
    # Trust in the drive, at the last rest too; rad that it may yield; s of doubt.
    'trust trusted yields doubt contradiction '
    # The direction announced last and for how long, the one acted on and where it came, s and rad.
    'direction lasted aim aim_position '
    # The movement announced last: its direction, 0 once it is over, and its end, rad.
    'outward end '
    # This way: its direction and top speed, rad/s, how long it is, rad, and the share of a reversal
    # that is saved.
    'heading top way saved '
    # Output in A and its parts.
    'current friction kinetic breakaway bump '
    # Counts for inspection.
    'dropped slips overspeed',
    'started agreed mode displaced changed slowing beyond')
"""State of one joint; zeros before the first sample."""
