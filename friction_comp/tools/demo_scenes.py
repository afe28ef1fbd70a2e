# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Further scenes of the tool ``demo``: two joints, an arm, and a drive that changes."""

from __future__ import annotations

from dataclasses import replace
import importlib.util
import math
from pathlib import Path
from typing import Any

from friction_comp.arm.whole_arm import refine_arm
from friction_comp.errors import InputError
from friction_comp.evaluation.conditions import repetitions_csv
from friction_comp.evaluation.sessions import evaluate_recordings
from friction_comp.exercise.exercise_script import load_exercise
from friction_comp.model.arm_file import write_arm
from friction_comp.model.friction_model import FrictionModel
from friction_comp.package_files import package_file
from friction_comp.recordings import read_arm
from friction_comp.reports import scene_reports as pages
from friction_comp.reports.evaluation_words import compared_peaks
from friction_comp.samples import Samples
from friction_comp.tools.common import progress
from friction_comp.tools.demo_loop import JOINT, recorded, TRUE_MODEL
from friction_comp.tools.demo_system import DemoSystem
from friction_comp.tools.teach import main as teach

# Joints of the arm, with the note's configuration whose drive they have.
ARM = {'turn': 1, 'lift': 2, 'bend': 1}
# A person who holds the arm at its cuff: N·m/rad, N·m·s/rad, s.
PERSON = {'stiffness': 60.0, 'damping': 6.0, 'response_time': 0.04}
# The effect of the drive that changes, which only the plant knows.
BINDING = package_file('config', 'binding_example.yaml')
# The movement of the drive that changes, and the duration of one forth and back, s.
WEAR_MOVEMENT: dict[str, Any] = {
    'amplitude': math.radians(40.0), 'speed': math.radians(30.0), 'acceleration_time': 0.5,
    'standstill': 1.0, 'announcement': 0.7}
WEAR_PERIOD = 2.0 * (1.0 + 40.0 / 30.0 + 0.5)
# Half of the default tolerance, so that the change is detected early.
WEAR_TOLERANCE = 0.125
# s of simulated time within which a warning must come; s of movement before refinement, in which
# the drive nearly reaches its final temperature: earlier, effects of temperature and of speed look
# alike.
WEAR_PATIENCE, WEAR_PAST = 400.0, 40.0
# Simulated per real time during refinement, which needs processor time.
WEAR_PACE = 1.0


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
    peaks = {one.joint: compared_peaks(one) or ('–', '–') for one in evaluations}
    system.finish(
        pages.two_joints_report(evaluations, shown, exercise),
        {'joints': [one.as_dict() for one in evaluations]},
        *(f'{joint}: peak {before} N·m with kinetic friction only, {after} N·m with the direction '
          'announced' for joint, (before, after) in peaks.items()))


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
    system.start_plant(list(ARM), files, engine='mujoco',
                       arm_file=package_file('config', 'arms', 'guided_arm.xml'))
    system.start('compensator', *files, law='continuous')
    system.record('taught', 'a person guides it, with help against friction',
                  exercise_file=package_file('config', 'exercises', 'guided_arm.yaml'),
                  announce_direction=False)
    teach([str(system.recording('taught')), '--output', str(exercise)])
    system.ros.set_parameter('compensator', 'law', 'none')
    system.record('alone', 'the taught exercise, without any help', exercise_file=exercise)
    gains = {joint: model.drive.torque_per_current for joint, model in drives.items()}
    guided, alone = (_recorded_joints(system.recording(name), gains)
                     for name in ('taught', 'alone'))
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
    taught = pages.compared_with_taught(load_exercise(exercise), {
        'guided': guided, 'alone': alone, 'helped': helped})
    system.finish(
        pages.arm_scene_report(alone, helped, result, exercise, taught),
        {'joints': peaks, 'arm': result.report(), 'taught': taught},
        pages.taught_words(taught),
        *(f'{joint}: the person gives {own["alone"]["rms"]:.2f} N·m RMS, '
          f'{own["alone"]["peak"]:.2f} at most, without help; '
          f'{own["helped"]["rms"]:.2f} and {own["helped"]["peak"]:.2f} with it'
          for joint, own in peaks.items()))


def _recorded_joints(path: Path, gains: dict[str, float]) -> dict[str, Samples]:
    """Return a recording of several joints, by joint; `gains` are k_t · n in N·m/A."""
    parts = read_arm(path, gains.__getitem__)
    return {joint: parts[joint][0][0] for joint in gains}


