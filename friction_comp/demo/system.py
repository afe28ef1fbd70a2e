# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Starts, follows and stops the nodes of a demo scene, and writes its report."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import math
import os
from pathlib import Path
import shutil
import time
from typing import Any

from rich.console import Console

from friction_comp.demo.processes import (
    IN_LOCKSTEP,
    Nodes,
    only_user,
    plant_parameters,
    SAMPLE_TIME,
)
from friction_comp.errors import InputError
from friction_comp.reports.html import Report
from friction_comp.results import write_report
from friction_comp.ros.tool_client import ToolClient
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
            **plant_parameters(joints, models, undeclared, self.arguments.seed, sample_time),
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
