# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Observes a running system for some seconds without changing it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
import math
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
import numpy as np
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.utilities import get_rmw_implementation_identifier
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray

from friction_comp.errors import InputError
from friction_comp.monitoring.observation import Endpoint, Observation, StatesSeen, TopicSeen
from friction_comp.recordings.cdr import decode
from friction_comp.recordings.scan import values_of
from friction_comp.ros.joint_io import command_unit
from friction_comp.ros.tool_client import ToolClient
from friction_comp.topics import TOPICS, TORQUE_UNIT

NAME = 'friction_comp_doctor'
_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
# Timeout of parameter requests, s, and steps in which progress is shown.
_TIMEOUT, _STEPS = 3.0, 50
_KINDS = {'joint_states': JointState, 'current_command': Float64MultiArray,
          'direction': Int8MultiArray, 'interaction_wrench': WrenchStamped,
          '/diagnostics': DiagnosticArray, '/clock': Clock}


def middleware() -> str:
    """Return the name of the middleware in use."""
    return get_rmw_implementation_identifier()


def observe(seconds: float, arguments: list[str],
            progress: Callable[[float, str], None]) -> Observation:
    """Observe a running system for `seconds` s; `progress` gets the share 0..1 and the step."""
    # Messages of each topic, with the system time in s of their arrival.
    messages: dict[str, list[tuple[float, Any]]] = {topic: [] for topic in _KINDS}
    with ToolClient(patience=_TIMEOUT, name=NAME, arguments=arguments) as ros:
        for topic, kind in _KINDS.items():
            ros.node.create_subscription(
                kind, topic, lambda message, topic=topic: messages[topic].append(
                    (time.time(), message)), _QOS, raw=topic == 'joint_states')
        for step in range(_STEPS):
            progress(0.8 * step / _STEPS, 'listening')
            ros.wait(seconds / _STEPS)
        seen = _observation(ros.node, seconds, messages)
        for index, name in enumerate(seen.nodes):
            progress(0.8 + 0.2 * index / len(seen.nodes), f'asking {name}')
            # Not every node answers.
            with suppress(InputError):
                seen.parameters[name] = ros.parameters(name)
        return seen


def _observation(node: Any, seconds: float, messages: dict[str, list[tuple[float, Any]]]
                 ) -> Observation:
    commands = messages['current_command']
    width = max((len(command.data) for _, command in commands), default=0)
    commands = [(received, command) for received, command in commands if len(command.data) == width]
    load: dict[str, list[Any]] = {}
    for received, message in messages['interaction_wrench']:
        load.setdefault(message.header.frame_id, []).append(
            (received, message.wrench.torque.z))
    return Observation(
        seconds,
        nodes=sorted(f'{space.rstrip("/")}/{name}'
                     for name, space in node.get_node_names_and_namespaces()
                     if name != NAME and not name.startswith('_')),
        topics={name: TopicSeen(
            list(types), _endpoints(node.get_publishers_info_by_topic(name)),
            _endpoints(node.get_subscriptions_info_by_topic(name)))
            for name, types in node.get_topic_names_and_types()
            if {*TOPICS.values()} & set(types)},
        names={name: node.resolve_topic_name(name) for name in TOPICS},
        states=_states_of(messages['joint_states']),
        commands=np.array([list(command.data) for _, command in commands]),
        commanded=np.array([received for received, _ in commands]),
        command_unit='N·m' if commands and command_unit(commands[-1][1]) == TORQUE_UNIT else 'A',
        directions=[[int(value) for value in message.data] for _, message in messages['direction']],
        load={joint: np.array(values) for joint, values in load.items()},
        diagnostics={status.name: (ord(status.level), status.message)
                     for _, message in messages['/diagnostics'] for status in message.status},
        clock=bool(messages['/clock']))


def _endpoints(infos: Any) -> list[Endpoint]:
    return [Endpoint(
        f'{info.node_namespace.rstrip("/")}/{info.node_name}',
        info.qos_profile.reliability == ReliabilityPolicy.RELIABLE,
        info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL, info.topic_type)
        for info in infos if info.node_name != NAME]


def _states_of(messages: Sequence[tuple[float, bytes]]) -> StatesSeen | None:
    """Return serialised joint states as arrays; None if there are none."""
    if not messages:
        return None
    # By length and layout of the message: joints are listed in the order they were received.
    parts = sorted(decode(TOPICS['joint_states'], [cdr for _, cdr in messages]),
                   key=lambda part: part[0][0])
    joints = list(dict.fromkeys(name for _, names, _ in parts for name in names))
    table = np.full((len(messages), len(joints), 3), math.nan)
    named, stamps = np.zeros(table.shape[:2], dtype=bool), np.zeros(len(messages))
    for index, names, fields in parts:
        stamps[index] = 1e-9 * fields['stamp']
        for joint, values in values_of('joint_states', names, fields)[1].items():
            if joint:
                table[index, joints.index(joint)] = values
                named[index, joints.index(joint)] = True
    twice = [joint for joint in joints if any(names.count(joint) > 1 for _, names, _ in parts)]
    return StatesSeen(joints, np.array([received for received, _ in messages]), stamps,
                      table[..., 0], table[..., 1], table[..., 2], twice, named)
