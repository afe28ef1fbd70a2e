# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Further scenes of the tool ``demo``: two joints with reversals, and a drive that changes."""

from __future__ import annotations

from argparse import Namespace
import csv
import math
from pathlib import Path
import time
from typing import Any, TYPE_CHECKING

from friction_comp.errors import InputError
from friction_comp.evaluation.sessions import evaluate_recordings
from friction_comp.model.friction_model import FrictionModel
from friction_comp.package_files import package_file
from friction_comp.recordings import read_arm, read_recording
from friction_comp.reports.evaluation_words import compared_peaks
from friction_comp.reports.scene_reports import (
    effort,
    stages_of,
    two_joints_report,
    wear_report,
    wear_words,
)
from friction_comp.tools.common import progress, to_json
from friction_comp.tools.demo_stage import Stage
from friction_comp.tools.processes import Nodes

if TYPE_CHECKING:
    from friction_comp.nodes.demo_client import DemoClient

_SAMPLE_TIME = 4e-3


class TwoJoints(Stage):
    """An exercise from YAML with reversals, without and with the directions announced."""

    def __init__(self, arguments: Namespace, nodes: Nodes, ros: DemoClient) -> None:
        super().__init__(arguments, nodes, ros, ['shoulder', 'elbow'])
        self._models = [package_file('config', f'armin_configuration_{k}.yaml') for k in (1, 2)]
        self._exercise = package_file('config', 'exercises', 'two_joints.yaml')

    def run(self) -> None:
        """Move with each law, evaluate, and write the report."""
        self._say('starts two simulated joints, a shoulder and an elbow, and the compensator')
        # From the first state on: the compensator, the exercise and the recorder.
        self._start_plant(self._models, ['', ''], _SAMPLE_TIME, wait_for_reference=True,
                          wait_for_listeners=3, clock_period=0.02)
        self._nodes.start('compensator', {**self._common(*self._models), 'law': 'kinetic'})
        for law, title in (('kinetic', 'kinetic friction only'),
                           ('continuous', 'each direction announced as it changes')):
            self._ros.set_parameter('compensator', 'law', law)
            self._record(law)
            for k in range(self._arguments.repetitions):
                self._nodes.start('exercise', {
                    'joints': self._joints, 'exercise_file': str(self._exercise),
                    'clock': 'ticks', 'when_done': 'exit', 'use_sim_time': True,
                    'input_reliability': 'reliable', 'wait_for_listeners': 2})
                self._follow(f'{title}, {k + 1} of {self._arguments.repetitions}')
            self._nodes.stop('recorder')
            self._say(f'moved with {title}')
        self._nodes.stop('compensator', 'plant')
        self._conclude()

    def _conclude(self) -> None:
        folder = self._output / 'recordings'
        evaluations = evaluate_recordings([folder])
        gains = {joint: FrictionModel.load(path).drive.torque_per_current
                 for joint, path in zip(self._joints, self._models)}
        recorded = read_arm(folder / 'continuous', gains.__getitem__)
        shown = {joint: recorded[joint][0][0] for joint in self._joints}
        report = two_joints_report(evaluations, shown, self._exercise)
        report.save(self._output / 'report.html')
        content = {'joints': [one.as_dict() for one in evaluations],
                   'seconds': time.monotonic() - self._began}
        (self._output / 'report.json').write_text(to_json(content), encoding='utf-8')
        for one in evaluations:
            before, after = compared_peaks(one) or ('–', '–')
            self._console.print(f'{one.joint}: peak {before} N·m with kinetic friction only, '
                                f'{after} N·m with the direction announced')
        self._console.print(f'report: {self._output / "report.html"}', soft_wrap=True)