def play_wear(system: DemoSystem) -> None:
    """Move a joint whose friction grows until a warning comes; refine, load, and move on."""
    system.log('starts a joint whose gear binds as it warms, the compensator with the model of '
               'the cold drive, and the node that monitors the residual')
    # The refinement listens, too.
    system.start_plant([JOINT], [TRUE_MODEL], BINDING, wait_for_listeners=4)
    system.start('compensator', TRUE_MODEL)
    system.nodes.start('refinement', {
        'joints': [JOINT], 'model_files': [TRUE_MODEL], 'use_sim_time': True,
        'tolerance': WEAR_TOLERANCE, 'output_folder': system.output / 'models'})
    system.start_recorder('session')
    system.wait_for_recorder()
    system.start_exercise(wait_for_listeners=3, repetitions=1000, **WEAR_MOVEMENT)
    warning = _wait_for_warning(system)
    marks = {'warned': system.exercise_time()}
    system.log(f'warned after {marks["warned"]:.0f} s of movement: {warning}')
    system.wait_while('moves on, to have enough to refine from',
                      lambda: system.exercise_time() < WEAR_PAST,
                      lambda: system.exercise_time() / WEAR_PAST)
    result = _refine_live(system)
    system.log(f'{result.message}; verdict: {result.verdict}')
    marks['loaded'] = system.exercise_time()
    afterwards = _wait_for_verdict(system, marks['loaded'])
    system.log(f'now {afterwards}')
    system.nodes.stop('exercise', 'recorder', 'refinement', 'compensator', 'plant')

    evaluation, = evaluate_recordings([system.recording('session')], JOINT)
    phases = pages.session_phases(evaluation, marks, system.arguments.repetitions)
    facts = {
        'warning': warning, 'afterwards': afterwards, 'message': result.message,
        'verdict': result.verdict, 'error_before': result.error_before,
        'error_after': result.error_after, 'report': result.report,
        'found': [f'{name.replace("_", " ")} ({variable})'
                  for name, variable in zip(result.effects, result.variables)]}
    (system.output / 'repetitions.csv').write_text(
        repetitions_csv([evaluation]), encoding='utf-8')
    system.finish(
        pages.wear_report(evaluation, phases, marks, facts, recorded(system.recording('session')),
                    BINDING),
        {**facts, 'marks': marks,
         'rms_torque': {name: pages.mean_figure(part).as_dict() for name, part in phases.items()}},
        pages.wear_words(phases, facts).replace('**', ''))


def _residual(system: DemoSystem) -> str:
    return system.ros.value('refinement', f'{JOINT}: residual') or ''


def _wait_for_warning(system: DemoSystem) -> str:
    system.wait_while(
        'moves until the model no longer fits',
        lambda: ('no longer fits' not in _residual(system)
                 and system.exercise_time() < WEAR_PATIENCE),
        lambda: system.exercise_time() / WEAR_PATIENCE)
    words = _residual(system)
    if 'no longer fits' not in words:
        raise InputError(f'no warning within {WEAR_PATIENCE:.0f} s of movement: '
                         f'{words or "the monitoring says nothing"}')
    return words


def _refine_live(system: DemoSystem) -> Any:
    system.ros.set_parameter('plant', 'pace', WEAR_PACE)
    with progress('refines beside the running loop') as show:
        result = system.ros.refine(
            {'joint': JOINT, 'seconds': 0.0, 'load': True},
            lambda feedback: show(feedback.progress, f'refines: {feedback.step}'))
    system.ros.set_parameter('plant', 'pace', 0.0)
    if not result.loaded:
        raise InputError(f'the refined model was not loaded: {result.message}')
    return result


def _wait_for_verdict(system: DemoSystem, begin: float) -> str:
    """Keep moving with the refined model until the monitoring has a verdict."""
    least = system.arguments.repetitions * WEAR_PERIOD + 1.0

    def going() -> bool:
        passed = system.exercise_time() - begin
        return passed < least or (
            not _residual(system).startswith('the model') and passed < WEAR_PATIENCE)
    system.wait_while('moves on with the refined model', going,
                      lambda: (system.exercise_time() - begin) / max(least, 0.1 * WEAR_PATIENCE))
    return _residual(system)
