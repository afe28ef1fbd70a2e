# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the model of a joint, and a new model on trial, with measured currents."""

from __future__ import annotations

from collections import deque
import math
import struct
from typing import Any

from geometry_msgs.msg import WrenchStamped
import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState, Temperature

from friction_comp.model.friction_model import FrictionModel
from friction_comp.monitoring.live_residual import LiveResidual

# Period of the states that are used, and largest age of a load and of a temperature, ns.
_STEP, _LOAD_AGE, _TEMPERATURE_AGE = 8_000_000, 200_000_000, 60_000_000_000
# Messages of a topic kept for the states of their time, which may be read later: ten seconds at a
# kilohertz, for a busy machine.
_MAX_KEPT = 10_000
# Fewest blocks of motion to judge a new model, and blocks after which its trial ends.
_FEWEST_BLOCKS, _TRIAL_BLOCKS = 30, 300
# A new model is worse if its error is larger by this factor.
_WORSE_FACTOR = 1.05


def frame_of(cdr: bytes) -> str:
    """Return the frame_id of a serialised message that begins with a header; '' without one."""
    if len(cdr) < 16:
        return ''
    length, = struct.unpack_from('<I' if cdr[1] & 1 else '>I', cdr, 12)
    return bytes(cdr[16:15 + length]).decode(errors='replace')


def value_at(values: Any, index: int) -> float:
    """Return an element of an array in a message; NaN if the array is shorter."""
    return float(values[index]) if len(values) > index else math.nan


def values_of(message: Any, joint: str) -> tuple[float, float, float]:
    """Return position, velocity and effort of a joint in a joint state."""
    index = message.name.index(joint)
    return (value_at(message.position, index), value_at(message.velocity, index),
            value_at(message.effort, index))


class LiveSignals:
    """Converts serialised messages to rows for `LiveResidual`, some hundred per second.

    Parameters
    ----------
    joints : list of str
    torque_per_current : list of float
        N·m/A at each joint.
    """

    def __init__(self, joints: list[str], torque_per_current: list[float]) -> None:
        self._joints, self._gains = joints, torque_per_current
        self._due = self._last = 0
        self._held: dict[tuple[str, str], deque[tuple[int, bytes]]] = {}
        self._rows: list[list[list[float]]] = [[] for _ in joints]

    def hold(self, topic: str, stamp: int, cdr: bytes) -> None:
        """Keep a message about one joint (its frame_id) for the states of its time."""
        held = self._held.setdefault((topic, frame_of(cdr)), deque(maxlen=_MAX_KEPT))
        if held and stamp < held[-1][0]:
            # Time went back.
            held.clear()
        held.append((stamp, bytes(cdr)))

    def see(self, stamp: int, cdr: bytes) -> None:
        """Add a joint state, unless it is within a period of the last one."""
        if stamp < self._last:
            self._due = 0
        self._last = stamp
        if stamp < self._due:
            return
        self._due = stamp + _STEP
        message = deserialize_message(bytes(cdr), JointState)
        for index, joint in enumerate(self._joints):
            if joint not in message.name:
                continue
            position, velocity, effort = values_of(message, joint)
            self._rows[index].append([
                stamp * 1e-9, position, velocity, effort / self._gains[index],
                self._load(joint, stamp), self._temperature(joint, stamp)])

    def _load(self, joint: str, stamp: int) -> Any:
        message = self._fresh('interaction_wrench', joint, stamp, WrenchStamped, _LOAD_AGE)
        return math.nan if message is None else message.wrench.torque.z

    def _temperature(self, joint: str, stamp: int) -> Any:
        message = self._fresh('motor_temperature', joint, stamp, Temperature, _TEMPERATURE_AGE)
        return math.nan if message is None else message.temperature

    def _fresh(self, topic: str, joint: str, stamp: int, kind: Any, age: Any) -> Any:
        held = self._held.get((topic, joint))
        if held is None:
            return None
        # Several may have been read at once, the newest of them long after this state.
        while len(held) > 1 and held[1][0] <= stamp:
            held.popleft()
        return None if abs(stamp - held[0][0]) > age else deserialize_message(held[0][1], kind)

    def take(self) -> list[np.ndarray]:
        """Return the rows of each joint since the last call."""
        rows, self._rows = self._rows, [[] for _ in self._joints]
        return [np.array(one).reshape(-1, 6) for one in rows]


class JointWatch:
    """Watches one joint's model, and a new model while it is on trial.

    Parameters
    ----------
    tolerance : float
        As for `ResidualWatch`.

    Attributes
    ----------
    last_load : float
        Stamp of the last sample with a measured load, s.
    """

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self.last_load = -math.inf
        self.file = ''
        self.residual: LiveResidual | None = None
        self.before: tuple[str, LiveResidual] | None = None

    def use(self, path: str) -> None:
        """Compare with the model of a file, unless it is in use already."""
        if path != self.file:
            self.file = path
            self.residual = LiveResidual(FrictionModel.load(path), self._tolerance)
            self.before = None

    def try_out(self, path: str) -> None:
        """Compare a new model and the present one on the same motion."""
        before, old = self.file, FrictionModel.load(self.file)
        self.use(path)
        self.before = before, LiveResidual(old, self._tolerance)

    def take(self, rows: np.ndarray) -> None:
        """Add measurements, as in `LiveResidual`."""
        if self.residual is not None:
            self.residual.take(rows)
        if self.before is not None:
            self.before[1].take(rows)

    def worse(self) -> str:
        """Return why the new model is worse than the previous one; empty if it is not.

        The trial ends after enough motion.
        """
        if self.before is None or self.residual is None:
            return ''
        old, new = self.before[1].watch, self.residual.watch
        blocks = min(old.blocks, new.blocks)
        if blocks < _FEWEST_BLOCKS:
            return ''
        errors = old.error(blocks), new.error(blocks)
        if blocks >= _TRIAL_BLOCKS:
            self.before = None
        if errors[1] <= _WORSE_FACTOR * errors[0]:
            return ''
        return (f'on {blocks} blocks of motion its error is {1e3 * errors[1]:.3g} mA, that of '
                f'the previous model {1e3 * errors[0]:.3g} mA')
