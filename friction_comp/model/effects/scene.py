# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The terms that effects are written in: signals, coverage of recordings, search ranges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math
from typing import Any, NamedTuple

VARIABLES = (
    'velocity', 'direction', 'position', 'acceleration', 'load', 'temperature', 'time', 'history',
    'other joints')

RESISTS, CARRIES, NEITHER = 'resists', 'carries', 'neither'
"""What an effect does to the joint: takes energy from every motion, as friction does; pushes
whatever the direction, as gravity does; or is no torque at all."""


class Signals(NamedTuple):
    """The signals that a formula may use: arrays over samples, or one sample's numbers.

    Parameters
    ----------
    time : float or ndarray
        s since the recording began, or since the compensator did.
    position, velocity, acceleration : float or ndarray
        rad, rad/s, rad/s².
    load : float or ndarray
        Back-driving torque, N·m.
    temperature : float or ndarray
        Degrees Celsius.
    side : float or ndarray
        Sign of friction, -1..1, which passes through zero smoothly.
    memory : float or ndarray
        State of an effect that has one, 0 otherwise.
    rigid_body : float or ndarray
        Torque that the rigid bodies of the whole arm ask of the joint, N·m.
    coupling : float or ndarray
        Current that other joints ask of the joint's motor, A.
    """

    time: Any = 0.0
    position: Any = 0.0
    velocity: Any = 0.0
    acceleration: Any = 0.0
    load: Any = 0.0
    temperature: Any = 0.0
    side: Any = 0.0
    memory: Any = 0.0
    rigid_body: Any = 0.0
    coupling: Any = 0.0


@dataclass(frozen=True)
class Scene:
    """What a set of recordings covers: the frame within which constants are searched.

    Parameters
    ----------
    transition : float
        Velocity in rad/s over which friction changes sign: tanh(v/transition).
    speed : float
        95th percentile of the speed while moving, rad/s.
    slowest : float
        Speed in rad/s below which samples count as standstill.
    lowest, highest : float
        Range of position in rad (1st to 99th percentile).
    duration : float
        Length of the longest recording in s.
    sample_time : float
        Of the recordings, s.
    temperature : float
        Median temperature in degrees Celsius.
    gear_ratio : float
        n; a hint for spatial frequencies.
    resolution : float
        Smallest step of the recorded position in rad.
    both_directions : bool
        Whether there is motion in both directions.
    slow : float
        5th percentile of the speed while moving, rad/s.
    reversals : float
        How often the direction of motion changed.
    rested : float
        How long the joint stood still, s.
    positions : float
        How many distinct positions the encoder gave.
    temperature_span : float
        Range of the motor temperature, K.
    usual_speed, speed_spread : float
        Median of the speed while moving in rad/s, and its standard deviation as a share of its
        mean.
    """

    transition: float
    speed: float
    slowest: float
    lowest: float
    highest: float
    duration: float
    sample_time: float
    temperature: float = 25.0
    gear_ratio: float = 1.0
    resolution: float = 0.0
    both_directions: bool = True
    slow: float = 0.0
    reversals: float = math.inf
    rested: float = math.inf
    positions: float = math.inf
    temperature_span: float = math.inf
    usual_speed: float = math.inf
    speed_spread: float = math.inf

    @property
    def span(self) -> float:
        """Width of the range of position in rad."""
        return self.highest - self.lowest


@dataclass(frozen=True)
class Look:
    """A residual as effects look at it to propose constants: arrays of shape (R,).

    Parameters
    ----------
    scene : Scene
    position, velocity : ndarray
        rad, rad/s.
    side : ndarray
        Sign of friction, -1..1.
    residual : ndarray
        A.
    row_time : float
        Time in s over which each row was averaged.
    loads : list of dict
        What the terms of the fit carry, see `Effect.load_share`.
    """

    scene: Scene
    position: Any
    velocity: Any
    side: Any
    residual: Any
    row_time: float
    loads: list[dict[str, float]]


@dataclass(frozen=True)
class SearchRange:
    """How a constant is searched around a first value.

    Parameters
    ----------
    width : float
        Half width of the bracket: a factor, or a number of units where there is one.
    unit : callable, optional
        ``unit(scene, constants)``: size of one unit of the constant, for constants that are
        searched on a linear scale; the scale is logarithmic when omitted.
    limits : callable, optional
        ``limits(scene, constants)``: lowest and highest value at which the effect is what its name
        says.
    """

    width: float
    unit: Callable[[Scene, dict[str, float]], float] | None = None
    limits: Callable[[Scene, dict[str, float]], tuple[float, float]] | None = None


# An encoder that gives fewer distinct positions over the motion is coarse: less than a hundredth
# of the range is then a step or two.
_COARSE = 150

NEARLY_ONE_SPEED = 0.4
"""Spread of a speed that is one but for starts and reversals: one speed to and fro has 0.25 to
0.35, motion that varies (production strokes, several speeds, sines) 0.46 and more."""


def too_coarse(scene: Scene) -> str:
    """Return a sentence where the encoder gave too few distinct positions; empty if enough."""
    if scene.positions >= _COARSE:
        return ''
    return (f'Position is coarse: {scene.positions:.0f} distinct values. Lag, presliding and what '
            'else happens within a few steps of it cannot be seen, and acceleration is uncertain.')
