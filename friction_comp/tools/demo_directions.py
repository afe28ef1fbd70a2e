# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Scenes of the tool ``demo`` about the hand: to and fro, and a direction that only it knows."""

from __future__ import annotations

from dataclasses import replace
import math
from pathlib import Path
from typing import Any

from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.package_files import package_file
from friction_comp.reports.direction_scenes import HandTrial, intention_report, to_and_fro_report
from friction_comp.simulation.cheap_sensors import CheapForce, CheapMuscles
from friction_comp.tools.demo_loop import JOINT, recorded, TRUE_MODEL
from friction_comp.tools.demo_scenes import PERSON
from friction_comp.tools.demo_system import DemoSystem
from friction_comp.tools.processes import IN_LOCKSTEP, SAMPLE_TIME

# Folder, title, law, and whether the exercise announces the direction.
WAYS = (('none', 'no help', 'none', False),
        ('tanh', '0.9 · Coulomb · tanh', 'kinetic', False),
        ('unknown', 'continuous, d = 0', 'continuous', False),
        ('announced', 'continuous, announced', 'continuous', True))
BEND = 0.03
"""rad/s at which the hyperbolic tangent bends."""
# Source of the direction, by the name of the recording.
SOURCES = {'unknown': 'nobody knows where to', 'force': 'a force sensor tells',
           'muscles': 'the muscles tell', 'announced': 'announced'}
# Kind and range of a sensor, and the recordings with a joint that has it: its own comes first.
SENSORS = (('force', CheapForce.range, ('force', 'unknown', 'announced')),
           ('muscle_raw', CheapMuscles.range, ('muscles',)))
# The movement of the person whom sensors watch.
ATTEMPTS: dict[str, Any] = {
    'amplitude': math.radians(30.0), 'speed': math.radians(30.0), 'standstill': 1.5}
TICK = 2.0 * SAMPLE_TIME
"""s between ticks of /clock, references and announcements."""


def play_to_and_fro(system: DemoSystem) -> None:
    """Lead a joint to and fro without help, with a hyperbolic tangent, and with the law."""
    system.log('starts a simulated joint with a firm hand, and the compensator')
    model, tanh = (system.output / 'models' / f'{name}.yaml' for name in (JOINT, 'tanh'))
    own = FrictionModel.load(TRUE_MODEL)
    own = replace(own, simulation={**own.simulation, 'human': PERSON})
    own.save(model)
    level = 0.45 * (own.sigmoid.upper - own.sigmoid.lower)
    # Eq. 6 is a hyperbolic tangent; the printed law adds nothing to it.
    replace(own, sigmoid=Sigmoid(level, -level, 2.0 / BEND)).save(tanh)
    _start(system, model)
    for name, title, law, announced in WAYS:
        system.ros.set_parameter('compensator', 'model_files', [
            str(tanh if name == 'tanh' else model)])
        system.ros.set_parameter('compensator', 'law', law)
        system.record(name, title, announce_direction=announced,
                      exercise_file=package_file('config', 'exercises', 'to_and_fro.yaml'))
    system.nodes.stop('compensator', 'plant')

    trials = {name: HandTrial(title, recorded(system.recording(name)))
              for name, title, *_ in WAYS}
    inertia = trials['none'].inertial_rms(own.simulation['inertia'])
    shares = {name: trial.removed(trials['none'], inertia) for name, trial in trials.items()}
    system.finish(
        to_and_fro_report(trials, inertia),
        {'to_and_fro': [{'name': name, 'rms_torque': trial.rms, 'removed': shares[name]}
                        for name, trial in trials.items()], 'inertia_rms': inertia},
        *(f'{trial.title}: the hand gives {trial.rms:.2f} N·m RMS; {100.0 * shares[name]:.0f} % of '
          'friction removed' for name, trial in trials.items()))


def play_intention(system: DemoSystem) -> None:
    """Move a joint whose direction nobody knows, sensors tell, or the exercise announces."""
    for kind, span, sources in SENSORS:
        system.log(f'starts a simulated joint with a sensor of the person, {kind}, its '
                   'calibration at rest, and the compensator')
        _start(system, TRUE_MODEL, sensor=kind, wait_for_direction=True, wait_for_listeners=4)
        system.nodes.start('direction', {
            'joints': [JOINT], 'source': 'sensor', 'sensor': kind, 'sensor_range': list(span),
            'rate': 1.0 / SAMPLE_TIME, 'calibrate_at_start': True,
            'use_sim_time': True, 'input_reliability': IN_LOCKSTEP['input_reliability']})
        # Time goes only during an exercise: every run of the scene meets the same noise.
        system.record(f'{kind}_calibration', f'calibrates at rest: {kind}', silent=True,
                      exercise_file=package_file('config', 'exercises', 'rest.yaml'))
        for source in sources:
            sensed = system.nodes.running('direction')
            system.record(source, f'a person moves the joint: {SOURCES[source]}', silent=sensed,
                          announce_direction=source == 'announced',
                          repetitions=system.arguments.repetitions, **ATTEMPTS)
            # The sensor is the source of the first movements only.
            system.ros.set_parameter('plant', 'wait_for_direction', False)
            system.nodes.stop('direction')
        system.nodes.stop('compensator', 'plant')

    trials = {name: HandTrial(title, recorded(system.recording(name)))
              for name, title in SOURCES.items() if any(name in row[-1] for row in SENSORS)}
    system.finish(
        intention_report(trials),
        {'peak_torque': {name: trial.peak for name, trial in trials.items()}},
        *(f"{trial.title}: peak of the person's torque {trial.peak:.2f} N·m"
          for trial in trials.values()))


def _start(system: DemoSystem, model: Path, **more: Any) -> None:
    system.start_plant([JOINT], [model], wrench_period=SAMPLE_TIME, clock_period=TICK, **more)
    system.start('compensator', model, law='continuous')
