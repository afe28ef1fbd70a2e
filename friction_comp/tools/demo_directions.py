# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Scenes of the tool ``demo`` about directions: a person's intention, and a follower.

Both are loops in this process: what they show is the law with directions from the room `direction`.
"""

from __future__ import annotations

from argparse import Namespace
import math
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

from friction_comp.compensation.law import CompensationLaw
from friction_comp.direction.desired_motion import DesiredMotion
from friction_comp.direction.sensed_direction import CALIBRATION_TIME, SensedDirection
from friction_comp.exercise.reference_movement import ReferenceMovement
from friction_comp.model.friction_model import FrictionModel
from friction_comp.package_files import package_file
from friction_comp.reports.direction_scenes import follow_report, intention_report
from friction_comp.results import write_report
from friction_comp.simulation.cheap_sensors import CheapForce, CheapMuscles
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.mit_drive import MitDrive, PERIOD
from friction_comp.tools.common import progress

STEP = 1e-3
# s: the filters settle, and the sensor is calibrated; Hz: of the torque whose peak is compared.
_SETTLE, _BAND = 0.5, 20.0
# Stiffness of the follower's controller, as Coulomb friction over rad; kd as a share of it, s.
_LAG, _DAMPING = 0.03, 0.04
_BEND = 0.02  # rad/s at which the hyperbolic tangents bend
_SPEEDS = (0.01, 0.02, 0.05, 0.1, 0.2)


class _Person:
    """One joint with a person and, perhaps, a sensor."""

    def __init__(self, source: str, seed: int) -> None:
        self.model = FrictionModel.load(package_file('config', 'armin_configuration_2.yaml'))
        self.plant = Plant([self.model], seed)
        self.law = CompensationLaw([self.model])
        self._human = self.model.simulation.get('human', {})
        assert self.model.breakaway is not None
        breakaway = np.array([self.model.breakaway.positive_mean
                              * self.model.drive.torque_per_current])
        self.sensor: Any = None
        if source in ('force', 'muscles'):
            self.sensor = (CheapForce(breakaway, seed, 100.0) if source == 'force'
                           else CheapMuscles(breakaway, seed))
            self.direction = SensedDirection(
                'force' if source == 'force' else 'muscle_raw', self.sensor.range)
        self._rows: list[float] = []
        self._torque = 0.0

    def sense(self, time: float, ahead: tuple[float, float]) -> None:
        """Let the sensor measure for a millisecond; `ahead` is the reference that muscles see."""
        state = self.plant.state
        value = self._torque
        if isinstance(self.sensor, CheapMuscles):
            value = (self._human.get('stiffness', 20.0) * (ahead[0] - state.position[0])
                     + self._human.get('damping', 1.0) * (ahead[1] - state.velocity[0]))
        self._rows.append(float(value))
        if len(self._rows) == 10:
            self.direction.motion.add(time, float(state.position[0]))
            values = self.sensor.sample(np.array(self._rows)[:, None])
            self.direction.add(time, values.reshape(len(values), self.direction.channels))
            self._rows = []

    def advance(self, time: float, direction: float, reference: tuple[float, float]) -> float:
        """Advance by a millisecond and return the person's torque, N·m."""
        state = self.plant.state
        current = self.law.update(time, state.position, state.velocity, [direction])
        state = self.plant.step(current, [reference[0]], [reference[1]])
        self._torque = float(state.interaction_torque[0])
        return self._torque


def _trial(source: str, movement: ReferenceMovement, seed: int, report: Any) -> dict[str, Any]:
    """Return time, position, torque and direction of an exercise with a source of directions."""
    person = _Person(source, seed)
    begin = round((_SETTLE + CALIBRATION_TIME + 0.2) / STEP) if person.sensor is not None else 0
    rows = []
    for k in range(-begin, round(movement.duration / STEP)):
        time = k * STEP
        position, velocity, announced = movement.at(max(time, 0.0))
        direction = float(announced) if source == 'announced' else 0.0
        if person.sensor is not None:
            delay = float(getattr(person.sensor, 'delay', np.zeros(1))[0])
            person.sense(time, movement.at(max(time + delay, 0.0))[:2])
            if k == round(-(CALIBRATION_TIME + 0.1) / STEP):
                person.direction.begin_calibration()
            elif k == round(-0.05 / STEP):
                person.direction.end_calibration()
            direction = float(person.direction.at(time).direction)
        torque = person.advance(time, direction, (position, velocity))
        if k >= 0:
            rows.append((time, person.plant.state.position[0], torque, direction))
            if k % 1000 == 0:
                report(time / movement.duration)
    time_, angle, torque_, said = np.array(rows).T
    smooth = sosfiltfilt(butter(2, _BAND, fs=1.0 / STEP, output='sos'), torque_)
    peaks = []
    for n in range(2 * movement.repetitions):
        part = (time_ >= movement.begins(n)) & (time_ < movement.begins(n) + movement.movement_time)
        peaks.append(float((smooth[part] * (1.0 if n % 2 == 0 else -1.0)).max()))
    return {'time': time_, 'position': angle, 'torque': smooth, 'direction': said,
            'peak': float(np.mean(peaks))}


