# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Plays trajectories by this package's motor currents or by a robot's trajectory controller."""

from __future__ import annotations

from collections.abc import Callable
import importlib
from typing import Any

from friction_comp_interfaces.action import PlayTrajectory
import numpy as np
from rclpy.duration import Duration
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from friction_comp.errors import InputError
from friction_comp.nodes.demo_client import DemoClient
from friction_comp.trajectory import Trajectory

# Shortest duration of the approach to the first point, s, and its speed relative to the trajectory.
_MIN_APPROACH_TIME, _APPROACH_SPEED = 2.0, 0.3


def message_of(trajectory: Trajectory, later: float = 0.0) -> Any:
    """Return a trajectory as a message, delayed by `later` s."""
    message = JointTrajectory(joint_names=list(trajectory.joints))
    moved = Trajectory(trajectory.joints, trajectory.time + later, trajectory.position,
                       trajectory.velocity, trajectory.acceleration)
    for (sec, nanosec), position, velocity, acceleration in zip(
            moved.stamps(), moved.position, moved.velocity, moved.acceleration):
        message.points.append(JointTrajectoryPoint(
            positions=position.tolist(), velocities=velocity.tolist(),
            accelerations=acceleration.tolist(),
            time_from_start=Duration(seconds=sec, nanoseconds=nanosec).to_msg()))
    return message


class TrajectoryClient(DemoClient):
    """A separate node for a tool that plays trajectories; closed with the ``with`` block."""

    def play(self, trajectory: Trajectory, report: Callable[[float, str], None]) -> None:
        """Move one joint along a trajectory by the node `identification`.

        Parameters
        ----------
        trajectory : Trajectory
            Trajectory of one joint.
        report : callable
            Called with progress 0..1 and the present phase.

        Raises
        ------
        InputError
            If the goal is refused or fails.
        """
        self.reach(
            PlayTrajectory, 'play_trajectory',
            PlayTrajectory.Goal(trajectory=message_of(trajectory)), PlayTrajectory.Goal(),
            lambda feedback: report(feedback.progress, feedback.phase), 'identification')

    def play_on(self, controller: str, trajectory: Trajectory,
                report: Callable[[float, str], None]) -> None:
        """Move joints along a trajectory by a robot's trajectory controller.

        The joints first approach the first point slowly.

        Parameters
        ----------
        controller : str
            Its name, without ``/follow_joint_trajectory``.
        trajectory : Trajectory
        report : callable
            As for `play`.

        Raises
        ------
        InputError
            If the action type is not installed, the positions of the joints are unknown, or the
            goal is refused or fails.
        """
        try:
            kind = importlib.import_module('control_msgs.action').FollowJointTrajectory
        except ModuleNotFoundError:
            raise InputError('the action of trajectory controllers is missing: install '
                             'ros-jazzy-control-msgs') from None
        distance = np.abs(trajectory.position[0] - self._positions(trajectory.joints)).max()
        speed = _APPROACH_SPEED * np.abs(trajectory.velocity).max()
        later = max(_MIN_APPROACH_TIME, 1.875 * distance / speed)
        end = later + trajectory.time[-1]

        def tell(feedback: Any) -> None:
            at = feedback.desired.time_from_start
            report((at.sec + 1e-9 * at.nanosec) / end, 'trajectory')
        # A trajectory of unknown joints is refused.
        self.reach(kind, f'{controller}/follow_joint_trajectory',
                   kind.Goal(trajectory=message_of(trajectory, later)),
                   kind.Goal(trajectory=JointTrajectory(joint_names=['nobody'])), tell, controller)

    def _positions(self, joints: tuple[str, ...]) -> np.ndarray:
        """Return the positions of the joints, rad."""
        positions: dict[str, float] = {}
        with self.subscribed(
                JointState, 'joint_states',
                lambda message: positions.update(zip(message.name, message.position)),
                qos_profile_sensor_data):
            self.until(
                lambda: set(joints) <= set(positions), f'joint_states of {", ".join(joints)}')
        return np.array([positions[joint] for joint in joints])
