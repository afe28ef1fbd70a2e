# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Measured signals of one joint, and the motion of joints recorded together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from friction_comp.errors import InputError
from friction_comp.statistics import gap_length, median, smallest_step

_SIGNALS = (
    'time', 'position', 'current', 'velocity', 'acceleration', 'load', 'temperature', 'command',
    'direction', 'reference_position', 'reference_velocity', 'rigid_body', 'coupling',
)
LIMITS = {
    'position': (1e5, 'rad'), 'velocity': (1e4, 'rad/s'), 'acceleration': (1e7, 'rad/s²'),
    'current': (1e5, 'A'),
    'command': (1e5, 'A'), 'load': (1e7, 'N·m'), 'temperature': (250.0, '°C'),
    'reference_position': (1e5, 'rad'), 'reference_velocity': (1e4, 'rad/s'),
}
"""Largest magnitude and unit of each signal, far beyond any geared drive: one turn per second for
four hours is 1e5 rad, the fastest motors turn at 1e4 rad/s, the shaft of a wind turbine carries
1e7 N·m, and the windings of a motor end above 250 °C."""
LOWEST = {'temperature': -100.0}
"""Smallest value of signals for which it is not minus the largest: colder than any place on earth,
°C."""

HOLE = 0.1
"""Time for which a person's torque or the motion may be interpolated, s; a driver does not keep the
current of a command for longer (the plant's `command_timeout`)."""


def beyond(signal: str, values: np.ndarray) -> np.ndarray:
    """Return whether each value of a signal is impossible by `LIMITS`, `LOWEST`; False for NaN."""
    limit = LIMITS[signal][0]
    with np.errstate(invalid='ignore'):
        return np.asarray((values > limit) | (values < LOWEST.get(signal, -limit)))


@dataclass(frozen=True)
class JointStates:
    """Motion of J joints that were recorded together, on the time base of one of them."""

    joints: tuple[str, ...]
    position: np.ndarray                    # (N, J), rad
    velocity: np.ndarray | None = None      # (N, J), rad/s

    def __post_init__(self) -> None:
        for name in ('position', 'velocity'):
            value = getattr(self, name)
            if value is not None and (np.ndim(value) != 2 or value.shape[1] != len(self.joints)):
                raise InputError(f'the {name} of {len(self.joints)} joints cannot have shape '
                                 f'{np.shape(value)}')

    def take(self, index: slice | np.ndarray) -> JointStates:
        """Return the samples that a slice, mask or index array selects."""
        return self._change(lambda values: values[index])

    def of(self, joints: Sequence[str]) -> JointStates:
        """Return the states of these joints in this order; raises InputError if one is missing."""
        for name in joints:
            if name not in self.joints:
                raise InputError(f'the motion of joint {name!r} is needed, but only that of '
                                 f'{", ".join(map(repr, self.joints))} was recorded')
        columns = [self.joints.index(name) for name in joints]
        return self._change(lambda values: values[:, columns], joints)

    def _change(self, change: Callable[[np.ndarray], np.ndarray],
                joints: Sequence[str] | None = None) -> JointStates:
        return JointStates(self.joints if joints is None else tuple(joints),
                           change(self.position),
                           None if self.velocity is None else change(self.velocity))

    @staticmethod
    def concatenate(parts: Sequence[JointStates]) -> JointStates:
        """Concatenate parts; drop joints and velocities that are not in all of them."""
        joints = [name for name in parts[0].joints if all(name in part.joints for part in parts)]
        parts = [part.of(joints) for part in parts]
        speeds = [part.velocity for part in parts if part.velocity is not None]
        return JointStates(
            tuple(joints), np.concatenate([part.position for part in parts]),
            np.concatenate(speeds) if len(speeds) == len(parts) else None)


