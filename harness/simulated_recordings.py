# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Random drives with undeclared effects, and recordings of them, to try refinement on.

A drive is drawn from one seed, each recording of it from another. What is drawn is kept in the
`SimulatedDrive`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import math
from typing import NamedTuple

from numba import njit
import numpy as np

from friction_comp.drive import Drive
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples
from friction_comp.simulation.undeclared import Undeclared, undeclared_torque, warmed_up

STEP = 1e-3
HALF_RANGE, SPEED = 2.0, 1.2     # rad, rad/s, of all motion


# Undeclared effects of random strength, and the recording under which each can be seen.

class Case(NamedTuple):
    """One kind of undeclared effect.

    `variable`: what it depends on, as `friction_comp.model.effect.Effect.variable`. `name`: of the
    undeclared effect, and `parameters` draws its parameters: f(rng, level), where `level` is the
    drive's friction in N·m. `needs`: what the recording's `Excitation` must have for it.
    """

    variable: str
    name: str
    parameters: callable
    needs: dict = {}

    def draw(self, rng, level):
        """Return the effects as in a file of undeclared effects."""
        return [{'name': self.name, 'parameters': {
            key: float(value) for key, value in self.parameters(rng, level).items()}}]


def _log(rng, low, high):
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def _sign(rng):
    return float(rng.choice([-1.0, 1.0]))


def _hysteresis(rng, level):
    torque = level * rng.uniform(0.25, 0.6)
    return {'torque': torque, 'stiffness': torque / _log(rng, 0.03, 0.2)}


def _backlash(rng, level):
    torque, gap = level * rng.uniform(0.25, 0.6), _log(rng, 0.02, 0.1)
    return {'torque': torque, 'gap': gap, 'stiffness': torque / (gap * rng.uniform(0.1, 0.8))}


def _ripple(rng, level):
    return {'amplitude': level * rng.uniform(0.1, 0.3), 'frequency': _log(rng, 8.0, 200.0),
            'phase': rng.uniform(-math.pi, math.pi)}


CASES = {
    'stribeck': Case('velocity', 'stribeck', lambda rng, level: {
        'amplitude': level * rng.uniform(0.2, 0.6), 'velocity': _log(rng, 0.03, 0.25),
        'exponent': rng.choice([1.0, 2.0])}),
    'sub_linear': Case('velocity', 'viscous_shape', lambda rng, level: {
        'amplitude': level * rng.uniform(0.4, 0.9), 'velocity': 1.0,
        'exponent': rng.uniform(0.25, 0.5)}),
    'super_linear': Case('velocity', 'viscous_shape', lambda rng, level: {
        'amplitude': level * rng.uniform(0.3, 0.8), 'velocity': 1.0,
        'exponent': rng.uniform(1.8, 2.5)}),
    'direction': Case('direction', 'direction', lambda rng, level: {
        'coulomb': level * rng.uniform(-0.2, 0.2),
        'viscous': level * rng.uniform(0.2, 0.5) * _sign(rng)}),
    'gravity': Case('position', 'gravity', lambda rng, level: {
        'amplitude': level * _log(rng, 0.2, 1.0), 'phase': rng.uniform(-math.pi, math.pi)}),
    'cogging': Case('position', 'cogging', _ripple),
    'friction_ripple': Case('position', 'friction_ripple', _ripple),
    'bump': Case('position', 'bump', lambda rng, level: {
        'amplitude': level * rng.uniform(0.4, 0.9), 'position': rng.uniform(-1.2, 1.2),
        'width': _log(rng, 0.05, 0.2)}),
    'inertia': Case('acceleration', 'inertia', lambda rng, level: {
        'inertia': level * rng.uniform(0.1, 0.4)}),
    'load_friction': Case('load', 'load', lambda rng, level: {
        'coefficient': rng.uniform(0.15, 0.4)}, {'load': 1.0}),
    'torque_constant': Case('load', 'torque_constant', lambda rng, level: {
        'factor': 1.0 + rng.uniform(0.1, 0.25) * _sign(rng)}, {'load': 1.0}),
    'temperature': Case('temperature', 'temperature', lambda rng, level: {
        'coefficient': -rng.uniform(0.008, 0.02), 'reference': 25.0},
        {'temperature': True, 'recordings': 3, 'duration': 80.0}),
    'warm_up': Case('time', 'warm_up', lambda rng, level: {
        'share': rng.uniform(0.2, 0.5), 'time_constant': _log(rng, 15.0, 60.0)}),
    'hysteresis': Case('history', 'hysteresis', _hysteresis),
    'backlash': Case('history', 'backlash', _backlash),
    'rest': Case('history', 'rest', lambda rng, level: {
        'share': rng.uniform(0.3, 0.6), 'time_constant': _log(rng, 0.4, 2.0),
        'distance': _log(rng, 0.05, 0.2)}),
    'actuation_lag': Case('history', 'actuation_lag', lambda rng, level: {
        'lag': rng.uniform(0.012, 0.04)}),
}


