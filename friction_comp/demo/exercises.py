# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Scenes of the demo with several joints: an exercise with reversals, and an arm."""

from __future__ import annotations

from dataclasses import replace
import importlib.util
from pathlib import Path

import numpy as np

from friction_comp.arm.whole_arm import refine_arm
from friction_comp.demo import pages
from friction_comp.demo.system import DemoSystem
from friction_comp.errors import InputError
from friction_comp.evaluation.conditions import evaluate_recordings
from friction_comp.exercise.taught_exercise import teach
from friction_comp.files import to_yaml, write_atomically
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import write_arm
from friction_comp.package_files import package_file
from friction_comp.recordings.reader import read_arm
from friction_comp.reports.evaluation_page import evaluation_page, peaks_of
from friction_comp.reports.html import without_marks
from friction_comp.samples import Samples
from friction_comp.terminal import progress

# Joints of the arm, with the note's configuration whose drive they have.
ARM = {'turn': 1, 'lift': 2, 'bend': 1}
# A person who holds the arm at its cuff: N·m/rad, N·m·s/rad, s.
PERSON = {'stiffness': 60.0, 'damping': 6.0, 'response_time': 0.04}


def play_two_joints(system: DemoSystem) -> None:
    """Play an exercise with reversals, without and with the directions announced."""
    joints = ['shoulder', 'elbow']
    models = [package_file('config', f'armin_configuration_{k}.yaml') for k in (1, 2)]
    exercise = package_file('config', 'exercises', 'two_joints.yaml')
    system.log('starts two simulated joints, a shoulder and an elbow, and the compensator')
    system.start_plant(joints, models)
    system.start('compensator', *models, law='kinetic')
    for law, title in (('kinetic', 'kinetic friction only'),
                       ('continuous', 'each direction announced as it changes')):
        system.ros.set_parameter('compensator', 'law', law)
        system.record(law, title, system.arguments.repetitions, exercise_file=exercise)
    system.nodes.stop('compensator', 'plant')

    evaluations = evaluate_recordings([system.output / 'recordings'])
    gains = {joint: FrictionModel.load(path).drive.torque_per_current
             for joint, path in zip(joints, models)}
    shown = _recorded_joints(system.recording('continuous'), gains)
    page = evaluation_page(evaluations, f'Two joints that reverse on the way: {exercise.stem}')
    page.heading('The exercise')
    page.figure(pages.exercise_figure(shown), 'Positions shown to the person (broken) and of the '
                'joints, and announced directions.')
    compared = {one.joint: peaks_of(one) for one in evaluations}
    system.finish(
        page, {'joints': [one.as_dict() for one in evaluations]},
        *(without_marks('{}: peak {} with kinetic friction only, {} with the direction announced'
                        .format(joint, *peaks.texts()))
          for joint, peaks in compared.items() if peaks))


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
