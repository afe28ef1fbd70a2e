# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a stretch of measured data is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from friction_comp.errors import InputError

_OPTIONAL = (
    'velocity', 'acceleration', 'load', 'temperature', 'command', 'direction',
    'reference_position', 'reference_velocity', 'rigid_body', 'coupling',
)


@dataclass(frozen=True)
class JointStates:
    """Motion of all joints that were recorded together, on the time base of one of them.

    Parameters
    ----------
    joints : tuple of str, length J
    position : ndarray, shape (N, J)
        rad.
    velocity : ndarray, shape (N, J), optional
        rad/s.
    """

    joints: tuple[str, ...]
    position: np.ndarray
    velocity: np.ndarray | None = None

    def __post_init__(self) -> None:
        for name in ('position', 'velocity'):
            value = getattr(self, name)
            if value is not None and (np.ndim(value) != 2 or value.shape[1] != len(self.joints)):
                raise InputError(f'the {name} of {len(self.joints)} joints cannot have shape '
                                 f'{np.shape(value)}')

    def take(self, index: slice | np.ndarray) -> JointStates:
        """Return what a slice, mask or index array selects of the samples."""
        return JointStates(self.joints, self.position[index],
                           None if self.velocity is None else self.velocity[index])

    def of(self, joints: Sequence[str]) -> JointStates:
        """Return the states of some joints, in their order.

        Raises
        ------
        InputError
            If one was not recorded.
        """
        for name in joints:
            if name not in self.joints:
                raise InputError(f'the motion of joint {name!r} is needed, but only that of '
                                 f'{", ".join(map(repr, self.joints))} is recorded')
        columns = [self.joints.index(name) for name in joints]
        return JointStates(tuple(joints), self.position[:, columns],
                           None if self.velocity is None else self.velocity[:, columns])

    @staticmethod
    def concatenate(parts: Sequence[JointStates]) -> JointStates:
        """Join stretches; joints that not all of them have are dropped, and so is velocity."""
        joints = [name for name in parts[0].joints if all(name in part.joints for part in parts)]
        parts = [part.of(joints) for part in parts]
        known = all(part.velocity is not None for part in parts)
        return JointStates(
            tuple(joints), np.concatenate([part.position for part in parts]),
            np.concatenate([part.velocity for part in parts]) if known else None)


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
        Commanded current in A.
    direction : ndarray, optional
        Direction d of the desired movement: -1, 0 or +1.
    reference_position, reference_velocity : ndarray, optional
        The movement shown to the person, rad and rad/s.
    rigid_body : ndarray, optional
        Torque in N·m that the rigid bodies of the whole arm ask of the joint.
    coupling : ndarray, optional
        Current in A that other joints ask of the joint's motor, where no URDF says why.
    arm : JointStates, optional
        Motion of all joints that were recorded beside this one.
    recording : ndarray of int, optional
        Number of the recording each sample is from; zeros when omitted.
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
    recording: np.ndarray = None  # type: ignore[assignment] # zeros once it is made
    joint: str = ''

    def __post_init__(self) -> None:
        size = np.shape(self.time)
        if len(size) != 1:
            raise InputError(f'samples.time must have one axis, not shape {size}')
        if self.recording is None:
            object.__setattr__(self, 'recording', np.zeros(size, dtype=int))
        for name in ('position', 'current', 'recording') + _OPTIONAL:
            value = getattr(self, name)
            if value is not None and np.shape(value) != size:
                raise InputError(
                    f'samples.{name} has shape {np.shape(value)}, but time has {size}')
        if self.arm is not None and len(self.arm.position) != size[0]:
            raise InputError(f'samples.arm holds {len(self.arm.position)} samples, but time has '
                             f'{size[0]}')

    def __len__(self) -> int:
        return len(self.time)

    def take(self, index: slice | np.ndarray) -> Samples:
        """Return the samples that a slice, mask or index array selects."""
        changes = {}
        for name in ('time', 'position', 'current', 'recording') + _OPTIONAL:
            value = getattr(self, name)
            if value is not None:
                changes[name] = value[index]
        if self.arm is not None:
            changes['arm'] = self.arm.take(index)
        return replace(self, **changes)

    def with_(self, **changes: Any) -> Samples:
        """Return a copy with some signals replaced."""
        return replace(self, **changes)

    @cached_property
    def sample_time(self) -> float:
        """Median time step within recordings in s."""
        steps = np.diff(self.time)[np.diff(self.recording) == 0]
        steps = steps[steps > 0]
        return float(np.median(steps)) if steps.size else 0.0

    @cached_property
    def position_step(self) -> float:
        """Smallest step in rad that the position makes, 0 where it never moves: the encoder's."""
        return smallest_step(self.position)

    def segments(self, largest_gap: float = 5.0) -> list[slice]:
        """Return slices of unbroken data.

        Parameters
        ----------
        largest_gap : float
            A step longer than this many median steps, a step backwards, or the start of another
            recording begins a new segment.

        Returns
        -------
        list of slice
        """
        if largest_gap not in self._cuts:
            self._cuts[largest_gap] = self._cut(largest_gap)
        return list(self._cuts[largest_gap])

    @cached_property
    def _cuts(self) -> dict[float, list[slice]]:
        return {}

    def _cut(self, largest_gap: float) -> list[slice]:
        if len(self) == 0:
            return []
        step = np.diff(self.time)
        broken = (step > largest_gap * max(self.sample_time, 1e-9)) | (step < 0)
        broken |= np.diff(self.recording) != 0
        edges = np.concatenate(([0], np.nonzero(broken)[0] + 1, [len(self)]))
        return [slice(int(a), int(b)) for a, b in zip(edges[:-1], edges[1:])]

    @staticmethod
    def concatenate(parts: Iterable[Samples]) -> Samples:
        """Join stretches of one joint; each keeps or gets its own recording number.

        Signals that not every part has are dropped.
        """
        parts = list(parts)
        if not parts:
            raise InputError('no samples to join')
        signals: dict[str, Any] = {}
        for name in ('time', 'position', 'current') + _OPTIONAL:
            values = [getattr(part, name) for part in parts]
            if all(value is not None for value in values):
                signals[name] = np.concatenate(values)
        if all(part.arm is not None for part in parts):
            signals['arm'] = JointStates.concatenate(
                [part.arm for part in parts if part.arm is not None])
        numbers: list[np.ndarray] = []
        offset = 0
        for part in parts:
            numbers.append(part.recording + offset)
            offset = int(numbers[-1].max(initial=offset - 1)) + 1
        return Samples(recording=np.concatenate(numbers), joint=parts[0].joint, **signals)


def smallest_step(values: np.ndarray) -> float:
    """Return the smallest step between neighbouring values, shape (N,); 0 where there is none."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0.0]
    return float(np.min(steps)) if steps.size else 0.0