# Motions that show what friction may depend on: speeds, positions, rests.

def stroke(start, goal, speed, ramp_time):
    """Return positions, rad, every `STEP` of a movement at constant speed with smooth ends.

    The velocity rises and falls along a half cosine of `ramp_time` s, so the acceleration is
    continuous. `speed`: rad/s, positive; lowered where the way is too short for it.
    """
    way = abs(goal - start)
    speed = min(speed, way / ramp_time)
    if speed <= 0:
        return np.zeros(0)
    duration = way / speed + ramp_time
    t = np.arange(1, round(duration / STEP) + 1) * STEP
    rise = 0.5 - 0.5 * np.cos(np.pi * np.clip(t / ramp_time, 0.0, 1.0))
    fall = 0.5 - 0.5 * np.cos(np.pi * np.clip((duration - t) / ramp_time, 0.0, 1.0))
    velocity = speed * np.minimum(rise, fall)
    return start + math.copysign(1.0, goal - start) * np.cumsum(velocity) * STEP


def multisine(start, duration, amplitude, rng):
    """Return positions of a sum of four sines, faded in and out at the start position.

    `amplitude`: largest distance from the start in rad. The frequencies, 0.08 to 0.9 Hz, are drawn
    on a logarithmic scale.
    """
    t = np.arange(1, round(duration / STEP) + 1) * STEP
    total = np.zeros_like(t)
    for _ in range(4):
        frequency = _log(rng, 0.08, 0.9)
        phase = rng.uniform(0.0, 2.0 * math.pi)
        # Equal speed in each tone: slow tones go further.
        total += np.sin(2.0 * math.pi * frequency * t + phase) / frequency
    fade = np.minimum(1.0, np.minimum(t, duration - t) / min(2.0, 0.25 * duration))
    total *= np.sin(0.5 * math.pi * np.clip(fade, 0.0, 1.0)) ** 2
    total *= amplitude / max(np.abs(total).max(), 1e-9)
    peak = np.abs(np.diff(total)).max() / STEP
    return start + total * min(1.0, SPEED / peak)


def mixed_motion(duration, rng):
    """Return the positions of strokes at many speeds, multisines and rests, in random order.

    It begins with a sweep through the whole range, so that no recording leaves a part of it out.
    The lowest speed is a fortieth of the highest. Some movements have rests of 0.2 to 5 s between.
    """
    speeds = np.geomspace(SPEED / 40.0, SPEED, 14)
    wanted = round(duration / STEP)
    side = HALF_RANGE * rng.choice([-1.0, 1.0])
    pieces = [stroke(0.0, side, rng.uniform(0.5, 0.8) * SPEED, 0.4),
              stroke(side, -side, rng.uniform(0.5, 0.8) * SPEED, 0.4)]
    here, forwards, deck = -side, side > 0, []
    while sum(map(len, pieces)) < wanted:
        if not deck:
            deck = list(rng.permutation(len(speeds) + 3))
        card = int(deck.pop())
        if card < len(speeds):
            # As far as five seconds lead, and never beyond the range.
            reach = speeds[card] * rng.uniform(2.0, 5.0)
            room = HALF_RANGE - here if forwards else HALF_RANGE + here
            if room < min(reach, 0.3 * HALF_RANGE):
                forwards = not forwards
                room = HALF_RANGE - here if forwards else HALF_RANGE + here
            goal = here + (1.0 if forwards else -1.0) * min(reach, room)
            piece = stroke(here, goal, speeds[card], 0.4)
            if rng.random() < 0.5:
                forwards = not forwards
        else:
            amplitude = rng.uniform(0.4, 1.0) * HALF_RANGE
            centre = float(np.clip(here, amplitude - HALF_RANGE, HALF_RANGE - amplitude))
            piece = np.concatenate((
                stroke(here, centre, 0.5 * SPEED, 0.4),
                multisine(centre, rng.uniform(6.0, 12.0), amplitude, rng)))
        if piece.size:
            pieces.append(piece)
            here = float(piece[-1])
        if rng.random() < 0.5:
            pieces.append(np.full(round(_log(rng, 0.2, 5.0) / STEP), here))
    return np.concatenate(pieces)[:wanted]