class Wear(Stage):
    """A drive whose friction grows while it runs; the loop is closed without a restart."""

    joint = 'armin_1'
    movement = {'amplitude': math.radians(40.0), 'speed': math.radians(30.0),
                'acceleration_time': 0.5, 'standstill': 1.0, 'announcement': 0.7}
    period = 2.0 * (1.0 + 40.0 / 30.0 + 0.5)
    # Half of the default tolerance, so that the change is detected early.
    tolerance = 0.125
    # Coarser than elsewhere, since refinement and the loop share the machine.
    sample_time, clock_period = 4e-3, 0.02
    # s of simulated time within which a warning must come; s of movement before refinement, in
    # which the drive reaches nearly its final temperature. In the first half of the warm-up,
    # effects of temperature and of speed cannot always be distinguished, and a model that confuses
    # them is wrong once the drive is warmer.
    patience, past = 400.0, 40.0

    def __init__(self, arguments: Namespace, nodes: Nodes, ros: DemoClient) -> None:
        super().__init__(arguments, nodes, ros, [self.joint])
        self._model = package_file('config', 'armin_configuration_1.yaml')
        self._hidden = (arguments.undeclared
                        or package_file('config', 'binding_example.yaml')).absolute()
        self._marks: dict[str, float] = {}

    def run(self) -> None:
        """Move until the watch warns, refine, load, move on, and write the report."""
        self._say('starts a joint whose gear binds as it warms, the compensator with the model of '
                  'the cold drive, and the node that watches the residual')
        # From the first state on: the compensator, the refinement, the exercise and the recorder.
        self._start_plant([self._model], [self._hidden], self.sample_time, wait_for_reference=True,
                          wait_for_listeners=4, clock_period=self.clock_period)
        common = self._common(self._model)
        self._nodes.start('compensator', common)
        self._nodes.start('refinement', {
            'joints': self._joints, 'model_files': [str(self._model)], 'use_sim_time': True,
            'tolerance': self.tolerance, 'output_folder': str(self._output / 'models')})
        self._record('session')
        self._nodes.start('exercise', {
            'joints': self._joints, 'clock': 'ticks', 'use_sim_time': True,
            # The compensator, the recorder and the refinement.
            'input_reliability': 'reliable', 'wait_for_listeners': 3,
            'repetitions': 1000, **self.movement})
        warning = self._until_warned()
        self._say(f'warned after {self._marks["warned"]:.0f} s of movement: {warning}')
        self._gather()
        result = self._refine()
        self._say(f'{result.message}; verdict: {result.verdict}')
        self._marks['loaded'] = self._now()
        words = self._judged()
        self._say(f'now {words}')
        self._nodes.stop('exercise', 'recorder', 'refinement', 'compensator', 'plant')
        self._conclude(result, warning, words)

    def _now(self) -> float:
        return float(self._ros.value('exercise', 'time [s]') or 0.0)

    def _until_warned(self) -> str:
        key = f'{self.joint}: residual'
        with progress('moves, and watches the residual') as show:
            while 'no longer fits' not in (words := self._ros.value('refinement', key) or ''):
                self._ros.wait(0.1)
                show(self._now() / self.patience, f'moves; {words}')
                if self._now() > self.patience:
                    raise InputError(f'no warning within {self.patience:.0f} s of movement: '
                                     f'{words or "the watch says nothing"}')
        self._marks['warned'] = self._now()
        return str(words)

    def _gather(self) -> None:
        """Keep moving until there are enough data to refine from."""
        with progress('moves on, to have enough to refine from') as show:
            while (now := self._now()) < self.past:
                self._ros.wait(0.1)
                show(now / self.past)

    def _judged(self) -> str:
        """Keep moving with the refined model until the watch has a verdict; return its words."""
        begin, least = self._now(), self._arguments.repetitions * self.period + 1.0
        words = ''
        with progress('moves on with the refined model') as show:
            while (passed := self._now() - begin) < least or (
                    not words.startswith('the model') and passed < self.patience):
                self._ros.wait(0.1)
                words = str(self._ros.value('refinement', f'{self.joint}: residual') or '')
                show(passed / max(least, 0.1 * self.patience))
        return words

    def _refine(self) -> Any:
        """Refine from all that the node has kept, while the joint moves on."""
        # A loop that runs as fast as it can would leave little processor time to refinement.
        self._ros.set_parameter('plant', 'pace', 1.0)
        with progress('refines beside the running loop') as show:
            result = self._ros.refine(
                {'joint': self.joint, 'seconds': 0.0, 'load': True},
                lambda feedback: show(feedback.progress, f'refines: {feedback.step}'))
        self._ros.set_parameter('plant', 'pace', 0.0)
        if not result.loaded:
            raise InputError(f'the refined model was not loaded: {result.message}')
        return result

    def _conclude(self, result: Any, warning: str, words: str) -> None:
        path = self._output / 'recordings' / 'session'
        evaluation, = evaluate_recordings([path], self.joint)
        stages = stages_of(evaluation, self._marks, self._arguments.repetitions)
        effects = [f'{effect.name.replace("_", " ")} ({effect.variable})'
                 for effect in FrictionModel.load(result.model_file).effects]
        facts = {
            'warning': warning, 'afterwards': words, 'message': result.message,
            'verdict': result.verdict, 'error_before': result.error_before,
            'error_after': result.error_after, 'found': effects, 'report': str(Path(result.report))}
        drive = FrictionModel.load(self._model).drive
        samples, = read_recording(
            path, self.joint, drive.torque_constant, drive.gear_ratio)
        page = wear_report(evaluation, stages, self._marks, facts, samples, self._hidden)
        page.save(self._output / 'report.html')
        content = {**facts, 'marks': self._marks,
                   'rms_torque': {name: effort(part).as_dict() for name, part in stages.items()},
                   'seconds': time.monotonic() - self._began}
        (self._output / 'report.json').write_text(to_json(content), encoding='utf-8')
        with (self._output / 'repetitions.csv').open('w', newline='', encoding='utf-8') as stream:
            csv.writer(stream, lineterminator='\n').writerows(evaluation.table())
        self._console.print(wear_words(stages, facts).replace('**', ''))
        self._console.print(f'report: {self._output / "report.html"}', soft_wrap=True)
