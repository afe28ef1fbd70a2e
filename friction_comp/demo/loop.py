# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The main scene of the demo: from the first measurement to the refined model."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import replace
from functools import partial
import math
from pathlib import Path
from typing import Any

from friction_comp.demo.pages import demo_page, EvaluatedTrial, residuals
from friction_comp.demo.system import DemoSystem
from friction_comp.model.friction_model import FrictionModel
from friction_comp.number_text import aligned
from friction_comp.package_files import package_file
from friction_comp.parallel import child_process
from friction_comp.recordings.reader import read_recording
from friction_comp.refinement import refine, RefineResult
from friction_comp.samples import Samples
from friction_comp.terminal import progress

JOINT = 'armin_1'
TRUE_MODEL = package_file('config', 'armin_configuration_1.yaml')
UNDECLARED = package_file('config', 'undeclared_example.yaml')
GOAL = {
    'joint': JOINT, 'speeds': [math.radians(v) for v in (15.0, 30.0, 60.0)],
    'motion_range': 1.6, 'ramp_slope': 0.15, 'ramp_period': 3.0, 'breakaway_cycles': 3}
MOVEMENT: dict[str, Any] = {
    'amplitude': math.radians(40.0), 'speed': math.radians(30.0), 'acceleration_time': 0.5,
    'standstill': 1.2, 'announcement': 1.0}
# Folder, name in the table, the compensator's law, and whether the direction is announced.
TRIALS = (
    ('none', 'no compensation', 'none', False),
    ('kinetic', 'kinetic friction only, d = 0', 'kinetic', False),
    ('compensated', 'identified model, d = ±1', 'continuous', True),
    ('refined', 'refined model, d = ±1', 'continuous', True))


def play_loop(system: DemoSystem) -> None:
    """Identify, compensate, evaluate, refine, compensate again."""
    trials: list[EvaluatedTrial] = []

    def evaluate(count: int) -> None:
        for name, title, *_ in TRIALS[len(trials):count]:
            trial = EvaluatedTrial(name, title, recorded(system.recording(name)))
            trials.append(trial)
            system.log(f'{title}: peak {trial.peak} N·m, RMS {trial.rms_torque:.2f} N·m')

    with child_process() as process:
        model_file = _identify(system)
        # In a child process, while the joint is moved.
        refining = process.submit(refined_model, system.recording('identification'), model_file)
        # From now on, the joint's time advances only during an exercise.
        system.ros.set_parameter('plant', 'wait_for_reference', True)
        system.start('compensator', model_file, law='none', wait_for_direction=True)
        for done, (name, title, law, announced) in enumerate(TRIALS):
            if name == 'refined':
                result = _load_refined(system, refining)
            system.ros.set_parameter('compensator', 'law', law)
            system.record(name, f'trial: {title}', meanwhile=partial(evaluate, done),
                          announce_direction=announced,
                          repetitions=system.arguments.repetitions, **MOVEMENT)
    system.nodes.stop('compensator', 'plant')
    evaluate(len(TRIALS))
    _conclude(system, trials, result, model_file)


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
    effects = ', '.join(f'{effect.name} ({effect.variable})'
                        for effect in result.report.effects) or 'nothing'
    before, after = residuals(result)
    system.log(f'refined: {effects}; error {1e3 * before:.1f} → {1e3 * after:.1f} mA')
    system.log(f'loads {path.relative_to(system.output.parent)} into the running compensator')
    system.ros.set_parameter('compensator', 'model_files', [str(path)])
    return result


def _conclude(system: DemoSystem, trials: list[EvaluatedTrial], result: RefineResult,
              model_file: Path) -> None:
    before, after = residuals(result)
    effects = result.report.effects
    errors = {'compensated': f'{1e3 * before:.3g}', 'refined': f'{1e3 * after:.3g}'}
    table = aligned([['', 'peak (N·m)', 'RMS (N·m)', 'error (mA)'], *(
        [trial.title, trial.peak, f'{trial.rms_torque:.2f}', errors.get(trial.name, '')]
        for trial in trials)])
    system.finish(
        demo_page(trials, result, FrictionModel.load(model_file), UNDECLARED),
        {'trials': [{'name': trial.name, 'peak_torque': trial.peak_torque,
                     'rms_torque': trial.rms_torque, 'stuck': trial.stuck,
                     'evaluation': trial.evaluation.as_dict()} for trial in trials],
         'residual': {'before': before, 'after': after, 'unit': 'A',
                      'noise_floor': result.report.noise_floor},
         'effects': result.report.content()['effects']},
        *table,
        *(f'effect found: {effect.name} ({effect.variable})  {effect.in_words}'
          for effect in effects))


def recorded(path: Path) -> Samples:
    """Return a recording of the simulated joint."""
    drive = FrictionModel.load(TRUE_MODEL).drive
    samples, = read_recording(path, JOINT, drive.torque_constant, drive.gear_ratio)
    return samples


def refined_model(recording: Path, model_file: Path) -> RefineResult:
    """Refine an identified model from its identification, where all current is friction's."""
    model = FrictionModel.load(model_file)
    return refine([recorded(recording)], model, model.drive)
