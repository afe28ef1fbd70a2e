# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Feeds the live page from the running system in a separate thread."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
import contextlib
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
from friction_comp.nodes.dated_topics import stamp_of
from friction_comp.nodes.executor import StreamExecutor
from friction_comp.nodes.joint_io import command_unit
from friction_comp.nodes.ros_start import own_node
from friction_comp.recordings.activity import compensator_activity
from friction_comp.samples import Samples
from friction_comp.topics import TORQUE_UNIT

_QOS = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
# A command must still be in its queue when the state measured under it is read, which may be the
# oldest of five.
_COMMAND_QOS = QoSProfile(depth=25, reliability=ReliabilityPolicy.BEST_EFFORT)
# Commands that are kept, and intervals for which one is valid, at least a step of the page.
_MAX_COMMANDS, _VALID_INTERVALS = 64, 3
# Period of the states shown, ns; rows kept for each joint; age of an outdated status, s.
_STEP, _MAX_ROWS, _STATUS_AGE = 20_000_000, 3000, 5.0
# Processing messages in batches saves time: the page is drawn five times a second.
_NAP = 0.01
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


def _value_at(values: Any, index: int) -> float:
    return float(values[index]) if len(values) > index else math.nan


class SentCommands:
    """The last commands and their send times, to find the one under which a state was measured.

    The page may run on a busy machine and subscribes best effort, so the last command received may
    be older or newer than the last state.
    """

    def __init__(self) -> None:
        self._received: deque[tuple[int, bytes]] = deque(maxlen=_MAX_COMMANDS)

    def take(self, cdr: bytes, sent: int) -> None:
        """Add a serialised command, sent at a system time in ns."""
        self._received.append((sent, cdr))

    def at(self, sent: int) -> Any:
        """Return the command that was valid at a system time in ns; None if unknown."""
        times = [time for time, _ in self._received]
        last = bisect_right(times, sent) - 1
        interval = np.median(np.diff(times)) if len(times) > 1 else 0
        if last < 0 or sent - times[last] > max(_VALID_INTERVALS * interval, _STEP):
            return None
        return deserialize_message(self._received[last][1], Float64MultiArray)


