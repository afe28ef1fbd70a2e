# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Converts serialised messages to rows of measurements of each joint."""

from __future__ import annotations

from collections import defaultdict, deque
import math

import numpy as np

from friction_comp.recordings.cdr import decode
from friction_comp.recordings.scan import values_of
from friction_comp.topics import TOPICS

# Period of the states that are used, and largest age of a load and of a temperature, ns.
_STEP, _LOAD_AGE, _TEMPERATURE_AGE = 8_000_000, 200_000_000, 60_000_000_000
# A busy machine reads all messages of one topic before those of the next: states wait this long
# for the load measured at the same time, ns; other messages are kept for ten seconds at 1 kHz.
_PATIENCE = 5_000_000_000
_MAX_KEPT = 10_000
STATES = 'joint_states'
# Topics, and how many values of each joint they hold.
_WIDTHS = {STATES: 3, 'interaction_wrench': 1, 'motor_temperature': 1}


class _Signal:
    """Values of a signal and their stamps in ns, in order."""

    def __init__(self, width: int) -> None:
        self.stamps, self.values = np.empty(0, dtype=np.int64), np.empty((0, width))

    def add(self, stamps: np.ndarray, values: np.ndarray) -> None:
        self.stamps = np.concatenate((self.stamps, stamps))
        self.values = np.concatenate((self.values, values))
        # Where time went back, another run began.
        back = np.flatnonzero(np.diff(self.stamps) < 0)
        self.keep_from(back[-1] + 1 if len(back) else 0)

    def keep_from(self, index: int) -> None:
        self.stamps, self.values = self.stamps[index:], self.values[index:]

    def at(self, stamps: np.ndarray, age: int) -> np.ndarray:
        """Return the last values at some stamps, NaN if more than `age` ns away."""
        if not len(self.stamps):
            return np.full(len(stamps), math.nan)
        index = np.maximum(np.searchsorted(self.stamps, stamps, 'right') - 1, 0)
        return np.where(np.abs(stamps - self.stamps[index]) <= age, self.values[index, 0], math.nan)


class LiveSignals:
    """Converts serialised messages to rows for `LiveResidual`, some hundred per second."""

    def __init__(self, joints: list[str], effort_per_current: list[float]) -> None:
        self._gains = dict(zip(joints, effort_per_current))
        self._due = self._last = 0
        self._new: defaultdict[str, deque[tuple[int, bytes]]] = defaultdict(
            lambda: deque(maxlen=_MAX_KEPT))
        self._signals = {(topic, joint): _Signal(width)
                         for topic, width in _WIDTHS.items() for joint in joints}

    def add_message(self, topic: str, stamp: int, cdr: bytes) -> None:
        """Keep a message about one joint (its frame_id) for the states of its time."""
        self._new[topic].append((stamp, cdr))

    def add_state(self, stamp: int, cdr: bytes) -> None:
        """Add a joint state, unless it is within a period of the last one."""
        went_back = stamp < self._last
        self._last = stamp
        if stamp >= self._due or went_back:
            self._due = stamp + _STEP
            self._new[STATES].append((stamp, cdr))

    def take(self) -> list[np.ndarray]:
        """Return the new rows of each joint: those whose load has come or is no longer awaited."""
        for topic, messages in self._new.items():
            stamps = np.array([stamp for stamp, _ in messages], dtype=np.int64)
            parts = defaultdict(list)
            # Messages that name the same joints are decoded together.
            for index, names, fields in decode(TOPICS[topic], [cdr for _, cdr in messages]):
                for joint, values in values_of(topic, names, fields)[1].items():
                    if joint in self._gains:
                        parts[joint].append((index, values))
            for joint, joint_parts in parts.items():
                index, values = map(np.concatenate, zip(*joint_parts))
                in_order = index.argsort()
                signal = self._signals[topic, joint]
                signal.add(stamps[index[in_order]], values[in_order])
                if topic != STATES:
                    signal.keep_from(-_MAX_KEPT)
            messages.clear()
        return [self._rows(joint) for joint in self._gains]

    def _rows(self, joint: str) -> np.ndarray:
        """Return and forget the rows (see `LiveResidual`) of the states whose load is known."""
        states, load, temperature = (self._signals[topic, joint] for topic in _WIDTHS)
        # A joint without a load sensor waits for none.
        until = max(load.stamps[-1], self._last - _PATIENCE) if len(load.stamps) else self._last
        count = int(np.searchsorted(states.stamps, until, 'right'))
        stamps = states.stamps[:count]
        rows = np.column_stack((
            1e-9 * stamps, states.values[:count, :2], states.values[:count, 2] / self._gains[joint],
            load.at(stamps, _LOAD_AGE),
            temperature.at(stamps, _TEMPERATURE_AGE)))
        states.keep_from(count)
        return rows
