# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The steps of the tool ``demo`` in their order, each in processes of its own."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
import math
from pathlib import Path
import time
from typing import Any, TYPE_CHECKING

from rich.table import Table

from friction_comp.parallel import child_process
from friction_comp.model.friction_model import FrictionModel
from friction_comp.package_files import package_file
from friction_comp.recordings import read_recording
from friction_comp.refinement import refine
from friction_comp.reports.demo_report import demo_report, EvaluatedTrial, residuals, table_rows
from friction_comp.tools.common import command_line, progress, to_json
from friction_comp.tools.demo_stage import Stage
from friction_comp.tools.processes import Nodes

if TYPE_CHECKING:
    from concurrent.futures import Future

    from friction_comp.nodes.demo_client import DemoClient
    from friction_comp.refinement.refine import RefineResult

JOINT = 'armin_1'
# A quarter of the rate of a real driver, for a quarter of the time. At 1 kHz the peaks are the same
# within 8 %, and the refined model's error is 2.7 mA instead of 3.5.
SAMPLE_TIME, CLOCK_PERIOD = 4e-3, 0.02
GOAL = {
    'joint': JOINT, 'speeds': [math.radians(v) for v in (10.0, 30.0, 60.0)],
    'motion_range': 1.6, 'ramp_slope': 0.15, 'ramp_period': 3.0, 'breakaway_cycles': 3}
MOVEMENT = {'amplitude': math.radians(40.0), 'speed': math.radians(30.0),
            'acceleration_time': 0.5, 'standstill': 2.0, 'announcement': 1.0}
# Folder, name in the table, the compensator's law, and whether the direction is announced.
TRIALS = (
    ('none', 'no compensation', 'none', False),
    ('kinetic', 'kinetic friction only, d = 0', 'kinetic', False),
    ('compensated', 'identified model, d = ±1', 'continuous', True),
    ('refined', 'refined model, d = ±1', 'continuous', True))