def smooth_noise(size, step, rng, bandwidth=0.5):
    """Return noise of unit variance with little power above the bandwidth in Hz, shape (size,)."""
    frequency = np.fft.rfftfreq(size, step)
    spectrum = rng.standard_normal(frequency.size) + 1j * rng.standard_normal(frequency.size)
    spectrum *= np.exp(-0.5 * (frequency / bandwidth) ** 2)
    spectrum[0] = 0.0
    signal = np.fft.irfft(spectrum, size)
    return signal / max(float(signal.std()), 1e-12)


# Drives and recordings.

@dataclass(frozen=True)
class Excitation:
    """What a recording of a simulated drive goes through.

    `duration`: s, of each recording. `rate`: samples a second; must divide 1000. `load`: standard
    deviation of the torque that a person applies, in parts of the friction level; 0 leaves the load
    out. `temperature`: whether the motor's temperature varies, from one recording to the next and
    within. `recordings`: how many are made, each from a cold start of the clock. The joint follows
    its path exactly, so that the current is the sum of sigmoid and undeclared effects; for joints
    under a controller see `second_world`.
    """

    duration: float = 150.0
    rate: float = 500.0
    load: float = 0.0
    temperature: bool = False
    recordings: int = 1


@dataclass(frozen=True)
class SimulatedDrive:
    """A drive as it was drawn.

    `model`: drive and sigmoid, the declared part. `effects`: the undeclared part, as in a file of
    undeclared effects; `variables`: what each depends on. `noise`, `wander`: standard deviations in
    A of the current's white noise and of slow noise that no effect explains. `thermal`: as in
    `undeclared.THERMAL`.
    """

    model: FrictionModel
    effects: list = field(default_factory=list)
    variables: list = field(default_factory=list)
    noise: float = 0.003
    wander: float = 0.0
    thermal: dict = field(default_factory=dict)

    @property
    def noise_floor(self):
        """Error in A that a perfect model would have."""
        return math.hypot(self.noise, self.wander)


def random_drive(seed, cases=()):
    """Draw a drive with some of `CASES`; without any, nothing of it is undeclared."""
    rng = np.random.default_rng([seed, 1])
    drive = Drive(
        torque_constant=float(rng.uniform(0.05, 0.15)), gear_ratio=float(rng.integers(50, 200)),
        encoder_counts=int(rng.choice([2000, 4000, 8192])), current_limit=5.0)
    level = _log(rng, 0.08, 0.6)
    asymmetry = rng.uniform(-0.1, 0.1)
    sigmoid = Sigmoid(
        upper=level * (1 + asymmetry), lower=-level * (1 - asymmetry),
        steepness=_log(rng, 60.0, 400.0), viscous=level * rng.uniform(0.1, 0.6))
    # Of a generator of their own, so that the same seed is the same drive with any effects.
    own = np.random.default_rng([seed, 3])
    effects, variables = [], []
    for name in cases:
        case = CASES[name]
        effects += case.draw(own, level * drive.torque_per_current)
        variables.append(case.variable)
    # Heating: 15 to 25 K above ambient for the current's usual size.
    thermal = {'ambient': float(rng.uniform(20.0, 26.0)), 'time_constant':
               float(rng.uniform(40.0, 120.0)),
               'heating': float(rng.uniform(15.0, 25.0) / (1.3 * level) ** 2)}
    return SimulatedDrive(
        model=FrictionModel(drive=drive, sigmoid=sigmoid, joint='joint'), effects=effects,
        variables=variables, noise=level * float(rng.uniform(0.015, 0.04)),
        wander=level * float(rng.uniform(0.0, 0.01)), thermal=thermal)


