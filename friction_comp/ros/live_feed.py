# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Feeds the live page from the running system in a separate thread."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Sequence
import contextlib
from functools import partial
import math
import struct
import threading
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
import numpy as np
from rclpy.executors import ExternalShutdownException
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray

from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.recordings.activity import compensator_activity
from friction_comp.recordings.cdr import decode
from friction_comp.recordings.scan import values_of
from friction_comp.ros.dated_topics import stamp_of
from friction_comp.ros.executor import StreamExecutor
from friction_comp.ros.joint_io import command_unit
from friction_comp.ros.ros_start import own_node
from friction_comp.samples import Samples
from friction_comp.topics import TOPICS, TORQUE_UNIT

_QOS = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
# Real s between batches of messages; period of the states shown, ns; rows kept for each joint; ages
# of an outdated status and of an outdated command, s.
_BATCH_TIME, _STEP, _MAX_ROWS, _STATUS_AGE, _COMMAND_AGE = 0.01, 20_000_000, 3000, 5.0, 0.2
_COLUMNS = ('time', 'position', 'velocity', 'torque', 'load', 'command', 'direction',
            'reference_velocity')
_LEVELS = {0: 'ok', 1: 'warning', 2: 'problem', 3: 'problem'}
_WORST_FIRST = ('problem', 'warning', 'note', 'ok')


def frame_of(cdr: bytes) -> str:
    """Return the frame_id of a serialised message that begins with a header; '' without one."""
    if len(cdr) < 16:
        return ''
    length, = struct.unpack_from('<I' if cdr[1] & 1 else '>I', cdr, 12)
    return bytes(cdr[16:15 + length]).decode(errors='replace')


