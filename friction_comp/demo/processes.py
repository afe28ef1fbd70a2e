# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs nodes as child processes of a tool and ends all of them with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
import fcntl
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

from friction_comp.errors import InputError, os_errors_name
from friction_comp.interrupts import interrupts_deferred

SAMPLE_TIME = 4e-3
"""Of simulated joints, s: a quarter of the rate of a real driver, for a quarter of the time."""
IN_LOCKSTEP: dict[str, Any] = {
    'use_sim_time': True, 'input_reliability': 'reliable',
    # A plant in lockstep waits while the machine does something else.
    'joint_state_timeout': 10.0}
"""Parameters of nodes that move a simulated joint."""



def plant_parameters(joints: Sequence[str], models: Sequence[Path], undeclared: Path | None,
                     seed: int, sample_time: float = SAMPLE_TIME) -> dict[str, Any]:
    """Return the parameters of a plant in lockstep, all joints with the same undeclared effects."""
    return {'joints': joints, 'model_files': models,
            'undeclared_effect_files': [undeclared or ''] * len(joints),
            'clock': 'lockstep', 'seed': seed, 'sample_time': sample_time,
            'wrench_period': 4 * sample_time, 'clock_period': 0.02}


def ros_arguments(parameters: Mapping[str, Any],
                  remappings: Mapping[str, str] | None = None) -> list[str]:
    """Return command-line arguments that set parameters and rename topics; JSON is YAML, too."""
    arguments = ['--ros-args', '--log-level', 'warn']
    for name, value in parameters.items():
        arguments += ['-p', f'{name}:={json.dumps(value, default=str, ensure_ascii=False)}']
    for old, new in (remappings or {}).items():
        arguments += ['-r', f'{old}:={new}']
    return arguments


@contextmanager
def only_user(folder: Path) -> Iterator[None]:
    """Make a folder, and keep other tools that run nodes out of it, by a lock of the kernel."""
    with os_errors_name(folder):
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f'{folder}: another run is writing there: wait for its end, or choose '
                             'another --output') from None
        yield
    finally:
        os.close(handle)


class Nodes:
    """Runs nodes of this package as processes, with log files, in a ``with`` block.

    They end with it, however it ends.
    """

    def __init__(self, logs: Path) -> None:
        self._logs = logs
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Nodes:
        return self

    def __exit__(self, *_: object) -> None:
        with interrupts_deferred():
            self.stop(*self._running)

    def start(self, name: str, parameters: Mapping[str, Any],
              remappings: Mapping[str, str] | None = None) -> None:
        """Start a node, by its name after ``python3 -m friction_comp``."""
        self._logs.mkdir(parents=True, exist_ok=True)
        # If interrupted half-way, the process would run on unnoticed.
        with interrupts_deferred(), (self._logs / f'{name}.log').open('ab') as log:
            # In a session of its own: an interrupt reaches the tool, which stops nodes in order.
            self._running[name] = subprocess.Popen(
                [sys.executable, '-m', 'friction_comp', name,
                 *ros_arguments(parameters, remappings)],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)

    def check(self) -> None:
        """Raise InputError if a node has failed."""
        for name, process in self._running.items():
            if process.poll():
                log = (self._logs / f'{name}.log').read_text(errors='replace')
                last = log.strip().rpartition('\n')[2] or 'it printed nothing'
                raise InputError(f'node {name} ended with status {process.returncode}: {last}')

    def running(self, name: str) -> bool:
        """Return whether a node was started and has not ended; a failure raises InputError."""
        self.check()
        if name in self._running and self._running[name].poll() is not None:
            del self._running[name]
        return name in self._running

    def stop(self, *names: str) -> None:
        """Interrupt nodes, wait for them, and kill what does not end."""
        processes = [self._running.pop(name) for name in names if name in self._running]
        for process in processes:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        end = time.monotonic() + 10.0
        for process in processes:
            try:
                process.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
