# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs nodes in separate processes."""

import atexit
from contextlib import contextmanager, suppress
import functools
import json
import os
from pathlib import Path
import select
import signal
import subprocess
import sys

from friction_comp.__main__ import NODES
from friction_comp.demo import processes
from friction_comp.demo.processes import ros_arguments

ROOT = Path(__file__).resolve().parent.parent
# s; discovery alone may take seconds on a busy machine.
PATIENCE = 120.0
# s between reports of nodes on /diagnostics: tests wait for what they say.
OFTEN = 0.1


class Host:
    """Starts nodes by forking a process that has imported what they need."""

    def __init__(self):
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name('node_host.py'))], text=True, bufsize=1,
            env=environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert self._process.stdout.readline() == 'ready\n'
        # It ends when its input ends.
        atexit.register(self._process.communicate)

    def ask(self, request):
        self._process.stdin.write(json.dumps(request) + '\n')
        return json.loads(self._process.stdout.readline())


@functools.cache
def host():
    """Return the host of all nodes; their kernels are compiled at its start."""
    return Host()


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
    """A node forked by a host, with those methods of `subprocess.Popen` that the tests use."""

    def __init__(self, host, name, arguments, folder, output, env, period=OFTEN):
        self._host, self.returncode = host, None
        self.pid = host.ask([name, arguments, str(folder), str(output), env, period])
        # Tools look at their nodes at every message: the host is asked only at the end.
        self._ends = os.pidfd_open(self.pid)

    def _await(self, timeout):
        if self.returncode is None and select.select([self._ends], [], [], timeout)[0]:
            os.close(self._ends)
            self.returncode = self._host.ask(self.pid)
        return self.returncode

    def poll(self):
        return self._await(0.0)

    def wait(self, timeout=PATIENCE):
        if self._await(timeout) is None:
            raise subprocess.TimeoutExpired(f'process {self.pid}', timeout)
        return self.returncode

    def send_signal(self, number):
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self):
        self.send_signal(signal.SIGKILL)


def fork(name, arguments, folder, output, env, period=OFTEN):
    """Fork a node from the host for it."""
    return Forked(host(), name, arguments, folder, output, env, period)


def fork_nodes_of_tools(monkeypatch, changed=lambda name, parameters: parameters):
    """Make tools that run in this process fork their nodes, too, with changed parameters."""
    def start(nodes, name, parameters, remappings=None):
        log = nodes._logs / f'{name}.log'
        log.parent.mkdir(parents=True, exist_ok=True)
        log.touch()
        nodes._running[name] = fork(
            name, ros_arguments(changed(name, parameters), remappings), Path.cwd(), log.absolute(),
            environment())
    monkeypatch.setattr(processes.Nodes, 'start', start)


def shorten_scenes(monkeypatch, folder):
    """Make scenes of the demo fork their nodes, exercise once, and use a low sample rate.

    What a scene is made of is changed where its nodes start, whichever module asked for it.
    """
    def shortened(path):
        text = Path(path).read_text(encoding='utf-8').replace('repetitions: 2', 'repetitions: 1')
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
            self._process = fork(name, arguments, folder, self._error, env, period)

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
