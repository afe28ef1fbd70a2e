# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The scene ``arm`` of the tool ``demo``: an arm of three joints that MuJoCo moves."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
import importlib.util
import time
from typing import TYPE_CHECKING

from friction_comp.errors import InputError
from friction_comp.files import write_yaml
from friction_comp.model.arm_document import arm_document
from friction_comp.model.friction_model import FrictionModel
from friction_comp.package_files import package_file
from friction_comp.recordings import read_arm
from friction_comp.refinement.whole_arm import ArmResult, refine_arm
from friction_comp.reports.scene_reports import arm_scene_report, peaks_of
from friction_comp.tools.common import command_line, progress, to_json
from friction_comp.tools.demo_stage import Stage
from friction_comp.tools.processes import Nodes

if TYPE_CHECKING:
    from friction_comp.nodes.demo_client import DemoClient
    from friction_comp.samples import Samples

# The drives of the note's configurations 1 and 2.
JOINTS = {'turn': 1, 'lift': 2, 'bend': 1}
_SAMPLE_TIME, _CLOCK_PERIOD = 4e-3, 0.02
# A person who holds the arm at its cuff: N·m/rad, N·m·s/rad, s.
_PERSON = {'stiffness': 60.0, 'damping': 6.0, 'response_time': 0.04}


class GuidedArm(Stage):
    """A person guides an arm: first alone, then with weight and friction taken by the motors."""

    def __init__(self, arguments: Namespace, nodes: Nodes, ros: DemoClient) -> None:
        for name, module in (('MuJoCo', 'mujoco'), ('Pinocchio', 'pinocchio')):
            if importlib.util.find_spec(module) is None:
                package = {'pinocchio': 'pin'}.get(module, module)
                raise InputError(f'the scene arm needs {name}: pip install {package}')
        super().__init__(arguments, nodes, ros, list(JOINTS))
        self._arm = package_file('config', 'arms', 'guided_arm.xml')
        self._urdf = package_file('config', 'arms', 'guided_arm.urdf')
        self._exercise = package_file('config', 'exercises', 'guided_arm.yaml')
        self._drives = {joint: replace(FrictionModel.load(package_file(
            'config', f'armin_configuration_{number}.yaml')), joint=joint)
            for joint, number in JOINTS.items()}

    def run(self) -> None:
        """Move the arm, learn its weight from that, move it again, and write the report."""
        plant, drives = [], []
        for joint, model in self._drives.items():
            plant.append(self._output / 'models' / f'plant_{joint}.yaml')
            replace(model, simulation={**model.simulation, 'human': _PERSON}).save(plant[-1])
            drives.append(self._output / 'models' / f'drive_{joint}.yaml')
            model.save(drives[-1])
        self._say('starts an arm of three joints that hangs down, moved by MuJoCo, and the '
                  'compensator with the models of its drives')
        # From the first state on: the compensator, the exercise and the recorder.
        self._start_plant(plant, ['', '', ''], _SAMPLE_TIME, wait_for_reference=True,
                          wait_for_listeners=3, clock_period=_CLOCK_PERIOD, engine='mujoco',
                          arm_file=str(self._arm))
        self._nodes.start('compensator', {**self._common(*drives), 'law': 'none'})
        self._move('alone', 'a person guides it without any help')
        alone = self._recorded('alone')
        result = self._refined(alone)
        file = self._output / 'models' / 'arm.yaml'
        write_yaml(file, arm_document({
            joint: one.model.to_dict() for joint, one in result.results.items()}))
        self._say(f'refined all joints from that: weight and inertia of the links, in '
                  f'{self._name(file)}')
        self._ros.set_parameter('compensator', 'model_files', [str(file)] * len(JOINTS))
        self._ros.set_parameter('compensator', 'law', 'continuous')
        self._move('helped', 'the motors carry the weight and take the friction')
        self._nodes.stop('compensator', 'plant')
        self._conclude(alone, self._recorded('helped'), result)

    def _move(self, name: str, title: str) -> None:
        self._record(name)
        self._nodes.start('exercise', {
            'joints': self._joints, 'exercise_file': str(self._exercise), 'clock': 'ticks',
            'when_done': 'exit', 'use_sim_time': True, 'input_reliability': 'reliable',
            'wait_for_listeners': 2})
        self._follow(title)
        self._nodes.stop('recorder')
        self._say(f'moved: {title}')

    def _recorded(self, name: str) -> dict[str, Samples]:
        recorded = read_arm(self._output / 'recordings' / name, lambda joint: self._drives[
            joint].drive.torque_per_current)
        return {joint: recorded[joint][0][0] for joint in JOINTS}

    def _refined(self, alone: dict[str, Samples]) -> ArmResult:
        with progress('refines the arm') as show:
            return refine_arm(
                {joint: [samples] for joint, samples in alone.items()}, self._urdf,
                {joint: model.drive for joint, model in self._drives.items()}, self._drives,
                declared=True, progress=show)

    def _conclude(self, alone: dict[str, Samples], helped: dict[str, Samples],
                  result: ArmResult) -> None:
        page = arm_scene_report(alone, helped, result, self._exercise)
        page.made_by(command_line('demo', None))
        page.save(self._output / 'report.html')
        peaks = peaks_of(alone, helped)
        content = {'joints': peaks, 'arm': result.report(),
                   'seconds': time.monotonic() - self._began}
        (self._output / 'report.json').write_text(to_json(content), encoding='utf-8')
        for joint, own in peaks.items():
            self._console.print(
                f'{joint}: the person gives {own["alone"]["rms"]:.2f} N·m RMS, '
                f'{own["alone"]["peak"]:.2f} at most, without help; '
                f'{own["helped"]["rms"]:.2f} and {own["helped"]["peak"]:.2f} with it')
        self._console.print(f'report: {self._output / "report.html"}', soft_wrap=True)
