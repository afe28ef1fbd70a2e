# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What encoders and torque sensors record of a moving arm, and the case of a seed.

Numbers are drawn in a fixed order, so that a seed always gives the same case: what is drawn anew
belongs at the end.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, lfilter

from arm_world.arms import Arm, draw_chain, Friction, log_uniform, rms
from arm_world.motions import Joystick, Motion, Multisine, PointToPoint
from arm_world.swing import draw_swings
from friction_comp.samples import JointStates, Samples

KINDS = ('multisine', 'swing', 'point to point', 'joystick')
LONGEST_SCORE = 25.0  # s


@dataclass
class Recording:
    """One recording of an arm with n joints.

    `time`: ndarray, shape (N,); s. `motion`: Motion; as it truly was, with the torque of the
    motors, shape (N, n) in N·m. `encoder`: ndarray, shape (N, n); measured position, rad.
    `velocity`: ndarray, shape (N, n), optional; measured velocity, rad/s. `noise`, `measured`:
    ndarray, shape (N,); noise on the torque of the joint that is judged, and that torque with it,
    N·m.
    """

    time: np.ndarray
    motion: Motion
    encoder: np.ndarray
    velocity: np.ndarray | None
    noise: np.ndarray
    measured: np.ndarray


@dataclass
class Case:
    """Recordings of one arm to fit and to score, and what is behind them.

    `kind`: type of motion, one of `KINDS`. `joint`: which joint is judged, from 0. `noise`:
    standard deviation of the noise on its torque, N·m. `fit`, `score`: list of Recording; the
    first score has the amplitude of those to fit, the second another.
    """

    kind: str
    arm: Arm
    joint: int
    noise: float
    fit: list
    score: list

    def samples(self, recording):
        """Return what was measured as Samples, the torque in N·m in the current's place."""
        names = tuple(f'joint{k + 1}' for k in range(self.arm.model.nv))
        velocity = recording.velocity
        return Samples(
            time=recording.time.copy(), position=recording.encoder[:, self.joint].copy(),
            current=recording.measured.copy(),
            velocity=None if velocity is None else velocity[:, self.joint].copy(),
            arm=JointStates(names, recording.encoder, velocity), joint=names[self.joint])


class _Velocity:
    """How velocity is measured: not at all, differentiated by the controller, or with noise."""

    def __init__(self, generator, rate, speed):
        self.kind = str(generator.choice(['none', 'differentiated', 'noisy'],
                                         p=[0.45, 0.35, 0.2]))
        self.cut = float(min(log_uniform(generator, 15, 80), 0.4 * rate))
        self.noise = log_uniform(generator, 0.002, 0.02) * speed
        self.rate = rate

    def measure(self, generator, velocity, encoder):
        if self.kind == 'none':
            return None
        if self.kind == 'noisy':
            return velocity + self.noise * generator.normal(size=velocity.shape)
        steps = np.vstack([np.zeros((1, encoder.shape[1])),
                           np.diff(encoder, axis=0) * self.rate])
        return lfilter(*butter(1, self.cut, fs=self.rate), steps, axis=0)


def _draw_arm(generator, kind):
    if kind == 'swing':
        joints = int(generator.integers(2, 4))
        style = 'planar' if generator.random() < 0.7 else 'random'
    else:
        joints = int(generator.integers(2, 7))
        style = str(generator.choice(['planar', 'alternating', 'random'], p=[0.25, 0.5, 0.25]))
    base = str(generator.choice(['upright', 'wall', 'ceiling'], p=[0.6, 0.2, 0.2]))
    return Arm(draw_chain(generator, joints, style, base))


def _draw_prescribed(generator, kind, arm, centre, friction_share, recordings):
    """Return motions that do not depend on torques; arguments are those of `draw_swings`."""
    chosen = {'multisine': Multisine, 'point to point': PointToPoint, 'joystick': Joystick}[kind]
    course = chosen.draw(generator, centre)
    motions = [course.move(generator, time, amplitude) for time, amplitude, _ in recordings]
    fit = [motion for motion, (_, _, fitted) in zip(motions, recordings) if fitted]
    velocity = np.concatenate([motion.velocity for motion in fit])
    speed = np.maximum(np.quantile(np.abs(velocity), 0.95, axis=0), 0.02)
    arm.friction = Friction.draw(generator, speed)
    rigid = [arm.rigid_torque(m.position, m.velocity, m.acceleration) for m in motions]
    bodies = np.concatenate([torque for torque, (_, _, fitted) in zip(rigid, recordings)
                             if fitted])
    friction = arm.friction.torque(velocity)
    arm.friction.scale(np.array([
        share / np.sqrt(1 - share ** 2) * max(rms(bodies[:, j]), 0.02) / rms(friction[:, j])
        for j, share in enumerate(friction_share)]))
    for motion, torque in zip(motions, rigid):
        motion.torque = torque + arm.friction.torque(motion.velocity, motion.rest_share)
    return motions, speed


def case(seed, longest=np.inf):
    """Draw an arm, its friction, how it moves and how that is measured.

    `seed`: types of motion take turns in the order of `KINDS`. `longest`: recordings to fit last
    no longer together, nor does a score, s. It makes another case of the same arm, for tests that
    have little time.
    """
    generator = np.random.default_rng([seed, 7717])
    kind = KINDS[seed % len(KINDS)]
    arm = _draw_arm(generator, kind)
    n = arm.model.nv
    joint = int(generator.integers(n))
    rate = float(generator.choice([100, 125, 200, 250, 500, 1000]))
    duration = min(log_uniform(generator, 10, 60), longest)
    parts = int(generator.choice([1, 1, 2]))
    resolution = log_uniform(generator, 2e-6, 5e-4)
    time = np.arange(int(duration / parts * rate)) / rate
    score_time = np.arange(int(min(duration, LONGEST_SCORE) * rate)) / rate
    centre = generator.uniform(-1, 1, n)
    friction_share = np.exp(generator.uniform(np.log(0.03), np.log(0.6), n))
    arm.rotor_inertia = arm.own_inertia(centre) * np.exp(
        generator.uniform(np.log(0.02), np.log(1.0), n))
    other_amplitude = float(generator.choice([0.6, 1.25]))
    noise_share = log_uniform(generator, 0.005, 0.05)
    plan = [(time, 1.0, True)] * parts + [(score_time, 1.0, False),
                                          (score_time, other_amplitude, False)]
    if kind == 'swing':
        motions, speed = draw_swings(generator, arm, joint, friction_share, plan)
    else:
        motions, speed = _draw_prescribed(generator, kind, arm, centre, friction_share, plan)
    noise = noise_share * rms(np.concatenate([m.torque[:, joint] for m in motions[:parts]]))
    sensor = _Velocity(generator, rate, speed)
    recordings = []
    for (time, *_), motion in zip(plan, motions):
        encoder = np.round(motion.position / resolution) * resolution
        velocity = sensor.measure(generator, motion.velocity, encoder)
        errors = noise * generator.normal(size=len(time))
        recordings.append(Recording(time, motion, encoder, velocity, errors,
                                    motion.torque[:, joint] + errors))
    return Case(kind, arm, joint, noise, recordings[:parts], recordings[parts:])
