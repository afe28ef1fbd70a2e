# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs nodes in separate processes."""

from contextlib import contextmanager, suppress
import functools
import multiprocessing
from multiprocessing import forkserver
import os
from pathlib import Path
import signal
import subprocess
import sys
from types import ModuleType
from unittest.mock import patch

from friction_comp.__main__ import NODES
from friction_comp.demo import processes
from friction_comp.demo.processes import ros_arguments

ROOT = Path(__file__).resolve().parent.parent
# s; discovery alone may take seconds on a busy machine.
PATIENCE = 120.0
# s between reports of nodes on /diagnostics: tests wait for what they say.
OFTEN = 0.1


def become(*how):
    """Become a node, in a process that was forked from one which has imported all nodes."""
    import node_host

    node_host.become(*how)


@functools.cache
def forks():
    """Return the server from which nodes are forked; their kernels are compiled at its start."""
    context = multiprocessing.get_context('forkserver')
    context.set_forkserver_preload(['node_host', 'node_process'])
    # Before Python 3.13 it does not know the path of this one.
    with patch.dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)):
        forkserver.ensure_running()
    return context


@contextmanager
def unread_pipe(folder):
    """Yield a full pipe that nobody reads, such as that of a `| less` at its first page."""
    pipe = folder / 'pipe'
    os.mkfifo(pipe)
    end = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    with suppress(BlockingIOError):
        while True:
            os.write(end, b'.')
    try:
        yield pipe
    finally:
        os.close(end)


def environment(**changes):
    """Return the environment of a process that imports the package from here."""
    return dict(os.environ, PYTHONPATH=os.pathsep.join(
        [str(ROOT), *filter(None, [os.environ.get('PYTHONPATH')])]), **changes)


class Forked:
    """A node in a forked process, with those methods of `subprocess.Popen` that are used."""

    def __init__(self, *how):
        self._process = forks().Process(target=become, args=how)
        # Or it would import the program that runs now, as its own.
        main, sys.modules['__main__'] = sys.modules['__main__'], ModuleType('__main__')
        try:
            self._process.start()
        finally:
            sys.modules['__main__'] = main
        self.pid = self._process.pid

    @property
    def returncode(self):
        return self._process.exitcode

    def poll(self):
        return self.returncode

    def wait(self, timeout=PATIENCE):
        self._process.join(timeout)
        if self.returncode is None:
            raise subprocess.TimeoutExpired(f'process {self.pid}', timeout)
        return self.returncode

    def send_signal(self, number):
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self):
        self.send_signal(signal.SIGKILL)


def fork_nodes_of_tools(monkeypatch, changed=lambda name, parameters: parameters):
    """Make tools that run in this process fork their nodes, too, with changed parameters."""
    def start(nodes, name, parameters, remappings=None):
        log = nodes._logs / f'{name}.log'
        log.parent.mkdir(parents=True, exist_ok=True)
        log.touch()
        nodes._running[name] = Forked(
            name, ros_arguments(changed(name, parameters), remappings), Path.cwd(), log.absolute(),
            environment(), OFTEN)
    monkeypatch.setattr(processes.Nodes, 'start', start)


def shorten_scenes(monkeypatch, folder):
    """Make scenes of the demo fork their nodes, exercise for less long, and use a low sample rate.

    What a scene is made of is changed where its nodes start, whichever module asked for it.
    """
    def shortened(path):
        text = Path(path).read_text(encoding='utf-8')
        # Of four times there and back, two.
        text = text.replace(''.join(f'  - to: {{armin_1: {angle}}}\n    time: 0.833\n'
                                    for angle in (-12, 12)), '', 2)
        short = folder / Path(path).name
        short.write_text(text, encoding='utf-8')
        return short

    def changed(name, parameters):
        parameters = dict(parameters)
        for key in {'sample_time', 'wrench_period'} & set(parameters):
            parameters[key] *= 2.5
        # Where each sample has a tick, it matters when the direction is announced.
        if parameters.get('clock_period', 0.0) > parameters.get('sample_time', 0.0):
            parameters['clock_period'] *= 2.0
        if 'exercise_file' in parameters:
            parameters['exercise_file'] = shortened(parameters['exercise_file'])
        return parameters
    fork_nodes_of_tools(monkeypatch, changed)


class Process:
    """A node in a separate process, which the ``with`` block ends.

    What it prints goes to the file or pipe `error`. It reports on /diagnostics every `period` s.
    With `fresh`, it is a new interpreter, as started from a command line, instead of a fork, and
    reports once a second.
    """

    def __init__(self, folder, name, parameters=None, remappings=None, arguments=(), fresh=False,
                 period=OFTEN, error=None):
        self.name = name
        folder.mkdir(exist_ok=True, parents=True)
        number = len(list(folder.iterdir()))
        self._error = error or folder / f'{number}_{name}.err'
        self._error.touch()
        if name in NODES or parameters or remappings:
            arguments = [*arguments, *ros_arguments(parameters or {}, remappings)]
        env = environment(ROS_LOG_DIR=str(folder / 'log'))
        if fresh:
            with self._error.open('w') as error:
                self._process = subprocess.Popen(
                    [sys.executable, '-m', 'friction_comp', name, *arguments],
                    env=env, stdout=error, stderr=error, cwd=folder)
        else:
            self._process = Forked(name, arguments, folder, self._error, env, period)

    def send(self, number=signal.SIGINT):
        self._process.send_signal(number)

    def wait(self, timeout=PATIENCE):
        return self._process.wait(timeout)

    @property
    def running(self):
        return self._process.poll() is None

    @property
    def text(self):
        return self._error.read_text()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.running:
            self.send()
            try:
                self.wait(30.0)
            except subprocess.TimeoutExpired:
                self.send(signal.SIGKILL)
                self._process.wait()
