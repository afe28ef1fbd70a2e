# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Observes a running system for some seconds without changing it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import suppress
import math
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from rclpy.qos import ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from friction_comp.errors import InputError
from friction_comp.monitoring.checkup import Endpoint, Observation
from friction_comp.ros.joint_io import BEST_EFFORT, command_unit
from friction_comp.ros.tool_client import ToolClient
from friction_comp.stamps import nanoseconds
from friction_comp.topics import TOPICS, TORQUE_UNIT

NAME = 'friction_comp_doctor'
# s until a node that does not answer is left out, and between reports of progress.
_TIMEOUT, _STEP = 3.0, 0.1


def observe(seconds: float, arguments: Sequence[str],
            progress: Callable[[float, str], None]) -> Observation:
    """Observe a running system for `seconds` s; `progress` gets the share 0..1 and the step."""
    seen, commands = Observation(seconds), []
    states: defaultdict[str, list[list[float]]] = defaultdict(list)

    def on_states(message: Any) -> None:
        now, stamp = time.time(), 1e-9 * nanoseconds(message.header.stamp)
        signals = [values if len(values) == len(message.name) else [math.nan] * len(message.name)
                   for values in (message.position, message.velocity, message.effort)]
        for joint, *values in zip(message.name, *signals):
            states[joint].append([now, stamp, *values])

    def on_command(message: Any) -> None:
        commands.append([time.time(), *message.data])
        seen.in_torque = command_unit(message) == TORQUE_UNIT

    def on_diagnostics(message: Any) -> None:
        seen.diagnostics.update({
            status.name: (ord(status.level), status.message) for status in message.status})
    with ToolClient(patience=_TIMEOUT, name=NAME, arguments=arguments) as ros:
        for kind, topic, take in ((JointState, 'joint_states', on_states),
                                  (Float64MultiArray, 'current_command', on_command),
                                  (DiagnosticArray, '/diagnostics', on_diagnostics),
                                  (Clock, '/clock', lambda _: setattr(seen, 'clock', True))):
            ros.node.create_subscription(kind, topic, take, BEST_EFFORT)
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            progress(0.8 * (1.0 - left / seconds), 'listening')
            ros.wait(min(left, _STEP))
        node = ros.node
        seen.nodes = sorted(f'{space.rstrip("/")}/{name}'
                            for name, space in node.get_node_names_and_namespaces()
                            if name != NAME and not name.startswith('_'))
        seen.names = {name: node.resolve_topic_name(name) for name in TOPICS}
        seen.topics = {name: (_endpoints(node.get_publishers_info_by_topic(name)),
                              _endpoints(node.get_subscriptions_info_by_topic(name)))
                       for name, types in node.get_topic_names_and_types()
                       if {*TOPICS.values()} & set(types)}
        for index, name in enumerate(seen.nodes):
            progress(0.8 + 0.2 * index / len(seen.nodes), f'asking {name}')
            # Not every node answers.
            with suppress(InputError):
                seen.parameters[name] = ros.parameters(name)
    width = max(map(len, commands), default=1)
    seen.commands = np.array([row for row in commands if len(row) == width]).reshape(-1, width)
    seen.states = {joint: np.array(rows) for joint, rows in states.items()}
    return seen


def _endpoints(infos: Any) -> list[Endpoint]:
    return [Endpoint(f'{info.node_namespace.rstrip("/")}/{info.node_name}', info.topic_type,
                     info.qos_profile.reliability == ReliabilityPolicy.RELIABLE)
            for info in infos if info.node_name != NAME]
