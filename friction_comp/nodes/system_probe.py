# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Observes a running system for some seconds without changing it."""

from __future__ import annotations

from collections.abc import Callable
import math
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
import numpy as np
from rcl_interfaces.srv import GetParameters, ListParameters
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.utilities import get_rmw_implementation_identifier
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray

from friction_comp.monitoring.observation import Endpoint, Observation, StatesSeen, TopicSeen
from friction_comp.nodes.joint_io import command_unit
from friction_comp.nodes.ros_start import start_ros
from friction_comp.topics import TOPICS, TORQUE_UNIT

NAME = 'friction_comp_doctor'
# Receives from every publisher.
_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
# Timeout of parameter requests, s, and largest number of parameters per node.
_TIMEOUT, _MAX_PARAMETERS = 3.0, 500


def middleware() -> str:
    """Return the name of the middleware in use."""
    return get_rmw_implementation_identifier()


def observe(seconds: float, arguments: list[str],
            progress: Callable[[float, str], None]) -> Observation:
    """Observe a running system.

    Parameters
    ----------
    seconds : float
    arguments : list of str
        ROS arguments, for namespace and remappings.
    progress : callable
        Called with progress 0..1 and the present step.
    """
    context = Context()
    start_ros('doctor', arguments, context)
    node = Node(NAME, context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        return _Probe(node, executor, seconds, progress).result()
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown(context=context)


class _Probe:
    def __init__(self, node: Any, executor: Any, seconds: Any, progress: Any) -> None:
        self._node, self._executor = node, executor
        self._seconds, self._progress = seconds, progress
        self._states: list[Any] = []
        self._load: dict[str, Any] = {}
        self._commands: list[Any] = []
        self.seen = Observation(seconds, names={
            name: node.resolve_topic_name(name) for name in TOPICS})
        for kind, topic, take in (
                (JointState, 'joint_states', self._on_state),
                (Float64MultiArray, 'current_command', self._on_command),
                (Int8MultiArray, 'direction', lambda m: self.seen.directions.append(
                    [int(value) for value in m.data])),
                (WrenchStamped, 'interaction_wrench', self._on_wrench),
                (DiagnosticArray, '/diagnostics', self._on_diagnostics),
                (Clock, '/clock', self._on_clock)):
            node.create_subscription(kind, topic, take, _QOS)

    def _on_state(self, message: Any) -> None:
        self._states.append((time.time(), message))

    def _on_command(self, message: Any) -> None:
        self._commands.append((time.time(), list(message.data)))
        self.seen.command_unit = 'N·m' if command_unit(message) == TORQUE_UNIT else 'A'

    def _on_wrench(self, message: Any) -> None:
        self._load.setdefault(message.header.frame_id, []).append(
            (time.time(), message.wrench.torque.z))

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            self.seen.diagnostics[status.name] = ord(status.level), status.message

    def _on_clock(self, message: Any) -> None:
        self.seen.clock = True

    def result(self) -> Any:
        """Observe, and return the observation."""
        begin = time.monotonic()
        while (passed := time.monotonic() - begin) < self._seconds:
            self._progress(0.8 * passed / self._seconds, 'listening')
            self._executor.spin_once(timeout_sec=0.05)
        seen = self.seen
        seen.nodes = sorted(
            f'{space.rstrip("/")}/{name}'
            for name, space in self._node.get_node_names_and_namespaces()
            if name != NAME and not name.startswith('_'))
        self._observe_topics()
        seen.states = _to_arrays(self._states)
        width = max((len(command) for _, command in self._commands), default=0)
        complete = [(received, command) for received, command in self._commands
                    if len(command) == width]
        seen.commands = np.array([command for _, command in complete])
        seen.commanded = np.array([received for received, _ in complete])
        seen.load = {joint: np.array(values) for joint, values in self._load.items()}
        for index, name in enumerate(seen.nodes):
            self._progress(0.8 + 0.2 * index / len(seen.nodes), f'asking {name}')
            seen.parameters[name] = self._parameters(name)
        return seen

    def _observe_topics(self) -> None:
        wanted = {*TOPICS.values()}
        for name, types in self._node.get_topic_names_and_types():
            if not wanted & set(types):
                continue
            self.seen.topics[name] = TopicSeen(
                list(types),
                self._endpoints(self._node.get_publishers_info_by_topic(name)),
                self._endpoints(self._node.get_subscriptions_info_by_topic(name)))

    @staticmethod
    def _endpoints(infos: Any) -> Any:
        return [Endpoint(
            f'{info.node_namespace.rstrip("/")}/{info.node_name}',
            info.qos_profile.reliability == ReliabilityPolicy.RELIABLE,
            info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)
            for info in infos if info.node_name != NAME]

    def _parameters(self, name: str) -> Any:
        """Return a node's parameters; empty where it does not answer."""
        listed = self._call(ListParameters, f'{name}/list_parameters', ListParameters.Request())
        names = list(listed.result.names)[:_MAX_PARAMETERS] if listed else []
        values = self._call(GetParameters, f'{name}/get_parameters',
                            GetParameters.Request(names=names)) if names else None
        if values is None:
            return {}
        return dict(zip(names, map(parameter_value_to_python, values.values)))

    def _call(self, kind: Any, name: str, request: Any) -> Any:
        client = self._node.create_client(kind, name)
        try:
            end = time.monotonic() + _TIMEOUT
            while not client.service_is_ready():
                if time.monotonic() > end:
                    return None
                self._executor.spin_once(timeout_sec=0.05)
            future = client.call_async(request)
            while not future.done():
                if time.monotonic() > end:
                    return None
                self._executor.spin_once(timeout_sec=0.05)
            return future.result()
        finally:
            self._node.destroy_client(client)


def _to_arrays(messages: Any) -> Any:
    """Return joint states as arrays; None if there are none."""
    if not messages:
        return None
    joints = list(dict.fromkeys(name for _, message in messages for name in message.name))
    index_of = {joint: index for index, joint in enumerate(joints)}
    table = np.full((3, len(messages), len(joints)), math.nan)
    stamps = np.empty(len(messages))
    for row, (_, message) in enumerate(messages):
        stamps[row] = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        columns = [index_of[name] for name in message.name]
        for which, values in enumerate((message.position, message.velocity, message.effort)):
            if len(values) == len(columns):
                table[which, row, columns] = values
    twice = [joint for joint in joints
             if any(message.name.count(joint) > 1 for _, message in messages)]
    return StatesSeen(joints, np.array([received for received, _ in messages]), stamps,
                      table[0], table[1], table[2], twice)
