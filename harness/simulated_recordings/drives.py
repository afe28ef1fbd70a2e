# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Random drives with undeclared effects, and recordings of them, to try refinement on.

A drive is drawn from one seed, each recording of it from another. What is drawn is kept in the
`SimulatedDrive`; of a recording, refinement gets `SimulatedRecording.samples` and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import math

from numba import njit
import numpy as np

from friction_comp.drive import Drive
from friction_comp.identification.supervised_run import (
    BANDWIDTH,
    Controller,
    controller_state,
    controller_step,
)
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples
from friction_comp.simulation.joint import (
    joint_parameters,
    joint_sample,
    JOINT_STATE,
    MEASURED,
    random_states,
    start_joint,
)
from friction_comp.simulation.undeclared import Undeclared, undeclared_torque, warmed_up
from simulated_recordings.cases import CASES
from simulated_recordings.motion import mixed_motion, smooth_noise

STEP = 1e-3


@dataclass(frozen=True)
class Excitation:
    """What a recording of a simulated drive goes through.

    `duration`: s, of each recording. `rate`: samples a second; must divide 1000. `position_range`,
    `speed`: rad and rad/s. `load`: standard deviation of the torque that a person applies, in parts
    of the friction level; 0 leaves the load out. `temperature`: whether the motor's temperature
    varies, from one recording to the next and within. `recordings`: how many are made, each from a
    cold start of the clock. `servo`: False: the joint follows its path exactly, without inertia, so
    that the current is the sum of sigmoid and undeclared effects. True: the simulated joint, with
    inertia, stiction and presliding, under the velocity controller of identification.
    """

    duration: float = 150.0
    rate: float = 500.0
    position_range: float = 4.0
    speed: float = 1.2
    rests: bool = True
    load: float = 0.0
    temperature: bool = False
    recordings: int = 1
    servo: bool = False


@dataclass(frozen=True)
class SimulatedDrive:
    """A drive as it was drawn.

    `model`: drive and sigmoid, the declared part. `effects`: the undeclared part, as in a file of
    undeclared effects; `variables`: what each depends on. `noise`, `wander`: standard deviations in
    A of the current's white noise and of slow noise that no effect explains. `presliding`: way in
    rad that the joint gives before it slips, and `relative_inertia`: inertia over friction level in
    s²/rad, both for recordings under the servo. `thermal`: as in `undeclared.THERMAL`.
    """

    model: FrictionModel
    effects: list = field(default_factory=list)
    variables: list = field(default_factory=list)
    noise: float = 0.003
    wander: float = 0.0
    presliding: float = 2e-4
    relative_inertia: float = 0.1
    thermal: dict = field(default_factory=dict)

    @property
    def noise_floor(self):
        """Error in A that a perfect model would have."""
        return math.hypot(self.noise, self.wander)


@dataclass(frozen=True)
class SimulatedRecording:
    """A recording and its truth: the current in A before noise, shape (N,)."""

    samples: Samples
    noise_free: np.ndarray


def random_drive(seed, cases=()):
    """Draw a drive with cases of `cases.CASES`; without any, nothing of it is undeclared."""
    rng = np.random.default_rng([seed, 1])
    drive = Drive(
        torque_constant=float(rng.uniform(0.05, 0.15)), gear_ratio=float(rng.integers(50, 200)),
        encoder_counts=int(rng.choice([2000, 4000, 8192])), current_limit=5.0)
    level = math.exp(rng.uniform(math.log(0.08), math.log(0.6)))
    asymmetry = rng.uniform(-0.1, 0.1)
    sigmoid = Sigmoid(
        upper=level * (1 + asymmetry), lower=-level * (1 - asymmetry),
        steepness=math.exp(rng.uniform(math.log(60.0), math.log(400.0))),
        shift=0.0, viscous=level * rng.uniform(0.1, 0.6))
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
        wander=level * float(rng.uniform(0.0, 0.01)),
        presliding=math.exp(rng.uniform(math.log(5e-5), math.log(5e-4))),
        relative_inertia=float(rng.uniform(0.05, 0.15)), thermal=thermal)


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
    position = mixed_motion(
        excitation.duration, STEP, rng, excitation.position_range, excitation.speed,
        excitation.rests)
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
    run = _driven if excitation.servo else _tracked
    position, current, load, temperature = run(drive, undeclared, position, load, rng)
    keep = slice(None, None, round(1.0 / (STEP * excitation.rate)))
    truth = current[keep]
    count = drive.model.drive.position_resolution
    measured = truth + drive.noise * rng.standard_normal(truth.size)
    measured += drive.wander * smooth_noise(truth.size, 1.0 / excitation.rate, rng, 5.0)
    optional = {'temperature': temperature[keep] + 0.1 * rng.standard_normal(truth.size)}
    if excitation.load > 0:
        optional['load'] = load[keep] + 0.005 * level * rng.standard_normal(truth.size)
    samples = Samples(
        time=start + np.arange(size)[keep] * STEP,
        position=np.round(position[keep] / count) * count, current=measured,
        joint=drive.model.joint, **optional)
    return SimulatedRecording(samples=samples, noise_free=truth)


def _tracked(drive, undeclared, position, load, rng):
    """Return position, current, load and temperature of a joint that follows the path exactly."""
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
    return position, current, load, temperature


def _driven(drive, undeclared, path, load, rng):
    """Return position, current, load and temperature of the simulated joint under its servo."""
    model = drive.model
    level = 0.5 * (model.sigmoid.upper - model.sigmoid.lower) * model.drive.torque_per_current
    inertia = level * drive.relative_inertia
    # The person is soft enough to push with the load wanted wherever the joint is on its path.
    softness = 2.0 * level
    parameters = joint_parameters(replace(model, simulation={
        'inertia': inertia, 'presliding_stiffness': level / drive.presliding,
        'current_noise': 0.0,
        'human': {'stiffness': softness, 'damping': 0.0, 'response_time': 0.0,
                  'integral_time': 0.0}}), undeclared)
    # As one would tune it: slower where the drive answers late, for it would swing otherwise.
    bandwidth = BANDWIDTH
    if undeclared.actuation_lag > 0:
        bandwidth = min(bandwidth, 0.4 / undeclared.actuation_lag)
    control = Controller(
        model.drive.torque_per_current / inertia, model.drive.current_limit,
        model.sigmoid.upper, model.sigmoid.lower, bandwidth)
    state, out = np.zeros(1, JOINT_STATE)[0], np.zeros(1, MEASURED)[0]
    random = random_states(int(rng.integers(2 ** 31)), 1)[0]
    start_joint(parameters, state, random)
    return _servo_run(
        parameters, state, out, random, undeclared.table,
        np.zeros(max(1, undeclared.memory_size)), control,
        controller_state(), path, np.gradient(path, STEP),
        path + load / softness, bool(np.any(load != 0)))


@njit(cache=True)
def _servo_run(parameters, state, out, random, table, memory, control, control_state, path, speed,
               person, active):
    size = len(path)
    log = np.zeros((4, size))
    for k in range(size):
        command = controller_step(
            control, control_state, path[k], speed[k], out.position, STEP)
        joint_sample(parameters, state, random, table, memory, STEP, command, person[k], 0.0,
                     active, out)
        log[0, k] = out.position
        log[1, k] = out.current
        log[2, k] = out.interaction_torque
        log[3, k] = out.temperature
    return log[0], log[1], log[2], log[3]


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
