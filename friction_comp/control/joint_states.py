# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Validates joint states: selects joints by name, merges publishers, checks age and order."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

import numpy as np

from friction_comp.messages import NANO

# Verdicts on a joint state; only a new one is used.
NEW = 'new'
PART = 'part'       # some joints only; the others of the same round have not arrived yet
AGAIN = 'again'     # the same stamp as the one before
LATE = 'late'       # older than the one before
STALE = 'stale'     # older than the timeout by the node's clock
AHEAD = 'ahead'     # stamped in the future by more than the timeout
MALFORMED = 'malformed'  # arrays of different lengths, or a joint named twice
CONTESTED = 'contested'  # several publishers publish the same joint

# ns for which no joint state is used after two publishers sent the same joint.
_CONTESTED_FOR = NANO


class JointColumns:
    """Selects the node's joints from joint states of any order and with other joints."""

    def __init__(self, joints: Sequence[str]) -> None:
        self._joints = list(joints)
        # Of the last message, as a list to compare with and as a key of dicts; then the node's
        # joints that it lacks, and those that it names more than once.
        self.names: list[str] = []
        self.key: tuple[str, ...] = ()
        self._columns: list[int] | None = [-1] * len(self._joints)
        self.missing = list(self._joints)
        self.twice: list[str] = []

    def read(self, message: Any) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
        """Return position, velocity (None without any) and effort, each (J,), NaN where missing."""
        self.find(message.name)
        return (self._select(message.position),
                self._select(message.velocity) if len(message.velocity) else None,
                self._select(message.effort))

    def find(self, names: Any) -> None:
        """Find the indices of the joints in the names of a message, if they are others."""
        if names == self.names:
            return
        self.names, self.key = list(names), tuple(names)
        columns = [names.index(name) if name in names else -1 for name in self._joints]
        # The same order, the most frequent case, needs no selection.
        self._columns = None if columns == list(range(len(names))) else columns
        self.missing = [name for name in self._joints if name not in names]
        self.twice = [name for name in self._joints if names.count(name) > 1]

    def _select(self, values: Any) -> Any:
        if len(values) != len(self.names):
            return np.full(len(self._joints), np.nan)
        if self._columns is None:
            return np.array(values, dtype=float)
        return np.array([values[k] if k >= 0 else np.nan for k in self._columns])


