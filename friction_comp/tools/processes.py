# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs nodes as child processes of a tool and ends all of them with it."""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

from friction_comp.parallel import interrupts_deferred
from friction_comp.errors import InputError


def ros_arguments(parameters: Mapping[str, Any]) -> list[str]:
    """Return the command-line arguments that set parameters, each value as YAML reads it."""
    arguments = ['--ros-args', '--log-level', 'warn']
    for name, value in parameters.items():
        arguments += ['-p', f'{name}:={_yaml(value)}']
    return arguments


def _yaml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return '[' + ', '.join(_yaml(item) for item in value) + ']'
    if isinstance(value, (str, os.PathLike)):
        return "'" + str(value).replace("'", "''") + "'"
    return repr(value)


class Nodes:
    """Runs nodes of this package, each in a separate process.

    Leaving the ``with`` block ends them all.

    Parameters
    ----------
    logs : path-like
        Folder for what they print.
    environment : dict of str, optional
        Changes to the environment.
    """

    def __init__(self, logs: str | Path, environment: Mapping[str, str] | None = None) -> None:
        self._logs = Path(logs)
        self._environment = {**os.environ, **(environment or {})}
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Nodes:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop(*self._running)

    def start(self, name: str, parameters: dict[str, Any]) -> None:
        """Start a node.

        Parameters
        ----------
        name : str
            As after ``python3 -m friction_comp``.
        parameters : dict
        """
        self._logs.mkdir(parents=True, exist_ok=True)
        # If interrupted half-way, the process would run on unnoticed.
        with interrupts_deferred(), (self._logs / f'{name}.log').open('ab') as log:
            # A separate session: an interrupt from the keyboard reaches only the tool, which stops
            # the nodes in order.
            self._running[name] = subprocess.Popen(
                [sys.executable, '-m', 'friction_comp', name, *ros_arguments(parameters)],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=self._environment,
                start_new_session=True)

    def check(self) -> None:
        """Raise InputError if a node has failed."""
        for name, process in self._running.items():
            if process.poll():
                raise InputError(
                    f'node {name} ended with status {process.returncode}: {self._last(name)}')

    def started(self, name: str) -> bool:
        """Return whether a node was started and is not known to have ended."""
        return name in self._running

    def alive(self, name: str) -> bool:
        """Return whether a node's process is there."""
        return self._running[name].poll() is None

    def ended(self, name: str) -> bool:
        """Return whether a node has ended by itself; a failure raises InputError."""
        self.check()
        if self.alive(name):
            return False
        del self._running[name]
        return True

    def stop(self, *names: str, patience: float = 10.0) -> None:
        """Interrupt nodes, wait for them, and kill what does not end."""
        processes = [self._running.pop(name) for name in names if name in self._running]
        for process in processes:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        end = time.monotonic() + patience
        for process in processes:
            try:
                process.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def _last(self, name: str) -> str:
        try:
            lines = (self._logs / f'{name}.log').read_text(errors='replace').strip().splitlines()
        except OSError:
            lines = []
        return lines[-1] if lines else 'it printed nothing'
