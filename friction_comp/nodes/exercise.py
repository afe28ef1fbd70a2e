# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes a reference movement, of the note or from a file, and announces its directions."""

from __future__ import annotations

from array import array
from collections.abc import Callable
import math
from time import monotonic
from typing import Any

import numpy as np
from rclpy.duration import Duration
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Int8MultiArray, MultiArrayDimension

from friction_comp.control.joint_states import JointColumns
from friction_comp.direction.exercise import load_exercise, ReferenceMovement
from friction_comp.messages import NANO, nanoseconds, set_stamp
from friction_comp.ros.joint_io import QOS, RELIABLE
from friction_comp.ros.node_parts import Diagnostics, OK, Settings, WARN

# Real s: discovery may finish at different times at both ends of a connection; longest wait for the
# acknowledgement of each topic's last messages.
_DISCOVERY_TIME = _ACKNOWLEDGEMENT_TIME = 0.5
# Parameters of the note's movement.
_MOVEMENT = ('amplitude', 'speed', 'acceleration_time', 'standstill', 'announcement',
             'repetitions')


class ExerciseNode(Node):
    """Publishes `reference`, `direction` and `direction_stamped`, from the first positions on.

    With `clock: ticks`, every tick of `/clock` is answered by the direction and then the reference
    with the tick's stamp, a repeated tick again. A plant in lockstep publishes its next joint
    states after the reference. So a compensator has the direction before these states, unless the
    middleware loses and repeats it: see its `wait_for_direction`.
    """

    def __init__(self) -> None:
        super().__init__('exercise')
        self.finished = False
        settings = self._settings = Settings(self, 'exercise')
        joints = self._joints = settings.joints
        self._at: Callable[[float], Any]
        self._ends: Callable[[float], Any]
        if file := settings['exercise_file']:
            exercise = load_exercise(file).of(joints)
            self._at, self._ends, self._duration = exercise.at, exercise.ends, exercise.duration
        else:
            # The same movement of all joints.
            movement = ReferenceMovement(**{name: settings[name] for name in _MOVEMENT})
            self._duration, size = movement.duration, len(joints)
            self._at = lambda time: [np.full(size, one) for one in movement.at(time)]
            self._ends = lambda time: np.full(size, movement.end(movement.at(time)[2]))
        # Ticks: the start of the movement, the first and the last one, ns; the time of the last
        # reference since the start, s; and real s since when all listeners are there.
        self._start: int | None = None
        self._first: int | None = None
        self._last: int | None = None
        self._time: float | None = None
        self._connected_since: float | None = None
        self._columns, self._origin = JointColumns(joints), np.full(len(joints), np.nan)
        self._reference, self._announced = (JointState(name=list(joints)) for _ in range(2))
        self._direction = Int8MultiArray()
        self._direction.layout.dim = [MultiArrayDimension(
            label='joint', size=len(joints), stride=len(joints))]
        self._references, self._directions, self._announcements = (
            self.create_publisher(type(message), topic, RELIABLE) for message, topic in (
                (self._reference, 'reference'), (self._direction, 'direction'),
                (self._announced, 'direction_stamped')))
        Diagnostics(self, self._report, joints, 'exercise')
        qos = QOS[settings['input_reliability']]
        self._origin_subscription = self.create_subscription(
            JointState, 'joint_states', self._on_joint_states, qos)
        self._ticking = settings['clock'] == 'ticks'
        if self._ticking:
            self.create_subscription(
                Clock, '/clock', lambda message: self._on_tick(nanoseconds(message.clock)), qos)
        else:
            self.create_timer(1.0 / settings['rate'],
                              lambda: self._on_tick(self.get_clock().now().nanoseconds))

    def _on_joint_states(self, message: Any) -> None:
        stamp = nanoseconds(message.header.stamp)
        # States before the first tick arrive at random, and would make runs differ.
        if not self._ticking or (self._first is not None and stamp >= self._first):
            # Several drivers may each publish some of the joints.
            position, _, _ = self._columns.read(message)
            self._origin = np.where(np.isfinite(position), position, self._origin)

    def _on_tick(self, now: Any) -> None:
        # Ignore ticks after the end, so that time stops at a reproducible tick.
        if self.finished or not self._has_listeners():
            return
        known = bool(np.isfinite(self._origin).all())
        if now == self._last:
            # A tick is repeated if its answer was lost. A direction without a stamp would be taken
            # for one of now.
            self._announcements.publish(self._announced)
            self._references.publish(self._reference)
            return
        if self._ticking and not known and self._first is not None:
            # The joint states since the first tick have not arrived yet. A plant that waits for an
            # answer repeats the last of them; until then time must not advance.
            return
        self._last = now
        self._first = now if self._first is None else self._first
        set_stamp(self._reference.header.stamp, now)
        # Joint states need time to advance; nobody holds the joints until then.
        self._reference.name = list(self._joints) if known else []
        if not known:
            self._publish([0] * len(self._joints), [])
            return
        if self._start is None or now < self._start:
            if self._start is None:
                self.destroy_subscription(self._origin_subscription)
            self._start = now
        self._move((now - self._start) / NANO)

    def _has_listeners(self) -> bool:
        """Return whether all listeners have been connected for a moment."""
        listeners = self._settings['wait_for_listeners']
        if self._start is not None or not listeners:
            return True
        if self._directions.get_subscription_count() < listeners:
            self._connected_since = None
            return False
        self._connected_since = self._connected_since or monotonic()
        return monotonic() - self._connected_since > _DISCOVERY_TIME

    def _move(self, time: float) -> None:
        self._time, (position, velocity, direction) = time, self._at(time)
        ends = self._ends(time)
        if not self._settings['announce_direction']:
            direction, ends = np.zeros_like(direction), np.full_like(ends, math.nan)
        self._reference.position = array('d', (self._origin + position).tobytes())
        self._reference.velocity = array('d', velocity.tobytes())
        self._publish(direction.astype(np.int8).tolist(), (self._origin + ends).tolist())
        self.finished = time >= self._duration and self._settings['when_done'] == 'exit'

    def _publish(self, direction: list[int], ends: list[float], reference: bool = True) -> None:
        self._direction.data = array('b', direction)
        self._announced.header.stamp = self._reference.header.stamp
        self._announced.velocity = array('d', direction)
        self._announced.position = array('d', ends)
        self._directions.publish(self._direction)
        self._announcements.publish(self._announced)
        # The reference last: see the class.
        if reference:
            self._references.publish(self._reference)

    def _report(self) -> Any:
        if self._time is None:
            missing = [joint for joint, position in zip(self._joints, self._origin)
                       if not np.isfinite(position)]
            return WARN, 'waits for ' + (
                'listeners to the direction' if not self._has_listeners() else
                f'a position of {", ".join(missing)} in joint_states' if missing else '/clock'), {}
        return OK, 'moving' if self._time < self._duration else 'done', {
            'time [s]': self._time, 'duration [s]': self._duration,
            'reference [rad]': self._reference.position,
            'reference velocity [rad/s]': self._reference.velocity,
            'direction': self._direction.data}

    def leave(self) -> None:
        """Announce no direction."""
        if self.context.ok() and any(self._direction.data):
            self._publish([0] * len(self._joints), [], reference=False)
        for publisher in (self._directions, self._announcements, self._references):
            # Lost messages are sent again only while the node exists.
            if self.context.ok():
                publisher.wait_for_all_acked(Duration(seconds=_ACKNOWLEDGEMENT_TIME))
