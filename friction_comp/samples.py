# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a stretch of measured data is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from friction_comp.errors import InputError

_OPTIONAL = (
    'velocity', 'acceleration', 'load', 'temperature', 'command', 'direction',
    'reference_position', 'reference_velocity',
)


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
    recording: np.ndarray | None = None
    joint: str = ''

    def __post_init__(self):
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

    def __len__(self):
        return len(self.time)

    def take(self, index):
        """Return the samples that a slice, mask or index array selects."""
        changes = {}
        for name in ('time', 'position', 'current', 'recording') + _OPTIONAL:
            value = getattr(self, name)
            if value is not None:
                changes[name] = value[index]
        return replace(self, **changes)

    def with_(self, **changes):
        """Return a copy with some signals replaced."""
        return replace(self, **changes)

    @cached_property
    def sample_time(self):
        """Median time step within recordings in s."""
        steps = np.diff(self.time)[np.diff(self.recording) == 0]
        steps = steps[steps > 0]
        return float(np.median(steps)) if steps.size else 0.0

    def segments(self, largest_gap=5.0):
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
    def _cuts(self):
        return {}

    def _cut(self, largest_gap):
        if len(self) == 0:
            return []
        step = np.diff(self.time)
        broken = (step > largest_gap * max(self.sample_time, 1e-9)) | (step < 0)
        broken |= np.diff(self.recording) != 0
        edges = np.concatenate(([0], np.nonzero(broken)[0] + 1, [len(self)]))
        return [slice(int(a), int(b)) for a, b in zip(edges[:-1], edges[1:])]

    @staticmethod
    def concatenate(parts):
        """Join stretches of one joint; each keeps or gets its own recording number.

        Signals that not every part has are dropped.
        """
        parts = list(parts)
        if not parts:
            raise InputError('no samples to join')
        signals = {}
        for name in ('time', 'position', 'current') + _OPTIONAL:
            values = [getattr(part, name) for part in parts]
            if all(value is not None for value in values):
                signals[name] = np.concatenate(values)
        numbers, offset = [], 0
        for part in parts:
            numbers.append(part.recording + offset)
            offset = int(numbers[-1].max(initial=offset - 1)) + 1
        return Samples(recording=np.concatenate(numbers), joint=parts[0].joint, **signals)
