# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs nodes as child processes of a tool, in a ROS domain of their own, and ends them with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
import fcntl
import json
import os
from pathlib import Path
import random
import signal
import socket
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
# Domain IDs that ROS 2 calls safe on all systems: their ports are below the ephemeral ports.
_DOMAINS = range(1, 102)
# DDSI-RTPS 2.2, section 9.6.1.1: port base and domain gain.
_PORT_BASE, _PORT_GAIN = 7400, 250
# What tools set for as long as they have a domain of their own.
_OF_DOMAIN = ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'FASTRTPS_DEFAULT_PROFILES_FILE',
              'ROS_LOG_DIR')
_SOCKETS = (Path('/proc/net/udp'), Path('/proc/net/udp6'))


@contextmanager
def leased_domain() -> Iterator[int]:
    """Reserve a ROS domain that no process uses, by a socket of this one; yields its number."""
    free = sorted(set(_DOMAINS) - domains_in_use())
    # Other participants use small ones by default.
    for domain in random.SystemRandom().sample(free, len(free)):
        holder = _reserve(domain)
        if holder is not None:
            with holder:
                yield domain
            return
    raise InputError('all ROS domains of this machine are in use')


def _reserve(domain: int) -> socket.socket | None:
    holder = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        # The fifth port of a domain has no use.
        holder.bind(('127.0.0.1', _PORT_BASE + _PORT_GAIN * domain + 5))
    except OSError:
        holder.close()
        return None
    return holder


@contextmanager
def private_domain() -> Iterator[None]:
    """Use an unused ROS domain in this process and its children, so that no robot is disturbed."""
    before = {name: os.environ.get(name) for name in _OF_DOMAIN}
    with leased_domain() as domain:
        os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
        try:
            yield
        finally:
            # The domain may be another process's from here on.
            for name, value in before.items():
                os.environ.pop(name, None)
                if value is not None:
                    os.environ[name] = value


def domains_in_use() -> set[int]:
    """Return the domains to which UDP ports of this machine are bound."""
    used = set()
    for path in _SOCKETS:
        with suppress(OSError):
            for line in path.read_text(encoding='ascii').splitlines()[1:]:
                port = int(line.split()[1].rpartition(':')[2], 16)
                used.add((port - _PORT_BASE) // _PORT_GAIN)
    return used


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
