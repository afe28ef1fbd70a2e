# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Announces the direction of each joint from a plan, a stream of desired states or a sensor."""

from __future__ import annotations

from array import array
from collections.abc import Callable
import math
from operator import attrgetter
import time
from typing import Any

from geometry_msgs.msg import WrenchStamped
import numpy as np
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from friction_comp.control.joint_states import JointColumns
from friction_comp.direction.sources import (
    Announcement,
    DesiredMotion,
    ForceDirection,
    PlannedDirection,
    SILENCE,
)
from friction_comp.errors import InputError
from friction_comp.messages import NANO, nanoseconds, set_stamp
from friction_comp.ros.joint_io import QOS, RELIABLE
from friction_comp.ros.node_main import yield_to_executor
from friction_comp.ros.node_parts import Diagnostics, OK, Settings, WARN


class DirectionNode(Node):
    """Publishes `direction_stamped` at a rate; what it says is computed by the room `direction`."""

    def __init__(self) -> None:
        super().__init__('direction')
        settings = self._settings = Settings(self, 'direction')
        joints, source = settings.joints, settings['source']
        self._joints = joints
        self._columns, self._desired = JointColumns(joints), JointColumns(joints)
        self._said = [Announcement(0, 'starts') for _ in joints]
        self._position, self._seen = np.full(len(joints), np.nan), -math.inf
        self._refused = ''
        self._sensors: list[ForceDirection] = []
        self._qos = QOS[settings['input_reliability']]
        self._at: Callable[[float], list[Announcement]] = getattr(self, f'_begin_{source}')()
        self._message = JointState(name=list(joints))
        self._announcements = self.create_publisher(JointState, 'direction_stamped', RELIABLE)
        Diagnostics(self, self._report, joints, f'direction by {source}')
        self.create_service(Trigger, '~/calibrate', self._on_calibrate,
                            callback_group=ReentrantCallbackGroup())
        self.create_timer(1.0 / settings['rate'], self._announce)

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds) / NANO

    # The sources: each subscribes, and returns what is asked at a time.

    def _begin_trajectory(self) -> Callable[[float], list[Announcement]]:
        plan = self._plan = PlannedDirection(
            self._joints, self._settings['announcement'], self._settings['tolerance'])
        self.create_subscription(JointTrajectory, 'trajectory', self._on_trajectory, RELIABLE)
        self._listen([])
        return lambda time: plan.at(time, self._present(time))

    def _begin_reference(self) -> Callable[[float], list[Announcement]]:
        motions = self._motions = [
            DesiredMotion(self._settings['least_speed']) for _ in self._joints]
        self.create_subscription(JointState, 'reference', self._on_reference, self._qos)
        self._listen([motion.motion for motion in motions])
        return lambda time: [motion.at(time, float(position)) for motion, position in zip(
            motions, self._present(time))]

    def _begin_sensor(self) -> Callable[[float], list[Announcement]]:
        span = tuple(self._settings['sensor_range'])
        if len(span) != 2:
            raise InputError(f'parameter sensor_range: two values are needed, not {list(span)}')
        self._component = attrgetter(self._settings['axis'])
        self._sensors = [ForceDirection(span) for _ in self._joints]
        self.create_subscription(Float64MultiArray, 'sensor', self._on_sensor, self._qos)
        self.create_subscription(WrenchStamped, 'sensor_wrench', self._on_wrench, self._qos)
        self._listen([sensor.motion for sensor in self._sensors])
        return lambda time: [sensor.at(time) for sensor in self._sensors]

    def _listen(self, motions: list[Any]) -> None:
        def take(message: Any) -> None:
            position, now = self._columns.read(message)[0], self._now()
            self._position = np.where(np.isfinite(position), position, self._position)
            self._seen = now
            for motion, value in zip(motions, position.tolist()):
                motion.add(now, value)
        self.create_subscription(JointState, 'joint_states', take, self._qos)

    def _present(self, time: float) -> np.ndarray:
        """Return the positions at a time, NaN where they are too old."""
        fresh = 0.0 <= time - self._seen <= SILENCE
        return self._position if fresh else np.full(len(self._joints), np.nan)

    def _on_trajectory(self, message: Any) -> None:
        now, stamp = self._now(), nanoseconds(message.header.stamp)
        try:
            times = [nanoseconds(point.time_from_start) / NANO for point in message.points]
            if {len(point.positions) for point in message.points} - {len(message.joint_names)}:
                raise InputError('a plan needs a position of each joint at every point')
            self._plan.take(
                message.joint_names, times, np.array([point.positions for point in message.points]),
                now, stamp / NANO if stamp else now, self._present(now))
            self._refused = ''
        except InputError as error:
            self._plan.forget(f'the plan was refused: {error}')
            self._refuse(f'the plan was refused: {error}')

    def _on_reference(self, message: Any) -> None:
        position, now = self._desired.read(message)[0], self._now()
        for motion, value in zip(self._motions, position.tolist()):
            motion.take(now, value)

    def _on_sensor(self, message: Any) -> None:
        """Take samples of all joints, the oldest first."""
        width, count, now = len(self._joints), len(message.data), self._now()
        if not count or count % width:
            self._refuse(f'sensor: {count} values are not a multiple of {width}')
            return
        for j in range(width):
            self._feel(j, now, message.data[j::width])
        self._refused = ''

    def _on_wrench(self, message: Any) -> None:
        if message.header.frame_id in self._joints:
            value = self._component(message.wrench)
            self._feel(self._joints.index(message.header.frame_id), self._now(), [value])

    def _feel(self, joint: int, now: float, values: Any) -> None:
        sensor = self._sensors[joint]
        calibrating = sensor.calibrating
        sensor.add(now, values)
        if calibrating and not sensor.calibrating:
            self.get_logger().info(f'{self._joints[joint]}: {sensor.failure or "calibrated"}')

    def _refuse(self, why: str) -> None:
        if why != self._refused:
            self.get_logger().warning(why)
        self._refused = why

    async def _on_calibrate(self, _: Any, response: Any) -> Any:
        """Calibrate all sensors at rest; who asks again meanwhile gets the same answer."""
        sensors = self._sensors
        if not any(sensor.calibrating for sensor in sensors):
            for sensor in sensors:
                sensor.begin_calibration()
        # Real time; it takes three seconds by the clock.
        end = time.monotonic() + 12.0
        while any(sensor.calibrating for sensor in sensors) and time.monotonic() < end:
            await yield_to_executor()
        failures = [f'{joint}: {sensor.failure}' for joint, sensor in zip(self._joints, sensors)
                    if sensor.failure]
        response.success = bool(sensors) and not failures
        response.message = ('; '.join(failures) or 'calibrated') if sensors else (
            'only the source sensor is calibrated')
        return response

    def _announce(self) -> None:
        now = self._now()
        self._said = self._at(now)
        self._say(now)

    def _say(self, now: float) -> None:
        message, said = self._message, self._said
        set_stamp(message.header.stamp, round(now * NANO))
        message.velocity = array('d', [one.direction for one in said])
        message.position = array('d', [one.end for one in said])
        message.effort = array('d', [one.is_pushed for one in said])
        self._announcements.publish(message)

    def _report(self) -> Any:
        values: dict[str, Any] = {
            'direction': [said.direction for said in self._said],
            'end [rad]': [said.end for said in self._said],
            **{f'{joint}: reason': said.reason for joint, said in zip(self._joints, self._said)}}
        faults = [*(f'{joint}: {said.reason}' for joint, said in zip(self._joints, self._said)
                    if said.fault), *filter(None, [self._refused])]
        if faults:
            return WARN, '; '.join(faults), values
        return OK, 'announces' if any(said.direction for said in self._said) else 'waits', values

    def leave(self) -> None:
        """Announce no direction."""
        if self.context.ok():
            self._said = [Announcement(0, 'the node ends') for _ in self._joints]
            self._say(self._now())