def excitation_for(cases, **changes):
    """Return an `Excitation` under which the cases can be seen."""
    wanted = {}
    for name in cases:
        wanted.update(CASES[name].needs)
    return replace(Excitation(), **{**wanted, **changes})


def record(drive, seed, excitation=None):
    """Return recordings of a drive that is moved along a random path.

    `seed`: of path, load, temperature and noise.
    """
    excitation = excitation or Excitation()
    rng = np.random.default_rng([seed, 2])
    trials, start = [], float(rng.uniform(1e3, 1e5))
    for _ in range(excitation.recordings):
        trials.append(_one_recording(drive, rng, excitation, start))
        start += excitation.duration + float(rng.uniform(600.0, 6000.0))
    return trials


def _one_recording(drive, rng, excitation, start):
    position = mixed_motion(excitation.duration, rng)
    size = len(position)
    ratio = drive.model.drive.torque_per_current
    level = 0.5 * (drive.model.sigmoid.upper - drive.model.sigmoid.lower) * ratio
    load = np.zeros(size)
    if excitation.load > 0:
        load = excitation.load * level * smooth_noise(size, STEP, rng)
    thermal = dict(drive.thermal)
    if excitation.temperature:
        thermal['initial'] = float(thermal['ambient'] + rng.uniform(0.0, 30.0))
    else:
        thermal['heating'] = 0.0
    undeclared = Undeclared.from_effects(drive.effects, thermal)
    current, temperature = _tracked(drive, undeclared, position, load)
    keep = slice(None, None, round(1.0 / (STEP * excitation.rate)))
    truth = current[keep]
    count = drive.model.drive.position_resolution
    measured = truth + drive.noise * rng.standard_normal(truth.size)
    measured += drive.wander * smooth_noise(truth.size, 1.0 / excitation.rate, rng, 5.0)
    optional = {'temperature': temperature[keep] + 0.1 * rng.standard_normal(truth.size)}
    if excitation.load > 0:
        optional['load'] = load[keep] + 0.005 * level * rng.standard_normal(truth.size)
    return Samples(
        time=start + np.arange(size)[keep] * STEP,
        position=np.round(position[keep] / count) * count, current=measured,
        joint=drive.model.joint, **optional)


def _tracked(drive, undeclared, position, load):
    """Return current and temperature of a joint that follows the path exactly."""
    sigmoid, ratio = drive.model.sigmoid, drive.model.drive.torque_per_current
    velocity = np.gradient(position, STEP)
    plateau = np.where(velocity >= 0, sigmoid.upper, -sigmoid.lower)
    current, temperature = _required_current(
        position, velocity, np.gradient(velocity, STEP), load, undeclared.table,
        np.zeros(undeclared.memory_size), undeclared.thermal, undeclared.inertia,
        ratio * undeclared.torque_constant_factor, sigmoid(velocity) * ratio,
        (plateau + sigmoid.viscous * np.abs(velocity)) * ratio,
        np.tanh(0.5 * sigmoid.steepness * (velocity - sigmoid.shift)))
    # With torque late by the lag, the current has to be early by it.
    early = round(undeclared.actuation_lag / STEP)
    if early:
        current = np.concatenate((current[early:], np.full(early, current[-1])))
    return current, temperature


@njit(cache=True)
def _required_current(x, v, a, load, table, memory, thermal, inertia, ratio, base, base_level,
                      side):
    """Return current and temperature along a path: torque balance, solved for the current."""
    size = len(x)
    current = np.empty(size)
    temperature = np.empty(size)
    warm, rest = thermal[1], 0.0
    for k in range(size):
        # A path at rest still carries rounding noise.
        resting = abs(v[k]) < 1e-9
        rest = rest + STEP if resting else 0.0
        driving, level = undeclared_torque(
            table, memory, k * STEP, x[k], v[k], load[k], warm, rest, base_level[k])
        level = max(level, -0.95 * base_level[k])
        torque = base[k] + side[k] * level - driving - load[k] + inertia * a[k]
        current[k] = torque / ratio
        warm = warmed_up(warm, current[k], STEP, thermal)
        temperature[k] = warm
    return current, temperature
