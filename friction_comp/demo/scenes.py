# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The scenes of the demo."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import replace
import importlib.util
import math
from pathlib import Path
from typing import Any

import numpy as np

from friction_comp.arm.fit import refine_arm
from friction_comp.demo import pages
from friction_comp.demo.pages import HandTrial, to_and_fro_page
from friction_comp.demo.processes import SAMPLE_TIME
from friction_comp.demo.system import DemoSystem
from friction_comp.errors import InputError
from friction_comp.evaluation.conditions import evaluate_recordings
from friction_comp.exercise.exercise_script import teach
from friction_comp.files import to_yaml, write_atomically
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import write_arm
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.package_files import package_file
from friction_comp.parallel import child_process
from friction_comp.recordings.reader import read_arm, read_recording
from friction_comp.refinement import refine, RefineResult
from friction_comp.reports.evaluation_page import terminal_lines
from friction_comp.samples import Samples
from friction_comp.terminal import progress

# From the first measurement to the refined model.

JOINT = 'armin_1'
TRUE_MODEL = package_file('config', 'armin_configuration_1.yaml')
UNDECLARED = package_file('config', 'undeclared_example.yaml')
GOAL = {
    'joint': JOINT, 'speeds': [math.radians(v) for v in (15.0, 30.0, 60.0)],
    'motion_range': 1.6, 'ramp_slope': 0.15, 'ramp_period': 3.0, 'breakaway_cycles': 3}
MOVEMENT: dict[str, Any] = {
    'amplitude': math.radians(40.0), 'speed': math.radians(30.0), 'acceleration_time': 0.5,
    'standstill': 1.2, 'announcement': 1.0}
# Folder, title, the compensator's law, and whether the direction is announced.
TRIALS = (
    ('none', 'no compensation', 'none', False),
    ('kinetic', 'kinetic friction only, d = 0', 'kinetic', False),
    ('compensated', 'identified model, d = ±1', 'continuous', True),
    ('refined', 'refined model, d = ±1', 'continuous', True))


def play_loop(system: DemoSystem) -> None:
    """Identify, compensate, evaluate, refine, compensate again."""
    with child_process() as process:
        model_file = _identify(system)
        # In a child process, while the joint is moved.
        refining = process.submit(refined_model, system.recording('identification'), model_file)
        # From now on, the joint's time advances only during an exercise.
        system.ros.set_parameter('plant', 'wait_for_reference', True)
        system.start('compensator', model_file, law='none', wait_for_direction=True)
        for name, title, law, announced in TRIALS:
            if name == 'refined':
                result = _load_refined(system, refining)
            system.ros.set_parameter('compensator', 'law', law)
            system.record(name, f'trial: {title}', announce_direction=announced,
                          repetitions=system.arguments.repetitions, **MOVEMENT)
    system.nodes.stop('compensator', 'plant')
    evaluation, = evaluate_recordings([system.recording(name) for name, *_ in TRIALS])
    report = result.report
    system.finish(
        pages.loop_page(evaluation, result, FrictionModel.load(model_file), UNDECLARED),
        {**evaluation.as_dict(), 'residual': {
            'before': report.before.held_out_rmse, 'after': report.after.held_out_rmse,
            'unit': 'A', 'noise_floor': report.noise_floor},
         'effects': report.content()['effects']},
        *terminal_lines(evaluation))


def _identify(system: DemoSystem) -> Path:
    system.log('starts a simulated joint with effects that its model lacks, and identification')
    # Identification and the recorder listen from the first state on.
    system.start_plant([JOINT], [TRUE_MODEL], UNDECLARED, wait_for_reference=False,
                       wait_for_listeners=2)
    system.start('identification', TRUE_MODEL, output_folder=system.output / 'models')
    system.start_recorder('identification')
    system.wait_for_recorder()
    with progress('identifying') as show:
        result = system.ros.identify(GOAL, lambda feedback: show(
            feedback.progress, f'identifying: {feedback.phase}, '
            f"{feedback.remaining_seconds:.0f} s left of the joint's time"))
    system.nodes.stop('recorder', 'identification')
    system.log(f'identified {JOINT}: breakaway at {1e3 * result.breakaway_positive_mean:.1f} '
               f'and {1e3 * result.breakaway_negative_mean:.1f} mA, '
               f'{len(result.speeds)} points of the friction curve')
    return Path(result.model_file)


def _load_refined(system: DemoSystem, refining: Future[RefineResult]) -> RefineResult:
    system.wait_while('looking for what the model lacks', lambda: not refining.done(), lambda: 0.5)
    result = refining.result()
    path = system.output / 'models' / f'{JOINT}_refined.yaml'
    replace(result.model, joint=JOINT).save(path)
    report = result.report
    effects = ', '.join(f'{effect.name} ({effect.variable})' for effect in report.effects)
    system.log(f'refined: {effects or "nothing"}; error {1e3 * report.before.held_out_rmse:.1f} → '
               f'{1e3 * report.after.held_out_rmse:.1f} mA')
    system.log(f'loads {path.relative_to(system.output.parent)} into the running compensator')
    system.ros.set_parameter('compensator', 'model_files', [str(path)])
    return result


def recorded(path: Path) -> Samples:
    """Return a recording of the simulated joint."""
    drive = FrictionModel.load(TRUE_MODEL).drive
    samples, = read_recording(path, JOINT, drive.torque_constant, drive.gear_ratio)
    return samples


def refined_model(recording: Path, model_file: Path) -> RefineResult:
    """Refine an identified model from its identification, where all current is friction's."""
    model = FrictionModel.load(model_file)
    return refine([recorded(recording)], model, model.drive)