class JointStateInput:
    """Validates and merges the joint states that a node receives.

    A state is new if its stamp is later than that of the last state of the same joints, and within
    the timeout of the node's clock. A stamp that is earlier by more than the timeout, but within
    the timeout of the clock, begins a new time base (a restarted simulation or driver).

    States of some of the joints, from several publishers, are merged by name. A round is complete,
    and new, when all joints received within the timeout have arrived; other joints are missing.

    Times are in ns. The attributes hold the last new state: `stamp` (0 before the first),
    `position`, `velocity` and `effort`, shape (J,), NaN where there is no value, the `missing`
    joints, and whether it followed a `gap` longer than the timeout or began a new time base
    (`restarted`). `wrong` is the fault of the last state, if any; `overdue` whether states name
    none of these joints, for longer than the timeout if they have several publishers.
    """

    def __init__(self, joints: Sequence[str], timeout: int) -> None:
        self._joints, self._timeout = list(joints), timeout
        self._columns = JointColumns(joints)
        self.passed_over = 0    # number of late states so far
        # If there are several, as the node says. They number their messages: if the numbers of a
        # joint do not increase, two of them publish it, and its value is ambiguous.
        self.publishers: list[str] = []
        self.forget()

    def forget(self) -> None:
        """Accept the next state as new, whatever its stamp."""
        size = len(self._joints)
        self.stamp, self.gap, self.restarted = 0, False, False
        self.position = self.effort = np.full(size, np.nan)
        # None if it is missing for a joint whose position is known; ros2_control publishes NaN for
        # a velocity that is not measured.
        self.velocity: np.ndarray | None = None
        self.missing = list(self._joints)
        self._last: dict[tuple[str, ...], int] = {}
        # Stamp of the last state of all joints, or of the first one of several publishers.
        self._whole = 0
        self.overdue = False
        self._round = np.full((3, size), np.nan)
        self._received = [0] * size
        self._fresh = [False] * size
        self._numbers = [0] * size
        self._clash: int | None = None
        self._clash_text = self.wrong = ''

    def take(self, message: Any, now: int, received: int = 0, sequence: int = 0) -> str:
        """Validate a joint state, keep its values if it is new, and return the verdict.

        `now` is the node's clock in ns. `received`, when the middleware received the state by that
        clock, replaces a stamp of zero. `sequence` is the number that its publisher gave it, 0 if
        the middleware has none.
        """
        self.wrong = ''
        header = message.header.stamp
        stamp = header.sec * NANO + header.nanosec
        has_stamp, stamp = stamp != 0, stamp or received or now
        self._columns.find(message.name)
        names = self._columns.key
        if sequence and self._contested(sequence, now):
            return CONTESTED
        last = self._last.get(names, 0)
        if last and has_stamp:
            if stamp == last:
                return AGAIN
            if 0 < last - stamp <= self._timeout:
                self.passed_over += 1
                return LATE
        age = now - stamp
        if age > self._timeout:
            self.wrong = (f'joint_states are {age / NANO:.3g} s old (clocks differ, use_sim_time '
                          'is not set alike, or this machine is overloaded?)')
            return STALE
        if age < -self._timeout:
            self.wrong = (f'joint_states are stamped {-age / NANO:.3g} s ahead'
                          ' (clocks differ, or /clock stands still?)')
            return AHEAD
        if self._malformed(message, len(names)):
            return MALFORMED
        restarted = stamp < last
        if restarted:
            self._last.clear()
        self._last[names] = stamp
        return self._keep(message, stamp, restarted)

    def _keep(self, message: Any, stamp: int, restarted: bool) -> str:
        """Keep the values of a valid state; return NEW, or PART if others must arrive first."""
        position, velocity, effort = self._columns.read(message)
        if self._columns.missing:
            if restarted or not self._whole:
                # The others may follow within the timeout, if there are any.
                self._whole = stamp if len(self.publishers) > 1 else 0
            if len(self._columns.missing) == len(self._joints):
                self.overdue = not self.stamp and stamp - self._whole > self._timeout
                return PART
            merged = self._merge(stamp, position, velocity, effort, restarted)
            if merged is None:
                return PART
            stamp, position, velocity, effort = merged
        else:
            self._whole = stamp
            self.missing = []
        self.restarted = restarted
        self.gap = not restarted and bool(self.stamp) and stamp - self.stamp > self._timeout
        self.stamp, self.position, self.effort = stamp, position, effort
        self.velocity = _velocity_if_complete(velocity, position)
        return NEW

    def _merge(self, stamp: int, position: np.ndarray, velocity: np.ndarray | None,
               effort: np.ndarray, restarted: bool) -> tuple[Any, ...] | None:
        """Add joints to the round; return the round if it is complete, else None."""
        if restarted:
            self._received, self._fresh = [0] * len(self._joints), [False] * len(self._joints)
        absent = set(self._columns.missing)
        if velocity is None:
            velocity = np.full(len(self._joints), np.nan)
        for j, joint in enumerate(self._joints):
            if joint not in absent:
                self._round[:, j] = position[j], velocity[j], effort[j]
                self._received[j], self._fresh[j] = stamp, True
        lost = [not fresh and stamp - max(last_received, self._whole) > self._timeout
                for fresh, last_received in zip(self._fresh, self._received)]
        if not all(fresh or gone for fresh, gone in zip(self._fresh, lost)):
            return None
        self._round[:, lost] = np.nan
        self.missing = [joint for joint, gone in zip(self._joints, lost) if gone]
        stamp = max(self._received)
        self._fresh = [False] * len(self._joints)
        return stamp, *self._round.copy()

    def _malformed(self, message: Any, count: int) -> bool:
        if (len(message.position) != count or len(message.velocity) not in (0, count)
                or len(message.effort) not in (0, count)):
            self.wrong = 'joint_states hold arrays of different lengths'
        elif self._columns.twice:
            self.wrong = f'joint_states name {", ".join(self._columns.twice)} twice'
        return bool(self.wrong)

    def _contested(self, sequence: int, now: int) -> bool:
        """Return whether several publishers publish a joint of the message."""
        clashing = []
        for j, joint in enumerate(self._joints):
            if joint not in self._columns.missing:
                if sequence <= self._numbers[j]:
                    clashing.append(joint)
                self._numbers[j] = sequence
        if clashing and len(self.publishers) > 1:
            self._clash = now
            self._clash_text = (f'joint_states of {", ".join(clashing)} come from several '
                                f'publishers: {", ".join(self.publishers)}')
        if self._clash is None or abs(now - self._clash) >= _CONTESTED_FOR:
            return False
        self.wrong = self._clash_text
        return True


def within(values: np.ndarray, limit: float) -> bool:
    """Return whether all of a few values are within ±limit; faster than with numpy."""
    return all(-limit <= value <= limit for value in values.tolist())


def _velocity_if_complete(velocity: np.ndarray | None,
                          position: np.ndarray) -> np.ndarray | None:
    """Return the velocity if it is known for every joint with a position, else None."""
    # Several times faster than with numpy.
    if velocity is None or all(map(math.isfinite, velocity.tolist())):
        return velocity
    unknown = np.isnan(velocity)
    if (unknown & ~np.isnan(position)).any():
        return None
    return np.where(unknown, 0.0, velocity)
