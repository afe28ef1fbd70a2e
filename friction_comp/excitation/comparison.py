# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reference motions to compare a plan with: a staircase of speeds, a random Fourier series."""

from __future__ import annotations

import numpy as np

from friction_comp.excitation.joint_limits import JointLimits
from friction_comp.excitation.move import Move
from friction_comp.excitation.plan import MARGIN, samples_of
from friction_comp.samples import Samples

_SPEEDS, _HARMONICS = 8, 5


def staircase(limits: JointLimits, seconds: float, rate: float) -> Samples:
    """Return motion to and fro at speeds that rise in even steps, as long as the time lasts.

    Each step has an equal share of the time.
    """
    centre = 0.5 * (limits.lowest + limits.highest)
    half = 0.5 * MARGIN * (limits.highest - limits.lowest)
    now, here, side, moves = 0.0, centre, 1.0, []
    while True:
        step = min(int(now / seconds * _SPEEDS) + 1, _SPEEDS)
        speed = MARGIN * limits.velocity * step / _SPEEDS
        # Slow steps reverse earlier, so that they too go in both directions.
        way = min(half, 0.2 * speed * seconds / _SPEEDS)
        move = Move.within(now, here, centre + side * way, speed, MARGIN * limits.acceleration)
        if now + move.duration > seconds:
            break
        moves.append(move)
        now, here, side = now + move.duration, centre + side * way, -side
    return samples_of(moves, centre, seconds, rate, limits.joint)


def fourier_series(limits: JointLimits, seconds: float, rate: float, seed: int) -> Samples:
    """Return a random Fourier series of a period of 10 s that just keeps the limits."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate) + 1) / rate
    turns = 2.0 * np.pi / 10.0 * np.arange(1, _HARMONICS + 1)
    angle = turns * time[:, None] + rng.uniform(0.0, 2.0 * np.pi, _HARMONICS)
    size = rng.normal(0.0, 1.0, _HARMONICS) / turns
    position, velocity = np.sin(angle) @ size, np.cos(angle) @ (size * turns)
    acceleration = -np.sin(angle) @ (size * turns ** 2)
    middle = 0.5 * (position.max() + position.min())
    scale = MARGIN * min((limits.highest - limits.lowest) / np.ptp(position),
                         limits.velocity / np.abs(velocity).max(),
                         limits.acceleration / np.abs(acceleration).max())
    centre = 0.5 * (limits.lowest + limits.highest)
    return Samples(time=time, position=centre + scale * (position - middle),
                   velocity=scale * velocity, acceleration=scale * acceleration,
                   current=np.zeros(len(time)), joint=limits.joint)