class LiveFeed:
    """Joints of a running system.

    Parameters
    ----------
    joints : list of str
        In the order of arrays on topics; if empty, those of the joint states.
    models : sequence of FrictionModel
        One for each joint, in that order; if empty, those of the compensator.
    arguments : list of str
        ROS arguments.
    """

    title = 'What runs'
    duration = 0.0

    def __init__(self, joints: Sequence[str], models: Sequence[FrictionModel],
                 arguments: list[str]) -> None:
        if models and joints and len(models) != len(joints):
            raise InputError(f'--model: one file per joint is needed, {len(joints)} for '
                             f'{", ".join(joints)}')
        self.joints, self._fixed = list(joints), bool(joints)
        self._models, self._given = list(models), bool(models)
        self._loaded: dict[str, tuple[str, FrictionModel | None]] = {}
        self._rows: dict[str, deque[tuple[float, ...]]] = {}
        self._lock = threading.Lock()
        self._held: dict[Any, Any] = {}
        self._status: dict[str, tuple[str, str, float]] = {}
        self._due, self._received = 0, 0.0
        self._first: int | None = None
        self._commands = SentCommands()
        self._ros = contextlib.ExitStack()
        self._node = self._ros.enter_context(own_node('friction_comp_watch', arguments))
        self._node.nap = _NAP
        self._subscribe()
        self._executor = StreamExecutor(self._node)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._spin, name='live feed', daemon=True)
        self._thread.start()

    def _subscribe(self) -> None:
        held = self._held

        def hold(kind: Any, topic: str, take: Any, qos: Any = _QOS) -> None:
            self._node.create_subscription(kind, topic, take, qos, raw=True)
        # The first subscription of a topic, that of a motor's driver, costs its publisher 45 us per
        # command, a second one little (bench/watch_cost.py).
        hold(Float64MultiArray, 'current_command', lambda cdr, info: self._commands.take(
            cdr, info['source_timestamp']), _COMMAND_QOS)
        hold(JointState, 'reference', lambda cdr: held.update(reference=cdr))
        # A planner uses one of them; with both, the later message is valid.
        for kind, topic in ((Int8MultiArray, 'direction'), (JointState, 'direction_stamped')):
            hold(kind, topic, lambda cdr, kind=kind: held.update(direction=(kind, cdr)))
        hold(WrenchStamped, 'interaction_wrench',
             lambda cdr: held.update({('load', frame_of(cdr)): cdr}))
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, _QOS)
        hold(JointState, 'joint_states', self._on_joint_states)

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            while not self._stopped.is_set():
                self._executor.spin_once(timeout_sec=0.1)

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            self._status[status.name] = (
                _LEVELS.get(ord(status.level), 'note'), status.message, time.monotonic())
            activity = None if self._given else compensator_activity(status)
            for joint, path in activity.models.items() if activity else ():
                self._use(joint, path)

    def _use(self, joint: str, path: str) -> None:
        """Show a joint with the model that its compensator reports."""
        if self._loaded.get(joint, ('', None))[0] != path:
            model = None
            # The model file may be on another machine.
            with contextlib.suppress(InputError):
                model = FrictionModel.load(path, joint)
            self._loaded[joint] = path, model

    def _on_joint_states(self, cdr: bytes, info: dict[str, Any]) -> None:
        stamp = stamp_of(cdr) or time.time_ns()
        if self._due - 10 * _STEP < stamp < self._due:
            return
        self._due, self._received = stamp + _STEP, time.monotonic()
        if self._first is None or stamp < self._first:
            self._first = stamp
            with self._lock:
                self._rows.clear()
        message = deserialize_message(cdr, JointState)
        if not self._fixed:
            self.joints = list(message.name)
        command, directions = self._commands.at(info['source_timestamp']), self._directions()
        reference = self._held.get('reference')
        reference = reference and deserialize_message(reference, JointState)
        with self._lock:
            for index, joint in enumerate(self.joints):
                if joint in message.name:
                    at = message.name.index(joint)
                    row = (1e-9 * (stamp - self._first), *(_value_at(values, at) for values in (
                               message.position, message.velocity, message.effort)),
                           self._load(joint), self._current(command, joint, index),
                           directions.get(joint, math.nan),
                           _value_at(reference.velocity, list(reference.name).index(joint))
                           if reference and joint in reference.name else math.nan)
                    self._rows.setdefault(joint, deque(maxlen=_MAX_ROWS)).append(row)

    def _directions(self) -> dict[str, float]:
        kind, cdr = self._held.get('direction', (None, b''))
        if kind is None:
            return {}
        message = deserialize_message(cdr, kind)
        if kind is Int8MultiArray:
            return dict(zip(self.joints, map(float, message.data)))
        return dict(zip(message.name, np.sign(message.velocity).tolist()))

    def _current(self, command: Any, joint: str, index: int) -> float:
        """Return a joint's command in A; NaN if unknown, or if it is a torque and has no model."""
        if command is None:
            return math.nan
        value = _value_at(command.data, index)
        if command_unit(command) != TORQUE_UNIT:
            return value
        model = self._model(joint)
        return math.nan if model is None else value / model.drive.torque_per_current

    def _load(self, joint: str) -> float:
        cdr = self._held.get(('load', joint))
        return math.nan if cdr is None else deserialize_message(cdr, WrenchStamped).wrench.torque.z

    def window(self, joint: str, end: float, length: float) -> dict[str, np.ndarray]:
        """Return the signals of the last `length` s."""
        with self._lock:
            table = np.array(self._rows.get(joint, ())).reshape(-1, len(_COLUMNS))
        if len(table):
            table = table[table[:, 0] >= table[-1, 0] - length]
        data = dict(zip(_COLUMNS, table.T))
        none = np.full(len(table), np.nan)
        data.update(current=none, predicted=none, residual=none)
        model = self._model(joint)
        if model is not None and len(table) > 10:
            self._compare(data, model)
        return data

    def _model(self, joint: str) -> FrictionModel | None:
        if not self._given:
            return self._loaded.get(joint, ('', None))[1]
        index = self.joints.index(joint) if joint in self.joints else len(self._models)
        return self._models[index] if index < len(self._models) else None

    @staticmethod
    def _compare(data: dict[str, np.ndarray], model: FrictionModel) -> None:
        gain = model.drive.torque_per_current
        data['current'] = data['torque'] / gain
        velocity = data['velocity'] if np.isfinite(data['velocity']).all() else None
        load = data['load'] if np.isfinite(data['load']).all() else None
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
        entries = [(level, name, words) for name, (level, words, since) in sorted(
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
