# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Signals, coverage of recordings and search ranges, which define effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math
from typing import Any, NamedTuple

VARIABLES = (
    'velocity', 'direction', 'position', 'acceleration', 'load', 'temperature', 'time', 'history',
    'other joints')

RESISTS, CARRIES, NEITHER = 'resists', 'carries', 'neither'
"""Roles of an effect: it dissipates energy, as friction; it is a torque that does not depend on the
direction of motion, as gravity; or it is not a torque."""


class Signals(NamedTuple):
    """The signals that a formula may use: arrays over samples, or one sample's numbers."""

    time: Any = 0.0           # s since the recording began, or since the compensator did
    position: Any = 0.0       # rad
    velocity: Any = 0.0       # rad/s
    acceleration: Any = 0.0   # rad/s²
    load: Any = 0.0           # back-driving torque, N·m
    temperature: Any = 0.0    # degrees Celsius
    sign: Any = 0.0           # sign of friction, -1..1, which passes through zero smoothly
    memory: Any = 0.0         # state of an effect that has one
    rigid_body: Any = 0.0     # torque that the joint supplies for the links of the arm, N·m
    coupling: Any = 0.0       # current that the motor needs because of other joints, A


@dataclass(frozen=True)
class Coverage:
    """The ranges that a set of recordings covers, within which constants are searched."""

    transition: float         # rad/s over which friction changes sign: tanh(v/transition)
    speed: float              # 95th percentile of the speed while moving, rad/s
    slowest: float            # rad/s below which samples count as standstill
    lowest: float             # ends of the range of position, 1st and 99th percentile, rad
    highest: float
    duration: float           # of the longest recording, s
    temperature: float = 25.0         # median, degrees Celsius
    resolution: float = 0.0           # smallest step of the recorded position, rad
    both_directions: bool = True      # whether there is motion in both
    passed_again: float = 1.0         # share of the motion at places that were passed twice or more
    slow: float = 0.0                 # 5th percentile of the speed while moving, rad/s
    reversals: float = math.inf       # of the direction of motion
    rest_duration: float = math.inf          # how long the joint stood still, s
    distinct_positions: float = math.inf       # distinct positions that the encoder gave
    temperature_span: float = math.inf        # range of the motor temperature, K
    median_speed: float = math.inf     # median of the speed while moving, rad/s
    speed_spread: float = math.inf    # its standard deviation as a share of its mean
    linear: bool = False              # whether positions are in m

    @property
    def span(self) -> float:
        """Width of the range of position in rad, never zero: constants are shares of it."""
        return max(self.highest - self.lowest, 1e-9)


@dataclass(frozen=True)
class ResidualView:
    """A residual from which effects propose constants: arrays of shape (R,)."""

    coverage: Coverage
    position: Any                     # rad
    velocity: Any                     # rad/s
    sign: Any                         # sign of friction, -1..1
    residual: Any                     # A
    row_time: float                   # s over which each row was averaged
    # Loads of the terms of the fit, see `Effect.load_share`.
    load_shares: list[dict[str, float]]


@dataclass(frozen=True)
class SearchRange:
    """How a constant is searched around an initial value."""

    # Half width of the bracket: a factor, or a number of units if `unit` is given.
    width: float
    # Size of one unit, for constants searched on a linear scale; without it, it is logarithmic.
    unit: Callable[[Coverage, dict[str, float]], float] | None = None
    # Lowest and highest value; beyond them the effect is another one.
    limits: Callable[[Coverage, dict[str, float]], tuple[float, float]] | None = None


# Fewest positions of a fine encoder: with fewer, a hundredth of the range is a step or two.
_COARSE = 150

NEARLY_ONE_SPEED = 0.4
"""Largest spread of a speed that is constant except for starts and reversals: motion to and fro at
one speed has 0.25 to 0.35; production strokes, several speeds and sines have 0.46 and more."""


def turns_often(coverage: Coverage) -> str:
    """Return why nothing can happen at one position only; empty within two turns."""
    turns = coverage.span / (2.0 * math.pi)
    return '' if turns <= 2.0 else (
        f'The joint turned {turns:.0f} times: of the effects of position, only those that repeat '
        'every turn are tried.')


def too_coarse(coverage: Coverage) -> str:
    """Return a warning if the encoder gave too few distinct positions; empty otherwise."""
    if coverage.distinct_positions >= _COARSE:
        return ''
    return (f'Position is coarse: {coverage.distinct_positions:.0f} distinct values. Lag, '
            'presliding and other effects within a few steps of it cannot be seen, and '
            'acceleration is uncertain.')
