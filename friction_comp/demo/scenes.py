# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The scenes of the demo, and the system of nodes that plays them."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import replace
import importlib.util
import math
import os
from pathlib import Path
import shutil
import time
from typing import Any

import numpy as np
from rich.console import Console

from friction_comp.arm.fit import refine_arm
from friction_comp.demo import pages
from friction_comp.demo.pages import HandTrial, to_and_fro_page
from friction_comp.demo.processes import (
    IN_LOCKSTEP,
    Nodes,
    only_user,
    plant_parameters,
    SAMPLE_TIME,
)
from friction_comp.direction.exercise import teach
from friction_comp.errors import InputError
from friction_comp.evaluation.conditions import evaluate_recordings
from friction_comp.files import package_file, to_yaml, write_atomically, write_report
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import write_arm
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.parallel import child_process
from friction_comp.recordings.reader import read_arm, read_recording
from friction_comp.refinement import refine, RefineResult
from friction_comp.reports.evaluation_page import terminal_lines
from friction_comp.reports.html import Report
from friction_comp.ros.tool_client import ToolClient
from friction_comp.samples import Samples
from friction_comp.terminal import progress

# Folders of a demo's results, and the file that marks them as such: the next demo removes them.
_FOLDERS, _MARKER = ('recordings', 'models', 'logs'), '.demo'


class DemoSystem:
    """The nodes of a demo scene: simulated joints in lockstep and all that acts on them."""

    def __init__(self, arguments: Namespace, nodes: Nodes, ros: ToolClient) -> None:
        self.arguments, self.nodes, self.ros = arguments, nodes, ros
        self.output = arguments.output.absolute()
        self.joints: list[str] = []
        self._console = Console(highlight=False)
        self._start_time = time.monotonic()

    def log(self, text: str) -> None:
        """Print a line with the time since the start."""
        minutes, seconds = divmod(round(time.monotonic() - self._start_time), 60)
        self._console.print(f'[dim]{minutes}:{seconds:02d}[/dim]  {text}')

    def start_plant(self, joints: Sequence[str], models: Sequence[Path],
                    undeclared: Path | None = None, sample_time: float = SAMPLE_TIME,
                    **more: Any) -> None:
        """Start joints that wait for other nodes to listen; parameters of `plant_parameters`."""
        self.joints = list(joints)
        # From the first state on: the compensator, the exercise and the recorder.
        self.nodes.start('plant', {
            **plant_parameters(joints, models, undeclared, 1, sample_time),
            'wait_for_reference': True, 'wait_for_listeners': 3, **more})

    def start(self, name: str, *models: Path, **more: Any) -> None:
        """Start a node that commands the joints, with the model file of each."""
        self.nodes.start(
            name, {'joints': self.joints, 'model_files': models, **IN_LOCKSTEP, **more})

    def start_exercise(self, **more: Any) -> None:
        """Start an exercise that ends by itself."""
        self.nodes.start('exercise', {
            'joints': self.joints, 'clock': 'ticks', 'when_done': 'exit', 'use_sim_time': True,
            'input_reliability': 'reliable', 'wait_for_listeners': 2, **more})

    def start_recorder(self, name: str) -> None:
        """Start to record; see `recording`."""
        self.nodes.start('recorder', {
            'output': self.recording(name), 'use_sim_time': True})

    def record(self, name: str, title: str, **exercise: Any) -> None:
        """Record an exercise."""
        self.log(title)
        self.start_recorder(name)
        # Listeners are compensator and recorder, and the demo itself, when all is recorded.
        self.start_exercise(wait_for_listeners=3, **exercise)
        self.wait_for_recorder()
        with self.ros.subscribed_to_direction():
            self.follow(title)
        self.nodes.stop('recorder')

    def recording(self, name: str) -> Path:
        """Return the path of a recording."""
        return self.output / 'recordings' / name

    def wait_for_recorder(self) -> None:
        """Wait until the recorder receives all messages from now on."""
        # Subscriptions to the command: the plant's and the recorder's. Identification has a
        # publisher only while it commands.
        self.ros.wait_until_connected('current_command', 0, 2)
        self.ros.wait_until_connected('interaction_wrench', 1, 1)
        if self.nodes.running('compensator'):
            # Messages sent before the recorder was discovered would be missing.
            self.ros.forget('compensator')
            self.ros.wait_until(
                lambda: int(self.ros.value('compensator', 'listeners to the command') or 0)
                >= self.ros.node.count_subscribers('current_command'),
                'the compensator and its listeners')

    def wait_while(self, title: str, going: Callable[[], bool], share: Callable[[], float]) -> None:
        """Wait while `going` returns True, and show the share of the work that is done."""
        with progress(title) as show:
            while going():
                self.ros.wait(0.1)
                show(share())

    def exercise_time(self, key: str = 'time [s]') -> float:
        """Return how long the exercise has run, s of simulated time."""
        return float(self.ros.value('exercise', key) or 0.0)

    def follow(self, title: str) -> None:
        """Wait until the exercise is over."""
        self.wait_while(
            title, lambda: self.nodes.running('exercise'),
            lambda: self.exercise_time() / (self.exercise_time('duration [s]') or math.inf))
        self.ros.forget('exercise')

    def finish(self, page: Report, content: dict[str, Any], *lines: Any) -> None:
        """Write page and content as the report, and print lines and the path of the report."""
        seconds = time.monotonic() - self._start_time
        write_report(self.output, {**content, 'seconds': seconds}, page, self.arguments.command)
        for line in lines:
            self._console.print(line, soft_wrap=True)
        self._console.print(f'whole scene: {seconds:.0f} s')
        self._console.print(f'report: {self.output / "report.html"}', soft_wrap=True)


@contextmanager
def open_system(arguments: Namespace) -> Iterator[DemoSystem]:
    """Yield the system of a scene, whose nodes end with the block."""
    output = arguments.output.absolute()
    os.environ['ROS_LOG_DIR'] = str(output / 'logs' / 'ros')
    with only_user(output):
        clear_results(output)
        with Nodes(output / 'logs') as nodes, ToolClient(nodes.check) as ros:
            yield DemoSystem(arguments, nodes, ros)


def clear_results(output: Path) -> None:
    """Remove an earlier demo's results; InputError if the folders hold files of another origin."""
    marker = output / _MARKER
    for name in _FOLDERS:
        if not marker.exists() and (output / name).exists() and (
                not (output / name).is_dir() or any((output / name).iterdir())):
            raise InputError(f'{output / name}: is there already and not of a demo, which would '
                             'remove it: choose another --output')
    output.mkdir(parents=True, exist_ok=True)
    marker.touch()
    for name in _FOLDERS:
        shutil.rmtree(output / name, ignore_errors=True)
        (output / name).mkdir()
    for name in ('report.html', 'report.json', 'repetitions.csv'):
        (output / name).unlink(missing_ok=True)


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
        pages.arm_page(alone, helped, result),
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
