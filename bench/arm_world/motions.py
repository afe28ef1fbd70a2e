# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Motions that all joints of an arm are made to follow: multisine, point to point, joystick.

Positions, velocities and accelerations are in rad, rad/s and rad/s². Each class draws what all
recordings of a case share with `draw`, and `move` draws one recording. The fourth type of motion,
in which torques are given instead, is in `swing`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, lfilter

from arm_world.arms import log_uniform


@dataclass
class Motion:
    """True motion of n joints, each attribute of shape (N, n).

    `position`, `velocity`, `acceleration`: rad, rad/s and rad/s². `rest_share`: ndarray, optional;
    share of Coulomb friction, with its sign, that acts where a joint stands. `torque`: ndarray,
    optional; torque of the motors in N·m, where motion followed from it.
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    rest_share: np.ndarray | None = None
    torque: np.ndarray | None = None

    def add_sine(self, joint, time, amplitude, frequency, phase):
        """Add a sine to the motion of a joint; rad, Hz and rad."""
        w = 2 * np.pi * frequency
        angle = w * time + phase
        self.position[:, joint] += amplitude * np.sin(angle)
        self.velocity[:, joint] += amplitude * w * np.cos(angle)
        self.acceleration[:, joint] -= amplitude * w * w * np.sin(angle)


def _standing(posture, samples):
    position = np.tile(posture, (samples, 1))
    return Motion(position, np.zeros_like(position), np.zeros_like(position))


@dataclass
class Multisine:
    """A few slow sines in each joint, with the ripple that a controller's tracking leaves.

    `centre`: ndarray, shape (n,); rad. `frequencies`, `amplitudes`: list of ndarray; of each
    joint's sines, Hz and rad. `ripple`: rad.
    """

    centre: np.ndarray
    frequencies: list
    amplitudes: list
    ripple: float

    @classmethod
    def draw(cls, generator, centre):
        """Draw sines that stay within 2.5 rad/s about a posture of shape (n,)."""
        highest = log_uniform(generator, 0.3, 1.5)
        frequencies, amplitudes = [], []
        for _ in centre:
            count = int(generator.integers(3, 7))
            f = np.sort(generator.uniform(0.05, highest, count))
            a = generator.uniform(0.3, 1, count) / f ** generator.uniform(0, 1)
            a *= generator.uniform(0.3, 1.2) / np.sqrt((a ** 2).sum()) / 1.4
            a *= min(1, 2.5 / np.sqrt((a ** 2 * (2 * np.pi * f) ** 2).sum()))
            frequencies.append(f)
            amplitudes.append(a)
        return cls(centre, frequencies, amplitudes, generator.uniform(0, 4e-4))

    def move(self, generator, time, amplitude):
        """Return the Motion at times of shape (N,) in s, its size times `amplitude`."""
        motion = _standing(self.centre, len(time))
        for j, (frequencies, amplitudes) in enumerate(zip(self.frequencies, self.amplitudes)):
            phases = generator.uniform(0, 2 * np.pi, len(frequencies))
            for f, a, phase in zip(frequencies, amplitudes, phases):
                motion.add_sine(j, time, amplitude * a, f, phase)
            for f in generator.uniform(2, 7, 6):
                motion.add_sine(j, time, self.ripple / 6 ** 0.5, f,
                                generator.uniform(0, 2 * np.pi))
        return motion


@dataclass
class PointToPoint:
    """Smooth moves between random postures, with pauses.

    `centre`, `reach`: ndarray, shape (n,); postures are within `reach` of `centre`, rad.
    `top_speed`: ndarray, shape (n,); rad/s. `still`: how probable it is that a joint stays where
    it is. `together`: whether all joints arrive at once.
    """

    centre: np.ndarray
    reach: np.ndarray
    top_speed: np.ndarray
    still: float
    together: bool

    @classmethod
    def draw(cls, generator, centre):
        """Draw how an arm moves about a posture of shape (n,)."""
        n = len(centre)
        return cls(centre, generator.uniform(0.4, 1.5, n), generator.uniform(0.5, 2.5, n),
                   float(generator.choice([0, 0.3])), bool(generator.random() < 0.6))

    def move(self, generator, time, amplitude):
        """Return the Motion at times of shape (N,) in s, its speeds times `amplitude`."""
        n = len(self.centre)
        here = self.centre + generator.uniform(-1, 1, n) * self.reach
        motion = _standing(here, len(time))
        motion.rest_share = np.zeros_like(motion.position)
        direction, now = np.ones(n), 0.0
        while now < time[-1]:
            pause = generator.uniform(0.1, 1.2)
            standing = (time >= now) & (time < now + pause)
            motion.position[standing] = here
            motion.rest_share[standing] = direction * generator.uniform(-0.2, 0.8, n)
            now += pause
            target = self.centre + generator.uniform(-1, 1, n) * self.reach
            target = np.where(generator.random(n) < self.still, here, target)
            lasts = np.maximum(1.875 * np.abs(target - here) / (self.top_speed * amplitude), 0.3)
            if self.together:
                lasts[:] = lasts.max()
            for j in range(n):
                if target[j] != here[j]:
                    direction[j] = np.sign(target[j] - here[j])
                _smooth_move(motion, j, time - now, lasts[j], here[j], target[j])
                # Friction of a joint that stands while others move, or arrived before them
                motion.rest_share[time >= now, j] = direction[j] * generator.uniform(-0.2, 0.8)
            now += lasts.max()
            here = target
        return motion


def _smooth_move(motion, joint, since, lasts, start, target):
    """Move a joint by a polynomial of order 5 from time 0 of `since` on, and let it stay there."""
    s, way = np.clip(since / lasts, 0, 1), target - start
    later, within = since >= 0, (since >= 0) & (since < lasts)
    motion.position[later, joint] = (
        start + way * (10 * s ** 3 - 15 * s ** 4 + 6 * s ** 5))[later]
    motion.velocity[later, joint] = motion.acceleration[later, joint] = 0
    motion.velocity[within, joint] = (
        way / lasts * (30 * s ** 2 - 60 * s ** 3 + 30 * s ** 4))[within]
    motion.acceleration[within, joint] = (
        way / lasts ** 2 * (60 * s - 180 * s ** 2 + 120 * s ** 3))[within]


@dataclass
class Joystick:
    """Speeds that a person asks for with a stick, smoothed.

    `centre`, `reach`: ndarray, shape (n,); the person turns back where a joint is `reach` from
    `centre`, rad. `top_speed`: ndarray, shape (n,); rad/s. `cut`: bandwidth of the smoothing, Hz.
    """

    centre: np.ndarray
    reach: np.ndarray
    top_speed: np.ndarray
    cut: float

    @classmethod
    def draw(cls, generator, centre):
        """Draw how a person moves an arm about a posture of shape (n,)."""
        n = len(centre)
        return cls(centre, generator.uniform(0.5, 1.5, n), generator.uniform(0.5, 2.0, n),
                   generator.uniform(0.5, 2.5))

    def move(self, generator, time, amplitude):
        """Return the Motion at times of shape (N,) in s, its speeds times `amplitude`."""
        rate = 1 / (time[1] - time[0])
        # Fine steps, so that the integral of velocity is the position, whatever the rate
        every = max(1, int(np.ceil(2000 / rate)))
        step = 1 / (rate * every)
        samples = (len(time) - 1) * every + 1
        velocity = np.zeros((samples, len(self.centre)))
        position = np.zeros_like(velocity)
        for j, centre in enumerate(self.centre):
            start = generator.uniform(-0.5, 0.5) * self.reach[j]
            asked = self._asked(generator, j, start, samples, step, amplitude)
            v = lfilter(*butter(3, self.cut, fs=1 / step), asked)
            way = np.concatenate(([0], np.cumsum((v[1:] + v[:-1]) / 2 * step)))
            velocity[:, j], position[:, j] = v, centre + start + way
        acceleration = np.gradient(velocity, step, axis=0)
        return Motion(position[::every], velocity[::every], acceleration[::every])

    def _asked(self, generator, joint, start, samples, step, amplitude):
        """Return the speed asked for, shape (samples,), in rad/s, constant for a while each."""
        speeds, place, done = np.zeros(samples), start, 0
        while done < samples:
            count = int(generator.uniform(0.3, 2.0) / step)
            speed = 0.0
            if generator.random() >= 0.2:
                speed = generator.uniform(-1, 1) * self.top_speed[joint] * amplitude
            if abs(place + speed * count * step) > self.reach[joint]:
                speed = -np.sign(place) * abs(speed)
            count = min(count, samples - done)
            speeds[done:done + count] = speed
            place += speed * count * step
            done += count
        return speeds