class Demo(Stage):
    """The demo's main scene, step by step.

    Parameters
    ----------
    arguments : argparse.Namespace
    nodes : Nodes
    ros : DemoClient
    """

    def __init__(self, arguments: Namespace, nodes: Nodes, ros: DemoClient) -> None:
        super().__init__(arguments, nodes, ros, [JOINT])
        self._true_model = package_file('config', 'armin_configuration_1.yaml')
        self._undeclared = (arguments.undeclared
                            or package_file('config', 'undeclared_example.yaml')).absolute()
        self._trials: list[EvaluatedTrial] = []
        self._recorded: tuple[str, str] | None = None

    def run(self) -> None:
        """Run everything, from the first measurement to the report."""
        with child_process() as beside:
            model_file = self._identify()
            # On the other core, while the joint is moved.
            refined = beside.submit(
                refined_model, self._output / 'recordings' / 'identification', model_file)
            # From now on, the joint's time advances only during an exercise.
            self._ros.set_parameter('plant', 'wait_for_reference', True)
            self._nodes.start('compensator', {**self._common(model_file), 'law': 'none'})
            for trial in TRIALS[:3]:
                self._try(*trial)
            result, refined_file = self._refined(refined)
        self._say(f'loads {self._name(refined_file)} into the running compensator')
        self._ros.set_parameter('compensator', 'model_files', [str(refined_file)])
        self._try(*TRIALS[3])
        self._nodes.stop('compensator', 'plant')
        self._evaluate()
        self._conclude(result, model_file)

    # Steps.

    def _identify(self) -> Path:
        self._say('starts a simulated joint that hides an effect, and identification')
        # Identification and the recorder listen from the first state on.
        self._start_plant(
            [self._true_model], [self._undeclared], SAMPLE_TIME, wait_for_listeners=2,
            clock_period=CLOCK_PERIOD)
        self._nodes.start('identification', {
            **self._common(self._true_model), 'output_folder': str(self._output / 'models')})
        self._record('identification')
        received: list[tuple[float, float]] = []

        with progress('identifies') as show:
            def report(feedback: Any) -> None:
                received.append((feedback.time, time.monotonic()))
                show(feedback.progress, f'identifies: {feedback.phase}, '
                     f"{feedback.remaining_seconds:.0f} s left of the joint's time")
            result = self._ros.identify(GOAL, report)
        if received:
            self._speeds.append((received[-1][0], time.monotonic() - received[0][1]))
        self._nodes.stop('recorder', 'identification')
        self._say(f'identified {JOINT}: breakaway at {1e3 * result.breakaway_positive_mean:.1f} '
                  f'and {1e3 * result.breakaway_negative_mean:.1f} mA, '
                  f'{len(result.speeds)} points of the friction curve')
        return Path(result.model_file)

    def _try(self, name: str, title: str, law: str, announced: bool) -> None:
        """Record a trial; the one before is evaluated while its nodes start."""
        self._ros.set_parameter('compensator', 'law', law)
        self._start_recorder(name)
        self._nodes.start('exercise', {
            'joints': [JOINT], 'clock': 'ticks', 'when_done': 'exit', 'use_sim_time': True,
            'input_reliability': 'reliable', 'announce_direction': announced,
            # The compensator, the recorder, and the demo itself, when all is recorded.
            'wait_for_listeners': 3, 'repetitions': self._arguments.repetitions, **MOVEMENT})
        self._evaluate()
        self._until_recorded()
        with self._ros.hearing_directions():
            self._follow(f'trial: {title}')
        self._nodes.stop('recorder')
        self._recorded = name, title

    def _evaluate(self) -> None:
        """Evaluate the last trial, if that has not been done, and print the result."""
        if self._recorded is None:
            return
        (name, title), self._recorded = self._recorded, None
        trial = EvaluatedTrial(name, title, read_recording(
            self._output / 'recordings' / name, JOINT, *drive_constants(self._true_model))[0])
        self._trials.append(trial)
        self._say(f'trial with {title}: peak {trial.peak} N·m, RMS {trial.rms_torque:.2f} N·m')

    def _refined(self, refined: Future[RefineResult]) -> tuple[RefineResult, Path]:
        """Wait for what the identified model lacks; return the result and the new model's file."""
        with progress('looks for what the model lacks') as show:
            while not refined.done():
                self._ros.wait(0.1)
                show(0.5)
        result = refined.result()
        path = self._output / 'models' / f'{JOINT}_refined.yaml'
        replace(result.model, joint=JOINT).save(path)
        effects = ', '.join(f"{effect['name']} ({effect['variable']})"
                          for effect in result.report['effects']) or 'nothing'
        before, after = residuals(result)
        self._say(f'found meanwhile: {effects}; residual {1e3 * before:.1f} → {1e3 * after:.1f} mA')
        return result, path

    def _conclude(self, refined: RefineResult, model_file: Path) -> None:
        trials = self._trials
        rows = table_rows(trials, refined)
        before, after = residuals(refined)
        effects = refined.report['effects']
        report = demo_report(trials, refined, FrictionModel.load(model_file), self._undeclared)
        report.made_by(command_line('demo', None))
        report.save(self._output / 'report.html')
        simulated = sum(pair[0] for pair in self._speeds)
        real = sum(pair[1] for pair in self._speeds)
        content = {
            'trials': [{'name': trial.name, 'peak_torque': trial.peak_torque,
                        'rms_torque': trial.rms_torque, 'stuck': trial.stuck,
                        'evaluation': trial.evaluation.as_dict()}
                       for trial in trials],
            'residual': {'before': before, 'after': after, 'unit': 'A',
                         'noise_floor': refined.report['noise_floor']},
            'effects': effects, 'lockstep_samples_per_second': simulated / SAMPLE_TIME / real,
            'seconds': time.monotonic() - self._began}
        (self._output / 'report.json').write_text(to_json(content), encoding='utf-8')
        table = Table(title='What it takes to move the joint')
        for index, name in enumerate(('', 'peak (N·m)', 'RMS (N·m)', 'error (mA)')):
            table.add_column(name, justify='right' if index else 'left')
        for row in rows:
            table.add_row(*row)
        self._console.print(table)
        for effect in effects:
            self._console.print(f"effect found: {effect['name']} ({effect['variable']})  "
                                f"{effect.get('in_words', '')}")
        self._console.print(
            f"lockstep: {simulated:.0f} s of the joint's time in {real:.0f} s "
            f'({simulated / SAMPLE_TIME / real:.0f} samples a second); '
            f'whole demo: {content["seconds"]:.0f} s')
        self._console.print(f'report: {self._output / "report.html"}', soft_wrap=True)


def drive_constants(model_file: Path) -> tuple[float, float]:
    """Return torque constant in N·m/A and gear ratio of a model file's drive."""
    drive = FrictionModel.load(model_file).drive
    return drive.torque_constant, drive.gear_ratio


def refined_model(recording: Path, model_file: Path) -> RefineResult:
    """Refine an identified model from the recording of its identification.

    There the joint moves by itself, at many speeds: all current is friction's.
    """
    recordings = read_recording(recording, JOINT, *drive_constants(model_file))
    model = FrictionModel.load(model_file)
    return refine(recordings, model, model.drive)
