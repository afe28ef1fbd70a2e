# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Arms of two or three joints that swing about the posture in which they hang, by given torques."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from arm_world.arms import Friction, rms
from arm_world.motions import Motion

TOO_FAST = 18.0  # rad/s
TRIES = 12


@dataclass
class Swing:
    """How an arm is driven.

    `hanging`: ndarray, shape (n,); posture of least potential energy, rad. `start`: how far from
    it each joint may begin, rad. `cut`: highest frequency of the torques, Hz. `size`: ndarray,
    shape (n,); root mean square of the torques, N·m.
    """

    hanging: np.ndarray
    start: float
    cut: float
    size: np.ndarray = None

    @classmethod
    def draw(cls, generator, arm):
        """Draw it for an arm, without the size of its torques."""
        n = arm.model.nv
        found = [minimize(arm.potential_energy, generator.uniform(-3, 3, n)) for _ in range(4)]
        return cls(min(found, key=lambda end: end.fun).x, generator.uniform(0.3, 1.3),
                   generator.uniform(0.4, 1.5))

    def move(self, generator, arm, time, amplitude):
        """Integrate the motion by Runge and Kutta's rule of order 4.

        `time`: ndarray, shape (N,); equidistant, s. `amplitude`: factor on the torques and on how
        far from hanging the arm begins. Returns a Motion, or None if it got faster
        than `TOO_FAST`.
        """
        n, rate = arm.model.nv, 1 / (time[1] - time[0])
        every = max(1, int(np.ceil(1 / (rate * self._largest_step(arm)))))
        h = 1 / (rate * every)
        steps = (len(time) - 1) * every + 1
        halves = np.arange(2 * steps + 1) * h / 2
        drive = np.zeros((len(halves), n))
        for j in range(n):
            for f in generator.uniform(0.05, self.cut, 6):
                phase = generator.uniform(0, 2 * np.pi)
                drive[:, j] += np.sin(2 * np.pi * f * halves + phase) / 3 ** 0.5
        drive *= self.size * amplitude
        acceleration = arm.forward_dynamics()
        q = self.hanging + generator.uniform(-1, 1, n) * self.start * amplitude
        v = np.zeros(n)
        result = Motion(*(np.zeros((len(time), n)) for _ in range(3)),
                        torque=drive[:2 * steps:2 * every].copy())
        for i in range(steps):
            begin, middle, end = drive[2 * i:2 * i + 3]
            a1 = acceleration(q, v, begin)
            if i % every == 0:
                row = i // every
                result.position[row], result.velocity[row] = q, v
                result.acceleration[row] = a1
            v2 = v + h / 2 * a1
            a2 = acceleration(q + h / 2 * v, v2, middle)
            v3 = v + h / 2 * a2
            a3 = acceleration(q + h / 2 * v2, v3, middle)
            v4 = v + h * a3
            a4 = acceleration(q + h * v3, v4, end)
            q = q + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
            v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            if not np.all(np.isfinite(v)) or np.abs(v).max() > TOO_FAST:
                return None
        return result

    def _largest_step(self, arm):
        """Return the step in s that the steepest part of the friction still allows."""
        friction = arm.friction
        inertia = arm.own_inertia(self.hanging) + arm.rotor_inertia
        slope = (friction.coulomb + friction.stribeck) / friction.reversal_speed + friction.viscous
        return np.clip(0.8 * float(np.min(inertia / slope)), 1e-4, 2e-3)


def draw_swings(generator, arm, joint, friction_share, recordings):
    """Give an arm friction and let it swing, with torques that move it well but not too fast.

    `arm`: gets its friction here. `joint`: joint whose friction must not hide the rest.
    `friction_share`: ndarray, shape (n,); how large friction is beside gravity. `recordings`: list
    of (ndarray, float, bool); times in s of shape (N,), amplitude, and whether it is one to fit.
    Returns the motions and how fast each joint typically moves, rad/s, shape (n,). Raises
    LookupError if no torques are found under which the arm swings well.
    """
    n = arm.model.nv
    swing = Swing.draw(generator, arm)
    around = swing.hanging + generator.uniform(-1, 1, (300, n))
    gravity = np.array([rms(column) for column in arm.gravity_torque(around).T])
    inertia = arm.own_inertia(swing.hanging)
    gravity = np.maximum(gravity, 2.0 * inertia)
    speed = np.sqrt(gravity / inertia) * 0.7
    arm.friction = Friction.draw(generator, speed)
    # Steeper friction would need steps too small to integrate in reasonable time
    arm.friction.reversal_speed = np.maximum(arm.friction.reversal_speed, 0.01)
    arm.friction.scale(np.minimum(friction_share, 0.4) * gravity * 0.8)
    level = generator.uniform(0.15, 0.6, n)
    for _ in range(TRIES):
        swing.size = level * gravity + 1.1 * (arm.friction.coulomb + arm.friction.stribeck)
        seeds = generator.integers(0, 2 ** 31, len(recordings))
        motions = [swing.move(np.random.default_rng(seed), arm, time, amplitude)
                   for seed, (time, amplitude, _) in zip(seeds, recordings)]
        if any(motion is None for motion in motions):
            level = level * 0.6
            swing.start *= 0.8
            continue
        fit = [motion for motion, (_, _, fitted) in zip(motions, recordings) if fitted]
        friction = np.concatenate([arm.friction.torque(m.velocity)[:, joint] for m in fit])
        if rms(friction) > 0.6 * rms(np.concatenate([m.torque[:, joint] for m in fit])):
            arm.friction.scale(0.7)
            continue
        return motions, speed
    raise LookupError(f'no torques found that move the arm well in {TRIES} tries')
