# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The goals of the node identification: from the action message to the run and its result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np
from rclpy.task import Future

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.identification.goal import check_field, IdentificationGoal, TrajectoryGoal
from friction_comp.identification.run import IdentificationRun
from friction_comp.identification.supervised_run import SupervisedRun


@dataclass(frozen=True)
class Action:
    """One action of the node: its type and name, and how a request is processed."""

    kind: Any
    name: str
    # `make_goal` or `make_trajectory`.
    make_goal: Callable[[Any, list[str], dict[str, Any]], tuple[int, Any]]
    # Makes the run of a goal and a drive; the last argument is whether messages have torques.
    run: Callable[[Any, Drive, bool], SupervisedRun]
    # Fills the result message of a finished run of a joint; returns what it says.
    finish: Callable[[SupervisedRun, int, Any], str]


@dataclass
class RunningGoal:
    """A goal while its joint is moved."""

    action: Action
    handle: Any
    index: int
    joint: str
    run: SupervisedRun
    # Completed with how the goal ended (done, canceled or aborted) and a message.
    end: Future = field(default_factory=Future)
    # Stamp of the first joint state, ns, and the places of all joints then, rad.
    started: int | None = None
    places: np.ndarray | None = None
    # Real time, s.
    last_feedback: float = -math.inf
    # Whether a client has waited for the result, whether joint states are silent, and whether they
    # were at the last check: in between, a state that waited to be read may say why.
    had_client: bool = False
    silent: bool = False
    was_silent: bool = False


def make_goal(request: Any, joints: list[str], defaults: dict[str, Any]
              ) -> tuple[int, IdentificationGoal]:
    """Return joint index and goal of an IdentifyFriction goal."""
    index = _index_of(request.joint, joints) if request.joint else 0
    fields = {name: getattr(request, name) or default for name, default in defaults.items()}
    if not request.speeds:
        check_field('motion_range', fields['motion_range'])
        # Of the default speeds, those for which the range is wide enough.
        largest = IdentificationGoal.largest_speed(float(fields['motion_range']))
        fields['speeds'] = [speed for speed in fields['speeds'] if abs(speed) <= largest]
    return index, IdentificationGoal(**dict(
        fields, speeds=tuple(fields['speeds']), ramp_slope=fields['ramp_slope'] or None))


def _index_of(joint: str, joints: list[str]) -> int:
    if joint not in joints:
        raise InputError(f'unknown joint {joint!r}; known: {", ".join(joints)}')
    return joints.index(joint)


def make_trajectory(request: Any, joints: list[str], defaults: dict[str, Any]
                    ) -> tuple[int, TrajectoryGoal]:
    """Return joint index and goal of a PlayTrajectory goal."""
    names, points = list(request.trajectory.joint_names), request.trajectory.points
    if len(names) != 1:
        raise InputError(f'one joint is moved at a time, not {len(names)}')
    index = _index_of(names[0], joints)
    if any(len(point.positions) != 1 or len(point.velocities) != 1 for point in points):
        raise InputError('a point of the trajectory lacks position or velocity')
    return index, TrajectoryGoal(
        [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in points],
        [point.positions[0] for point in points], [point.velocities[0] for point in points],
        request.ramp_slope or defaults['ramp_slope'] or None,
        request.ramp_period or defaults['ramp_period'])


def fill_result(message: Any, result: Any) -> None:
    """Copy an IdentificationResult into an IdentifyFriction.Result."""
    for name in ('speeds', 'currents', 'standard_deviations', 'coefficients'):
        setattr(message, name, [float(value) for value in getattr(result, name)])
    for name in ('positive_mean', 'positive_std', 'negative_mean', 'negative_std'):
        setattr(message, f'breakaway_{name}', float(getattr(result.breakaway, name)))


def compile_ahead(drive: Drive) -> None:
    """Import and compile everything a goal needs before the first one arrives."""
    goal = IdentificationGoal(
        speeds=(0.4, 0.8), ramp_slope=drive.current_limit / 10.0, ramp_period=1.0)
    identification = IdentificationRun(goal, drive)
    for k in range(3):
        identification.update(1e-3 * k, 0.0, 0.0, 0.0)
    identification.abort()
