# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Starts, follows and stops the nodes of a demo scene."""

from __future__ import annotations

from abc import ABC, abstractmethod
from argparse import Namespace
from collections.abc import Callable, Sequence
import math
import os
from pathlib import Path
import shutil
import subprocess
import sys
import time
from typing import Any, TYPE_CHECKING

from rich.console import Console

from friction_comp.errors import InputError
from friction_comp.tools.common import progress
from friction_comp.tools.processes import Nodes

if TYPE_CHECKING:
    from friction_comp.nodes.demo_client import DemoClient


class Stage(ABC):
    """Simulated joints in lockstep, the nodes around them, and a clock for what is said.

    Parameters
    ----------
    arguments : argparse.Namespace
    nodes : Nodes
    ros : DemoClient
    joints : list of str
    """

    def __init__(self, arguments: Namespace, nodes: Nodes, ros: DemoClient,
                 joints: Sequence[str]) -> None:
        self._arguments, self._nodes, self._ros = arguments, nodes, ros
        self._joints = list(joints)
        self._output = arguments.output.absolute()
        self._console = Console(highlight=False)
        self._began = time.monotonic()
        # Simulated and real time spent waiting, s.
        self._speeds: list[tuple[float, float]] = []

    @abstractmethod
    def run(self) -> None:
        """Run the scene, to its report."""

    def _say(self, text: str) -> None:
        minutes, seconds = divmod(round(time.monotonic() - self._began), 60)
        self._console.print(f'[dim]{minutes}:{seconds:02d}[/dim]  {text}')

    def _name(self, path: Path) -> str:
        return os.path.relpath(path, self._output.parent)

    def _common(self, *model_files: Path) -> dict[str, Any]:
        return {'joints': self._joints, 'model_files': [str(path) for path in model_files],
                'use_sim_time': True, 'input_reliability': 'reliable',
                # A plant in lockstep waits while the machine does something else.
                'joint_state_timeout': 10.0}

    def _start_plant(self, models: Sequence[Path], undeclared: Sequence[Path | str],
                     sample_time: float, **more: Any) -> None:
        self._nodes.start('plant', {
            'joints': self._joints, 'model_files': [str(path) for path in models],
            'clock': 'lockstep', 'seed': self._arguments.seed, 'sample_time': sample_time,
            'wrench_period': 4 * sample_time,
            'undeclared_effect_files': [str(path) for path in undeclared], **more})

    def _record(self, name: str) -> None:
        self._start_recorder(name)
        self._until_recorded()

    def _start_recorder(self, name: str) -> None:
        self._nodes.start('recorder', {
            'output': str(self._output / 'recordings' / name), 'use_sim_time': True,
            'input_reliability': 'reliable'})

    def _until_recorded(self) -> None:
        """Wait until the recorder hears everything that is said from now on."""
        # Subscriptions to the command: the plant's and the recorder's. Identification has a
        # publisher only while it commands.
        self._ros.until_connected('current_command', 0, 2)
        self._ros.until_connected('interaction_wrench', 1, 1)
        if self._nodes.started('compensator'):
            # Messages sent before the recorder was discovered would be missing in the recording, so
            # an exercise begins after this.
            self._ros.forget('compensator')
            self._ros.until(
                lambda: int(self._ros.value('compensator', 'listeners to the command') or 0)
                >= self._ros.subscriptions('current_command'), 'the compensator and its listeners')

    def _follow(self, title: str, look: Callable[[float], None] | None = None) -> None:
        """Wait until the exercise is over; `look` is called with its time in s meanwhile."""
        began = None
        with progress(title) as show:
            while not self._nodes.ended('exercise'):
                self._ros.wait(0.1)
                at = self._ros.value('exercise', 'time [s]')
                if at is not None:
                    began = began or (float(at), time.monotonic())
                    last = (float(at), time.monotonic())
                    show(last[0] / float(self._ros.value('exercise', 'duration [s]') or math.inf))
                    if look:
                        look(last[0])
        if began and last[0] > began[0]:
            self._speeds.append((last[0] - began[0], last[1] - began[1]))
        self._ros.forget('exercise')


def tell(arguments: Namespace, client: Callable[..., DemoClient],
         scene: Callable[..., Stage]) -> int:
    """Run a scene in separate processes and return the exit code.

    Parameters
    ----------
    arguments : argparse.Namespace
    client : callable
        Makes the demo's part in ROS 2; handed in, so that ROS 2 is imported by the tool alone.
    scene : callable
        Makes a `Stage` of arguments, nodes and client.
    """
    output = arguments.output.absolute()
    make_room(output)
    os.environ['ROS_LOG_DIR'] = str(output / 'logs' / 'ros')
    with Nodes(output / 'logs') as nodes, client(nodes.check) as ros:
        page = _open_page(output) if arguments.watch else None
        try:
            scene(arguments, nodes, ros).run()
        finally:
            if page is not None:
                page.terminate()
                page.wait()
    return 0


def _open_page(output: Path) -> subprocess.Popen[str]:
    """Start the live page, and say where it is."""
    with (output / 'logs' / 'watch.log').open('w') as log:
        page = subprocess.Popen(
            [sys.executable, '-m', 'friction_comp', 'watch', '--port', '0'],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, text=True,
            start_new_session=True)
    assert page.stdout is not None
    line = page.stdout.readline()
    if not line:
        page.wait()
        raise InputError((output / 'logs' / 'watch.log').read_text().strip()
                         or 'the live page does not start')
    Console(highlight=False).print(f'watch it: {line.split()[0]}', soft_wrap=True)
    return page


def make_room(output: Path) -> None:
    """Remove an earlier demo's results and nothing else."""
    for name in ('recordings', 'models', 'logs'):
        shutil.rmtree(output / name, ignore_errors=True)
    for name in ('report.html', 'report.json', 'repetitions.csv'):
        (output / name).unlink(missing_ok=True)
    for name in ('recordings', 'models', 'logs'):
        (output / name).mkdir(parents=True)