# An arm.

# Joints of the arm, with the note's configuration whose drive they have.
ARM = {'turn': 1, 'lift': 2, 'bend': 1}
# A person who holds the arm at its cuff: N·m/rad, N·m·s/rad, s.
PERSON = {'stiffness': 60.0, 'damping': 6.0, 'response_time': 0.04}


def play_arm(system: DemoSystem) -> None:
    """Teach an arm a movement; replay it alone, and with weight and friction taken by motors."""
    for module, package in (('mujoco', 'mujoco'), ('pinocchio', 'pin')):
        if importlib.util.find_spec(module) is None:
            raise InputError(f'the scene arm needs {module}: pip install {package}')
    exercise = system.output / 'models' / 'taught.yaml'
    drives = {joint: replace(FrictionModel.load(package_file(
        'config', f'armin_configuration_{number}.yaml')), joint=joint)
        for joint, number in ARM.items()}
    files = [system.output / 'models' / f'{joint}.yaml' for joint in ARM]
    for model, path in zip(drives.values(), files):
        replace(model, simulation={**model.simulation, 'human': PERSON}).save(path)
    system.log('starts an arm of three joints that hangs down, moved by MuJoCo, and the '
               'compensator with the models of its drives')
    system.start_plant(list(ARM), files,
                       arm_file=package_file('config', 'arms', 'guided_arm.xml'))
    # One path is recorded, which does not tell of others: it is the one that follows.
    system.start('compensator', *files, law='continuous', accept_record_again=True)
    system.record('taught', 'a person guides it, with help against friction',
                  exercise_file=package_file('config', 'exercises', 'guided_arm.yaml'),
                  announce_direction=False)
    gains = {joint: model.drive.torque_per_current for joint, model in drives.items()}
    guided = _recorded_joints(system.recording('taught'), gains)
    taught, _ = teach(list(ARM), guided['turn'].time, np.column_stack(
        [guided[joint].position for joint in ARM]))
    write_atomically(exercise, to_yaml(taught))
    system.ros.set_parameter('compensator', 'law', 'none')
    system.record('alone', 'the taught exercise, without any help', exercise_file=exercise)
    alone = _recorded_joints(system.recording('alone'), gains)
    with progress('refines the arm') as show:
        result = refine_arm(
            {joint: [samples] for joint, samples in alone.items()},
            package_file('config', 'arms', 'guided_arm.urdf'),
            {joint: model.drive for joint, model in drives.items()}, drives,
            declared=drives, progress=show)
    path = system.output / 'models' / 'arm.yaml'
    write_arm(path, {joint: one.model for joint, one in result.results.items()})
    system.log('refined all joints from that: weight and inertia of the links, in '
               f'{path.relative_to(system.output.parent)}')
    system.ros.set_parameter('compensator', 'model_files', [str(path)] * len(ARM))
    system.ros.set_parameter('compensator', 'law', 'continuous')
    system.record('helped', 'the same, the motors carry the weight and take the friction',
                  exercise_file=exercise)
    system.nodes.stop('compensator', 'plant')

    helped = _recorded_joints(system.recording('helped'), gains)
    peaks = pages.peaks_of(alone, helped)
    system.finish(
        pages.arm_page(alone, helped, result, exercise),
        {'joints': peaks, 'arm': result.report()},
        *(f'{joint}: the person gives {own["alone"]["rms"]:.2f} N·m RMS, '
          f'{own["alone"]["peak"]:.2f} at most, without help; '
          f'{own["helped"]["rms"]:.2f} and {own["helped"]["peak"]:.2f} with it'
          for joint, own in peaks.items()))


def _recorded_joints(path: Path, gains: dict[str, float]) -> dict[str, Samples]:
    """Return a recording of several joints, by joint; `gains` are k_t · n in N·m/A."""
    parts = read_arm(path, gains.__getitem__)
    return {joint: parts[joint][0][0] for joint in gains}


# A hand that moves a joint to and fro.

# Folder, title, law, and whether the exercise announces the direction.
WAYS = (('none', 'no help', 'none', False),
        ('tanh', '0.9 · Coulomb · tanh', 'kinetic', False),
        ('unknown', 'continuous, d = 0', 'continuous', False),
        ('announced', 'continuous, announced', 'continuous', True))


def play_to_and_fro(system: DemoSystem) -> None:
    """Lead a joint to and fro without help, with a hyperbolic tangent, and with the law."""
    system.log('starts a simulated joint with a firm hand, and the compensator')
    model, tanh = (system.output / 'models' / f'{name}.yaml' for name in (JOINT, 'tanh'))
    own = FrictionModel.load(TRUE_MODEL)
    own = replace(own, simulation={**own.simulation, 'human': PERSON})
    own.save(model)
    level = 0.45 * (own.sigmoid.upper - own.sigmoid.lower)
    # Eq. 6 is a hyperbolic tangent, which bends at 0.03 rad/s; the printed law adds nothing to it.
    replace(own, sigmoid=Sigmoid(level, -level, 2.0 / 0.03)).save(tanh)
    system.start_plant([JOINT], [model], wrench_period=SAMPLE_TIME, clock_period=2.0 * SAMPLE_TIME)
    system.start('compensator', model, law='continuous')
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
        to_and_fro_page(trials, inertia),
        {'to_and_fro': [{'name': name, 'rms_torque': trial.rms, 'removed': shares[name]}
                        for name, trial in trials.items()], 'inertia_rms': inertia},
        *(f'{trial.title}: the hand gives {trial.rms:.2f} N·m RMS; {100.0 * shares[name]:.0f} % of '
          'friction removed' for name, trial in trials.items()))
