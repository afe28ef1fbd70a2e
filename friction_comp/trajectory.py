# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Motion of joints over time, read from and written as ``trajectory_msgs/JointTrajectory``."""

from __future__ import annotations

from dataclasses import dataclass
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from friction_comp.errors import InputError
from friction_comp.files import read_yaml
from friction_comp.messages import NANO
from friction_comp.samples import beyond

_STATES = ('positions', 'velocities', 'accelerations')


@dataclass(frozen=True)
class Trajectory:
    """Motion of J joints in N points."""

    joints: tuple[str, ...]
    time: np.ndarray            # (N,), s, from zero
    position: np.ndarray        # (N, J), rad
    velocity: np.ndarray        # (N, J), rad/s
    acceleration: np.ndarray    # (N, J), rad/s²

    @classmethod
    def load(cls, path: str | Path) -> Trajectory:
        """Read a message from a YAML file; raises InputError if it is not valid."""
        document: Any = read_yaml(path)
        try:
            names = [str(name) for name in document['joint_names']]
            points = document['points']
            time = np.array([float(point['time_from_start']['sec'])
                             + 1e-9 * float(point['time_from_start']['nanosec'])
                             for point in points])
            states = [np.array([point[name] for point in points], dtype=float) for name in _STATES]
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f'{path}: not a JointTrajectory with positions, velocities and '
                             f'accelerations at every point: {error}') from None
        if not names or len(time) < 2 or any(
                state.shape != (len(time), len(names)) for state in states):
            raise InputError(f'{path}: needs at least two points, each with one value for every '
                             'named joint')
        for signal, values in zip(('position', 'velocity', 'acceleration'), states):
            wrong = ~np.isfinite(values) | beyond(signal, values)
            if wrong.any():
                raise InputError(f'{path}: a {signal} of {values[wrong][0]:g} is impossible')
        if not (time[0] >= 0.0 and time[-1] < math.inf and (np.diff(time) > 0.0).all()):
            raise InputError(f'{path}: its times do not rise')
        return cls(tuple(names), time, *states)

    def of(self, joint: str) -> Trajectory:
        """Return the motion of one joint."""
        own = [self.joints.index(joint)]
        return Trajectory((joint,), self.time, self.position[:, own], self.velocity[:, own],
                          self.acceleration[:, own])

    def stamps(self) -> list[tuple[int, int]]:
        """Return the time of each point in s and ns."""
        return [divmod(round(1e9 * float(time)), NANO) for time in self.time]

    def to_yaml(self, remark: str) -> str:
        """Return the message as YAML, for ``ros2 topic pub`` or a goal, below a comment."""
        names = ', '.join(json.dumps(joint, ensure_ascii=False) for joint in self.joints)
        lines = [*(f'# {line}' for line in remark.splitlines()),
                 'header: {stamp: {sec: 0, nanosec: 0}, frame_id: ""}',
                 f'joint_names: [{names}]', 'points:']
        for (whole, rest), *states in zip(
                self.stamps(), self.position, self.velocity, self.acceleration):
            fields = ', '.join(f'{name}: {_row(own)}' for name, own in zip(_STATES, states))
            lines.append(f'- {{{fields}, effort: [], time_from_start: '
                         f'{{sec: {whole}, nanosec: {rest}}}}}')
        return '\n'.join(lines) + '\n'


def _row(values: np.ndarray) -> str:
    # With a decimal point: YAML would read whole numbers as integers.
    return f'[{", ".join(f"{value:.7f}" for value in values)}]'
