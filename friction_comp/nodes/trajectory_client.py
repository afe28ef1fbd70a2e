# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Plays trajectories: with this package's own currents, or by a robot's trajectory controller."""

from __future__ import annotations

from collections.abc import Callable
import importlib
from typing import Any

from friction_comp_interfaces.action import PlayTrajectory
import numpy as np
from rclpy.action import ActionClient
from rclpy.duration import Duration
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from friction_comp.errors import InputError
from friction_comp.nodes.demo_client import DemoClient
from friction_comp.trajectory import Trajectory

# The way to the first point takes so many s at least, and is this share as fast as the trajectory.
_SHORTEST, _SLOW = 2.0, 0.3


def message_of(trajectory: Trajectory, later: float = 0.0) -> Any:
    """Return a trajectory as a message, so many s later."""
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

    def play(self, trajectory: Trajectory, report: Callable[[float, str], None],
             ramp_slope: float = 0.0, ramp_period: float = 0.0) -> None:
        """Have the node `identification` move one joint along a trajectory.

        Parameters
        ----------
        trajectory : Trajectory
            Of one joint.
        report : callable
            Called with the share that is done and what is being done.
        ramp_slope, ramp_period : float
            Of the ramp that breaks the joint free, A/s and s; 0 for the node's own.

        Raises
        ------
        InputError
            If the goal is refused or not reached.
        """
        action = ActionClient(self._node, PlayTrajectory, 'play_trajectory')
        try:
            self.reach(action, PlayTrajectory.Goal(
                trajectory=message_of(trajectory), ramp_slope=ramp_slope,
                ramp_period=ramp_period), PlayTrajectory.Goal(),
                lambda feedback: report(feedback.progress, feedback.phase), 'identification')
        finally:
            action.destroy()

    def play_on(self, controller: str, trajectory: Trajectory,
                report: Callable[[float, str], None]) -> None:
        """Have a robot's trajectory controller move its joints along a trajectory.

        The joints travel slowly to the first point.

        Parameters
        ----------
        controller : str
            Its name, before ``/follow_joint_trajectory``.
        trajectory : Trajectory
        report : callable
            As for `play`.

        Raises
        ------
        InputError
            If the type of the action is not installed, the joints are not known, or the goal is
            refused or not reached.
        """
        try:
            kind = importlib.import_module('control_msgs.action').FollowJointTrajectory
        except ModuleNotFoundError:
            raise InputError('the action of trajectory controllers is missing: install '
                             'ros-jazzy-control-msgs') from None
        way = np.abs(trajectory.position[0] - self._positions(trajectory.joints)).max()
        later = max(_SHORTEST, 1.875 * way / (_SLOW * np.abs(trajectory.velocity).max()))
        end = later + trajectory.time[-1]
        action = ActionClient(self._node, kind, f'{controller}/follow_joint_trajectory')

        def tell(feedback: Any) -> None:
            at = feedback.desired.time_from_start
            report((at.sec + 1e-9 * at.nanosec) / end, 'trajectory')
        try:
            # A trajectory of joints that the controller does not have is refused.
            self.reach(action, kind.Goal(trajectory=message_of(trajectory, later)), kind.Goal(
                trajectory=JointTrajectory(joint_names=['nobody'])), tell, controller)
        finally:
            action.destroy()

    def _positions(self, joints: tuple[str, ...]) -> np.ndarray:
        """Return where the joints are, rad."""
        heard: dict[str, float] = {}
        subscription = self._node.create_subscription(
            JointState, 'joint_states',
            lambda message: heard.update(zip(message.name, message.position)),
            qos_profile_sensor_data)
        try:
            self.until(lambda: set(joints) <= set(heard), f'joint_states of {", ".join(joints)}')
        finally:
            self._node.destroy_subscription(subscription)
        return np.array([heard[joint] for joint in joints])