@dataclass(frozen=True)
class Samples:
    """Measured signals of one joint on one time base, all of shape (N,).

    Parameters
    ----------
    time : ndarray
        Seconds, not decreasing. Gaps are allowed: see `segments`.
    position : ndarray
        Joint position in rad.
    current : ndarray
        Measured motor current in A, effort / (k_t · n).
    velocity, acceleration : ndarray, optional
        rad/s and rad/s².
    load : ndarray, optional
        Back-driving torque τ_b in N·m (torque sensor S2).
    temperature : ndarray, optional
        Motor temperature in degrees Celsius.
    command : ndarray, optional
        Commanded current in A; NaN while a compensator that was recorded sends none.
    direction : ndarray, optional
        Direction d of the desired movement: -1, 0 or +1.
    reference_position, reference_velocity : ndarray, optional
        The movement shown to the person, rad and rad/s.
    rigid_body : ndarray, optional
        Joint torque in N·m that carries and accelerates the links of the arm.
    coupling : ndarray, optional
        Current in A due to the motion of other joints, for an arm without a URDF.
    arm : JointStates, optional
        Motion of all joints that were recorded together, including this one.
    recording : ndarray of int, optional
        Number of the recording that each sample is from; zeros when omitted.
    joint : str
        Name of the joint.

    Raises
    ------
    InputError
        If shapes differ.
    """

    time: np.ndarray
    position: np.ndarray
    current: np.ndarray
    velocity: np.ndarray | None = None
    acceleration: np.ndarray | None = None
    load: np.ndarray | None = None
    temperature: np.ndarray | None = None
    command: np.ndarray | None = None
    direction: np.ndarray | None = None
    reference_position: np.ndarray | None = None
    reference_velocity: np.ndarray | None = None
    rigid_body: np.ndarray | None = None
    coupling: np.ndarray | None = None
    arm: JointStates | None = None
    recording: np.ndarray = None  # type: ignore[assignment] # set in __post_init__
    joint: str = ''

    def __post_init__(self) -> None:
        size = np.shape(self.time)
        if len(size) != 1:
            raise InputError(f'samples.time must have one axis, not shape {size}')
        if self.recording is None:
            object.__setattr__(self, 'recording', np.zeros(size, dtype=int))
        for name in (*_SIGNALS, 'recording'):
            value = getattr(self, name)
            if value is not None and np.shape(value) != size:
                raise InputError(f'samples.{name} has shape {np.shape(value)}, but time has {size}')
        if self.arm is not None and len(self.arm.position) != size[0]:
            raise InputError(f'samples.arm has {len(self.arm.position)} samples, but time has '
                             f'{size[0]}')

    def __len__(self) -> int:
        return len(self.time)

    def take(self, index: slice | np.ndarray) -> Samples:
        """Return the samples that a slice, mask or index array selects."""
        return self._change(lambda values: values[index], recording=self.recording[index])

    def averaged(self, length: int) -> Samples:
        """Return averages over `length` consecutive samples of a segment; what remains is dropped.

        Direction and recording are those of the first sample.
        """
        if length == 1 or not len(self):
            return self
        starts = np.concatenate([np.arange(part.start, part.stop - length + 1, length)
                                 for part in self.segments()])
        rows = starts[:, None] + np.arange(length)
        first = {'recording': self.recording[starts]}
        if self.direction is not None:
            first['direction'] = self.direction[starts]
        return self._change(lambda values: values[rows].mean(axis=1), **first)

    def _change(self, change: Callable[[np.ndarray], np.ndarray], **others: Any) -> Samples:
        """Return a copy with a function applied to all signals except those in `others`."""
        for name in _SIGNALS:
            value = getattr(self, name)
            if value is not None and name not in others:
                others[name] = change(value)
        if self.arm is not None:
            others['arm'] = self.arm._change(change)
        return replace(self, **others)

    def with_(self, **changes: Any) -> Samples:
        """Return a copy with some signals replaced."""
        return replace(self, **changes)

    @cached_property
    def sample_time(self) -> float:
        """Median time step within recordings in s."""
        steps = np.diff(self.time)[np.diff(self.recording) == 0]
        steps = steps[steps > 0]
        return median(steps) if steps.size else 0.0

    @cached_property
    def position_step(self) -> float:
        """Smallest change of position in rad, usually one encoder count; 0 without motion."""
        return smallest_step(self.position)

    @cached_property
    def _segments(self) -> list[slice]:
        step, other = np.diff(self.time), np.diff(self.recording) != 0
        broken = (step > gap_length(step[~other])) | (step < 0) | other
        edges = [0, *(np.flatnonzero(broken) + 1).tolist(), len(self)]
        return [slice(begin, end) for begin, end in pairwise(edges) if end > begin]

    def segments(self) -> list[slice]:
        """Return slices of samples without gaps, see `gap_length`.

        A slice also ends where time decreases, and with a recording.
        """
        return list(self._segments)

    @staticmethod
    def concatenate(parts: Iterable[Samples]) -> Samples:
        """Concatenate samples of one joint: signals in all parts, with recordings renumbered."""
        parts = list(parts)
        if not parts:
            raise InputError('no samples to concatenate')
        signals: dict[str, Any] = {}
        for name in _SIGNALS:
            values = [getattr(part, name) for part in parts]
            if all(value is not None for value in values):
                signals[name] = np.concatenate(values)
        arms = [part.arm for part in parts if part.arm is not None]
        if len(arms) == len(parts):
            signals['arm'] = JointStates.concatenate(arms)
        numbers: list[np.ndarray] = []
        offset = 0
        for part in parts:
            numbers.append(part.recording + offset)
            offset = int(numbers[-1].max(initial=offset - 1)) + 1
        return Samples(recording=np.concatenate(numbers), joint=parts[0].joint, **signals)


@dataclass
class RecordingInfo:
    """Information on one recording beyond its samples."""

    path: Path
    joint: str = ''  # the joint that was read
    start: float = 0.0  # stamp of the samples' time zero, s
    # (M,): times of all joint states in s since `start`, in the order received.
    stamps: np.ndarray | None = None
    rows: np.ndarray | None = None  # (N,): indices of the joint states used as samples
    notes: list[str] = field(default_factory=list)  # for readers of the results
    model: str | None = None  # active model file, if recorded
    # What the compensator reported (`recordings.Activity`), each with the time in s since `start`
    # from which it is valid.
    activity: list[tuple[float, Any]] = field(default_factory=list)
    effort_is_current: bool = False  # whether efforts were in A already, as a table may declare
    effort_unit: str = ''  # of efforts that are neither torques nor currents
    assumed: tuple[str, ...] = ()  # columns without a unit, with the one that is taken for it
    linear: bool = False  # whether positions are in m and efforts in N