def play_intention(arguments: Namespace) -> None:
    """Compare a person's peak torque with directions from sensors, announced, and unknown."""
    movement = ReferenceMovement(
        amplitude=math.radians(30.0), standstill=1.5, repetitions=arguments.repetitions)
    trials = {}
    for source in ('unknown', 'force', 'muscles', 'announced'):
        with progress(f'a person moves the joint; direction: {source}') as report:
            trials[source] = _trial(source, movement, arguments.seed, report)
    content = {'peak_torque': {name: one['peak'] for name, one in trials.items()}}
    arguments.output.mkdir(parents=True, exist_ok=True)
    write_report(arguments.output, content, intention_report(trials), arguments.command)
    for name, one in trials.items():
        print(f'direction {name}: peak of the person\'s torque {one["peak"]:.2f} N·m')
    print(f'report: {arguments.output / "report.html"}')


WAYS = ('without', '0.9·tanh of the measured speed', '0.9·tanh of the desired speed', 'the law')


def _follow(way: str, speed: float, seed: int) -> dict[str, Any]:
    """Return how a joint under an MIT-mode controller follows a slow ramp to and fro."""
    model = FrictionModel.load(package_file('config', 'armin_configuration_1.yaml'))
    plant = Plant([model], seed)
    per, coulomb = model.drive.torque_per_current, model.sigmoid.upper
    kp = np.array([coulomb * per / _LAG])
    drive = MitDrive(kp, _DAMPING * kp, np.array([10.0 * coulomb * per]))
    law, leader = CompensationLaw([model], 'desired', sample_time=PERIOD), DesiredMotion()
    points = (0.0, 1.0, 6.0, 7.0, 12.0, 13.0), (0.0, 0.0, 5.0 * speed, 5.0 * speed, 0.0, 0.0)
    current, rows, direction = np.zeros(1), [], 0.0
    for k in range(round(points[0][-1] / STEP)):
        time = k * STEP
        wanted = float(np.interp(time, *points))
        pace = (float(np.interp(time + STEP, *points)) - wanted) / STEP
        if k % round(PERIOD / STEP) == 0:
            state = plant.state
            seen, velocity = drive.reported(state.position, state.velocity)
            if k % 10 == 0:
                leader.motion.add(time, float(seen[0]))
                leader.take(time, wanted)
                direction = float(leader.at(time, float(seen[0])).direction)
            added = {
                'without': np.zeros(1),
                WAYS[1]: 0.9 * coulomb * np.tanh(velocity / _BEND),
                WAYS[2]: 0.9 * coulomb * np.tanh(np.array([pace]) / _BEND)}.get(way)
            if added is None:
                added = law.update(time, seen, None, [direction])
            drive.command(time, np.array([wanted]), np.array([pace]), added * per)
            current = drive.torque(time, seen, velocity) / per
        state = plant.step(current)
        rows.append((time, wanted, float(state.position[0])))
    time_, desired, angle = np.array(rows).T
    error = desired - angle
    ramps = ((time_ > 1.0) & (time_ < 6.0)) | ((time_ > 7.0) & (time_ < 12.0))
    late = [(time_ > begin) & (time_ < begin + 2.5) for begin in (3.5, 9.5)]
    return {'time': time_, 'desired': desired, 'position': angle,
            'rms': float(np.sqrt(np.mean(error[ramps]**2))),
            'stairs': max(float(np.ptp(error[part])) for part in late)}


def play_follow(arguments: Namespace) -> None:
    """Compare a follower on slow references without and with compensation."""
    runs: dict[str, dict[float, dict[str, Any]]] = {way: {} for way in WAYS}
    with progress('a joint follows slow references') as report:
        for k, way in enumerate(WAYS):
            for j, speed in enumerate(_SPEEDS):
                runs[way][speed] = _follow(way, speed, arguments.seed)
                report((k + (j + 1) / len(_SPEEDS)) / len(WAYS))
    content = {way: [{'speed': speed, 'rms': one['rms'], 'stairs': one['stairs']}
                     for speed, one in own.items()] for way, own in runs.items()}
    arguments.output.mkdir(parents=True, exist_ok=True)
    write_report(arguments.output, content, follow_report(runs), arguments.command)
    for way, own in runs.items():
        print(f'{way}: RMS error ' + ', '.join(
            f'{1e3 * one["rms"]:.1f} mrad at {speed:g} rad/s' for speed, one in own.items()))
    print(f'report: {arguments.output / "report.html"}')
