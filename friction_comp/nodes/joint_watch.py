# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the model of a joint, and a new model on trial, with measured currents."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
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
# A busy machine reads all waiting messages of one topic before those of the next. States wait this
# long for the load of their time, ns; other messages are kept for ten seconds at a kilohertz.
_PATIENCE = 5_000_000_000
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
        self._states: list[deque[tuple[int, list[float]]]] = [deque() for _ in joints]

    def add_message(self, topic: str, stamp: int, cdr: bytes) -> None:
        """Keep a message about one joint (its frame_id) for the states of its time."""
        held = self._held.setdefault((topic, frame_of(cdr)), deque(maxlen=_MAX_KEPT))
        if held and stamp < held[-1][0]:
            # Time went back.
            held.clear()
        held.append((stamp, bytes(cdr)))

    def add_state(self, stamp: int, cdr: bytes) -> None:
        """Add a joint state, unless it is within a period of the last one."""
        if stamp < self._last:
            # Time went back.
            self._due = 0
            for states in self._states:
                states.clear()
        self._last = stamp
        if stamp < self._due:
            return
        self._due = stamp + _STEP
        message = deserialize_message(bytes(cdr), JointState)
        for index, joint in enumerate(self._joints):
            if joint not in message.name:
                continue
            position, velocity, effort = values_of(message, joint)
            self._states[index].append((
                stamp, [stamp * 1e-9, position, velocity, effort / self._gains[index]]))

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
        """Return the new rows of each joint whose load is known, or has not come in time."""
        rows = []
        for joint, states in zip(self._joints, self._states):
            held = self._held.get(('interaction_wrench', joint))
            complete = max(held[-1][0], self._last - _PATIENCE) if held else self._last
            joint_rows = []
            while states and states[0][0] <= complete:
                stamp, row = states.popleft()
                joint_rows.append([*row, self._load(joint, stamp), self._temperature(joint, stamp)])
            rows.append(np.array(joint_rows).reshape(-1, 6))
        return rows


@dataclass(frozen=True)
class Trial:
    """The model that a new one replaced, compared on the same motion.

    Parameters
    ----------
    file : str
        Path of the previous model.
    residual : LiveResidual
    """

    file: str
    residual: LiveResidual


class JointWatch:
    """Watches one joint's model, and a new model while it is on trial.

    Parameters
    ----------
    tolerance : float
        As for `ResidualMonitor`.
    path : str
        Model file to begin with.

    Attributes
    ----------
    last_load : float
        Stamp of the last sample with a measured load, s.
    file : str
        Path of the model in use.
    residual : LiveResidual
        Of that model.
    trial : Trial or None
        None if no model is on trial.
    """

    def __init__(self, tolerance: float, path: str) -> None:
        self._tolerance = tolerance
        self.last_load = -math.inf
        self.trial: Trial | None = None
        self.file, self.residual = path, self._load(path)

    def _load(self, path: str) -> LiveResidual:
        return LiveResidual(FrictionModel.load(path), self._tolerance)

    def use(self, path: str) -> None:
        """Compare with the model of a file, unless it is in use already."""
        if path != self.file:
            self.residual = self._load(path)
            self.file, self.trial = path, None

    def start_trial(self, path: str) -> None:
        """Compare a new model and the present one on the same motion."""
        trial = Trial(self.file, self._load(self.file))
        self.use(path)
        self.trial = trial

    def take(self, rows: np.ndarray) -> None:
        """Add measurements, as in `LiveResidual`."""
        self.residual.take(rows)
        if self.trial is not None:
            self.trial.residual.take(rows)

    def end_trial(self) -> tuple[str, str] | None:
        """End the trial if the new model is worse, or if there was enough motion.

        Returns
        -------
        tuple of str, or None
            File of the previous model and why the new one is worse; None if it is not.
        """
        if self.trial is None:
            return None
        previous, old, new = self.trial.file, self.trial.residual.monitor, self.residual.monitor
        blocks = min(old.blocks, new.blocks)
        if blocks < _FEWEST_BLOCKS:
            return None
        errors = old.error(blocks), new.error(blocks)
        worse = errors[1] > _WORSE_FACTOR * errors[0]
        if worse or blocks >= _TRIAL_BLOCKS:
            self.trial = None
        if not worse:
            return None
        return previous, (
            f'on {blocks} blocks of motion its error is {1e3 * errors[1]:.3g} mA, that of the '
            f'previous model {1e3 * errors[0]:.3g} mA')
