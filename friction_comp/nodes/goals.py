# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The goals of the node identification: from the action message to the run and its result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
import math
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.task import Future

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.identification.run import IdentificationGoal, IdentificationRun
from friction_comp.identification.supervised_run import SupervisedRun
from friction_comp.identification.trajectory_run import TrajectoryGoal
from friction_comp.nodes.parameters import declare

# 4 to 100 deg/s, the note's range.
DEFAULT_SPEEDS = [math.radians(v) for v in (4.0, 8.0, 15.0, 25.0, 40.0, 60.0, 80.0, 100.0)]


@dataclass(frozen=True)
class Action:
    """One action of the node.

    Parameters
    ----------
    kind : type
        Action type.
    name : str
    goal : callable
        Converts a request to (joint index, goal); raises InputError.
    run : callable
        Creates the run from goal and drive.
    finish : callable
        Called with finished run, joint index and result message, which it fills.
    """

    kind: Any
    name: str
    goal: Callable[[Any], tuple[int, Any]]
    run: Callable[[Any, Any], SupervisedRun]
    finish: Callable[[SupervisedRun, int, Any], None]


@dataclass
class RunningGoal:
    """A goal while its joint is moved.

    Parameters
    ----------
    action : Action
    handle : rclpy.action.server.ServerGoalHandle
    index : int
        Of the joint.
    joint : str
    run : SupervisedRun
    end : Future
        Completed with how the goal ended (done, canceled or aborted) and a message.
    started : int or None
        Stamp of the first joint state, ns.
    last_feedback : float
        Real time, s.
    had_client : bool
        Whether a client has waited for the result.
    silent : bool
        Whether joint states are silent.
    """

    action: Action
    handle: Any
    index: int
    joint: str
    run: SupervisedRun
    end: Future = field(default_factory=Future)
    started: int | None = None
    last_feedback: float = -math.inf
    had_client: bool = False
    silent: bool = False


def declare_defaults(node: Any) -> dict[str, Any]:
    """Declare the defaults of a goal's empty or zero fields and return them as a dict."""
    speeds = node.declare_parameter(
        'default_speeds', DEFAULT_SPEEDS, ParameterDescriptor(
            description='speeds of a goal that names none [rad/s]', read_only=True)).value
    return {
        'speeds': list(speeds),
        'motion_range': declare(
            node, 'default_motion_range', 1.0, 'motion range of a goal that names none [rad]',
            1e-3, 100.0, read_only=True),
        'ramp_slope': declare(
            node, 'default_ramp_slope', 0.06, 'ramp slope of a goal that names none [A/s]',
            1e-6, 100.0, read_only=True),
        'ramp_period': declare(
            node, 'default_ramp_period', 10.0, 'ramp period of a goal that names none [s]',
            1.0, 1000.0, read_only=True),
        'breakaway_cycles': declare(
            node, 'default_breakaway_cycles', 20, 'breakaway cycles of a goal that names none',
            1, 100_000, read_only=True)}


def make_goal(request: Any, joints: list[str], drives: list[Drive],
              defaults: dict[str, Any]) -> tuple[int, IdentificationGoal]:
    """Convert a goal message to (joint index, IdentificationGoal).

    Parameters
    ----------
    request : IdentifyFriction.Goal
    joints : list of str
    drives : list of Drive
    defaults : dict
        As from `declare_defaults`.

    Raises
    ------
    InputError
        If the joint is unknown, or the drive cannot reach the goal.
    """
    if request.joint and request.joint not in joints:
        raise InputError(f'unknown joint {request.joint!r}; known: {", ".join(joints)}')
    index = joints.index(request.joint) if request.joint else 0
    fields = {name: getattr(request, name) or default for name, default in defaults.items()}
    goal = IdentificationGoal(**dict(fields, speeds=tuple(fields['speeds'])))
    goal.check(drives[index])
    return index, goal


def make_trajectory(request: Any, joints: list[str], drives: list[Drive],
                    defaults: dict[str, Any]) -> tuple[int, TrajectoryGoal]:
    """Convert a PlayTrajectory goal to (joint index, TrajectoryGoal).

    Parameters
    ----------
    request : PlayTrajectory.Goal
    joints, drives, defaults
        As for `make_goal`.

    Raises
    ------
    InputError
        If it is not for exactly one known joint, or the drive cannot reach the goal.
    """
    names, points = list(request.trajectory.joint_names), request.trajectory.points
    if len(names) != 1:
        raise InputError(f'one joint is moved at a time, not {len(names)}')
    if names[0] not in joints:
        raise InputError(f'unknown joint {names[0]!r}; known: {", ".join(joints)}')
    if any(len(point.positions) != 1 or len(point.velocities) != 1 for point in points):
        raise InputError('a point of the trajectory lacks position or velocity')
    index = joints.index(names[0])
    goal = TrajectoryGoal(
        [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in points],
        [point.positions[0] for point in points], [point.velocities[0] for point in points],
        request.ramp_slope or defaults['ramp_slope'],
        request.ramp_period or defaults['ramp_period'])
    goal.check(drives[index])
    return index, goal


def fill_result(message: Any, result: Any) -> None:
    """Copy an IdentificationResult into an IdentifyFriction.Result."""
    message.speeds = [float(value) for value in result.speeds]
    message.currents = [float(value) for value in result.currents]
    message.standard_deviations = [float(value) for value in result.standard_deviations]
    message.coefficients = [float(value) for value in result.coefficients]
    breakaway = result.breakaway
    message.breakaway_positive_mean = float(breakaway.positive_mean)
    message.breakaway_positive_std = float(breakaway.positive_std)
    message.breakaway_negative_mean = float(breakaway.negative_mean)
    message.breakaway_negative_std = float(breakaway.negative_std)


def compile_ahead(drive: Drive) -> None:
    """Import and compile everything a goal needs before the first one arrives."""
    goal = IdentificationGoal(
        speeds=(0.4, 0.8), ramp_slope=drive.current_limit / 10.0, ramp_period=1.0)
    identification = IdentificationRun(goal, drive)
    for k in range(3):
        identification.update(1e-3 * k, 0.0, 0.0, 0.0)
    identification.abort()