class LiveFeed:
    """Joints of a running system as a source of the live page.

    `joints` are by default those of the joint states. `models` has one for each joint, by default
    those of the compensator. Arrays on topics have the order of the compensator's joints; without a
    compensator, that of `joints`. `arguments` are ROS arguments.
    """

    title = 'What runs'
    duration = 0.0

    def __init__(self, joints: Sequence[str], models: Sequence[FrictionModel],
                 arguments: list[str], effort_is_current: bool = False) -> None:
        if models and joints and len(models) != len(joints):
            raise InputError(f'--model: one file per joint is needed, {len(joints)} for '
                             f'{", ".join(joints)}')
        self.joints, self._fixed = list(joints), bool(joints)
        self._models, self._in_ampere = list(models), effort_is_current
        # What the compensator reports: joints of arrays, and models with their paths.
        self._order: list[str] = []
        self._loaded: dict[str, tuple[str, FrictionModel | None]] = {}
        self._rows: defaultdict[str, deque[tuple[float, ...]]] = defaultdict(
            lambda: deque(maxlen=_MAX_ROWS))
        self._lock = threading.Lock()
        # Type, content and time of arrival of the last messages.
        self._last: dict[str, tuple[Any, bytes, float]] = {}
        self._status: dict[str, tuple[str, str, float]] = {}
        self._due, self._received = 0, 0.0
        self._first: int | None = None
        self._ros = contextlib.ExitStack()
        self._node = self._ros.enter_context(own_node('friction_comp_watch', arguments))
        self._node.batch_time = _BATCH_TIME
        self._subscribe()
        self._executor, self._stopped = StreamExecutor(self._node), threading.Event()
        self._thread = threading.Thread(target=self._spin, name='live feed', daemon=True)
        self._thread.start()

    def _subscribe(self) -> None:
        # The first subscription of a topic, that of a motor's driver, costs its publisher 45 us per
        # command, a second one little (bench/watch_cost.py). Of the two directions a planner uses
        # one; with both, the later message is valid.
        for kind, topic, key in (
                (Float64MultiArray, 'current_command', 'command'),
                (JointState, 'reference', 'reference'), (Int8MultiArray, 'direction', 'direction'),
                (JointState, 'direction_stamped', 'direction'),
                (WrenchStamped, 'interaction_wrench', 'load')):
            self._node.create_subscription(
                kind, topic, partial(self._keep_last, key, kind), _QOS, raw=True)
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, _QOS)
        self._node.create_subscription(
            JointState, 'joint_states', self._on_joint_states, _QOS, raw=True)

    def _keep_last(self, key: str, kind: Any, cdr: bytes) -> None:
        if key == 'load':
            key = f'load of {frame_of(cdr)}'
        self._last[key] = kind, cdr, time.monotonic()

    def _message(self, key: str, age: float = math.inf) -> Any:
        """Return the last message, None if there is none or if it is older than `age` s."""
        kind, cdr, arrival = self._last.get(key, (None, b'', 0.0))
        if kind is None or time.monotonic() - arrival > age:
            return None
        return deserialize_message(cdr, kind)

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            while not self._stopped.is_set():
                self._executor.spin_once(timeout_sec=0.1)

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            self._status[status.name] = (
                _LEVELS.get(ord(status.level), 'note'), status.message, time.monotonic())
            activity = compensator_activity(status)
            if activity and 'compensator' in status.name:
                self._order = activity.joints.split(', ')
            for joint, path in activity.models.items() if activity and not self._models else ():
                if self._loaded.get(joint, ('', None))[0] != path:
                    self._loaded[joint] = path, None
                    # The model file may be on another machine.
                    with contextlib.suppress(InputError):
                        self._loaded[joint] = path, FrictionModel.load(path, joint)

    def _on_joint_states(self, cdr: bytes) -> None:
        """Add a row for each joint, unless the last state was less than a period ago."""
        stamp = stamp_of(cdr) or time.time_ns()
        # A stamp long before that began a new time base.
        if self._due - 10 * _STEP < stamp < self._due:
            return
        if self._first is None or stamp < self._due:
            self._first = stamp
            with self._lock:
                self._rows.clear()
            self.joints = self.joints if self._fixed else []
        self._due, self._received = stamp + _STEP, time.monotonic()
        measured = {joint: values[0] for _, names, fields in decode(TOPICS['joint_states'], [cdr])
                    for joint, values in values_of('joint_states', names, fields)[1].items()}
        if not self._fixed:
            # Several drivers may each publish some of the joints.
            self.joints = list(dict.fromkeys((*self.joints, *measured)))
        reference = self._message('reference')
        loads = {joint: self._message(f'load of {joint}') for joint in self.joints}
        others = [{joint: load.wrench.torque.z for joint, load in loads.items() if load},
                  self._commands(), self._directions(),
                  _by_joint(reference.name, reference.velocity) if reference else {}]
        with self._lock:
            for joint in set(self.joints) & set(measured):
                self._rows[joint].append((1e-9 * (stamp - self._first), *measured[joint], *(
                    signal.get(joint, math.nan) for signal in others)))

    def _commands(self) -> dict[str, float]:
        """Return the command in A of each joint; a torque is converted only with a model."""
        command = self._message('command', _COMMAND_AGE)
        values = {} if command is None else self._in_order(command.data)
        if command is None or command_unit(command) != TORQUE_UNIT:
            return values
        models = {joint: self._model(joint) for joint in values}
        return {joint: values[joint] / model.drive.torque_per_current
                for joint, model in models.items() if model is not None}

    def _directions(self) -> dict[str, float]:
        message = self._message('direction')
        if isinstance(message, JointState):
            return _by_joint(message.name, np.sign(message.velocity))
        return {} if message is None else self._in_order(message.data)

    def _in_order(self, values: Any) -> dict[str, float]:
        """Return the values of an array by joint; empty if their order is not known."""
        known = self._order or (self.joints if self._fixed or len(self.joints) == 1 else [])
        return _by_joint(known, values) if len(values) == len(known) else {}

    def window(self, joint: str, end: float, length: float) -> dict[str, np.ndarray]:
        """Return the signals of the last `length` s."""
        with self._lock:
            table = np.array(self._rows.get(joint, ())).reshape(-1, len(_COLUMNS))
        if len(table):
            table = table[table[:, 0] >= table[-1, 0] - length]
        data = dict(zip(_COLUMNS, table.T))
        data.update(dict.fromkeys(('current', 'predicted', 'residual'),
                                  np.full(len(table), np.nan)))
        model = self._model(joint)
        if self._in_ampere:
            gain = math.nan if model is None else model.drive.torque_per_current
            data['torque'] = gain * data['torque']
        if model is not None and len(table) > 10:
            self._compare(data, model)
        return data

    def _model(self, joint: str) -> FrictionModel | None:
        if not self._models:
            return self._loaded.get(joint, ('', None))[1]
        return dict(zip(self.joints, self._models)).get(joint)

    @staticmethod
    def _compare(data: dict[str, np.ndarray], model: FrictionModel) -> None:
        data['current'] = data['torque'] / model.drive.torque_per_current
        velocity, load = (data[name] if np.isfinite(data[name]).all() else None
                          for name in ('velocity', 'load'))
        samples = Samples(time=data['time'], position=data['position'], current=data['current'],
                          velocity=velocity, load=load)
        with contextlib.suppress(InputError):
            data['predicted'] = model.predict(samples)
            # The load is used where it is known; its sensor may have started later.
            data['residual'] = model.measured(
                samples.with_(load=data['load'])) - data['predicted']

    def status(self) -> list[tuple[str, str, str]]:
        """Return the status of the nodes, worst first."""
        now = time.monotonic()
        entries = [(level, name, text) for name, (level, text, since) in sorted(
            self._status.items()) if now - since < _STATUS_AGE]
        if now - self._received > 1.0:
            entries.append(('problem', 'joint_states', 'none'))
        return sorted(entries, key=lambda item: _WORST_FIRST.index(item[0])) or [
            ('note', 'nodes', 'no diagnostics')]

    def close(self) -> None:
        """Stop listening."""
        # The thread must leave the middleware before it is shut down.
        self._stopped.set()
        self._thread.join()
        self._executor.shutdown()
        self._ros.close()


def _by_joint(joints: Sequence[str], values: Any) -> dict[str, float]:
    return dict(zip(joints, map(float, values)))
