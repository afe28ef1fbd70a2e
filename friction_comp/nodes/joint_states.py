# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Validates joint states: selects by name, merges publishers, and checks age and order."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

import numpy as np

NANO = 1_000_000_000

# What a joint state is, by its stamp: only the first says something about the joint now.
NEW = 'new'
PART = 'part'       # some joints only; the others of the same round are still to come
AGAIN = 'again'     # the stamp of the one before
LATE = 'late'       # overtaken by a newer one
STALE = 'stale'     # older than the timeout by the node's clock
AHEAD = 'ahead'     # stamped in the future by more than the timeout
MALFORMED = 'malformed'  # arrays of different lengths, or a joint named twice
CONTESTED = 'contested'  # several publishers publish the same joint

# Sets of names that are told apart; more than any robot has publishers.
_MOST_SOURCES = 100
# ns for which no joint state is used after two publishers sent the same joint.
_CONTESTED_FOR = NANO


def nanoseconds(stamp: Any) -> int:
    """Return a builtin_interfaces/Time in ns."""
    return stamp.sec * NANO + stamp.nanosec


def set_stamp(stamp: Any, value: int) -> None:
    """Set a builtin_interfaces/Time to a time in ns."""
    stamp.sec, stamp.nanosec = divmod(value, NANO)


class JointColumns:
    """Picks the node's joints out of joint states, whatever their order and company.

    Parameters
    ----------
    joints : list of str
    """

    def __init__(self, joints: Sequence[str]) -> None:
        self._joints = list(joints)
        self._names: list[str] | None = None
        self._columns: list[int] | None = None
        self._count = 0
        self.missing = list(self._joints)
        self.twice: list[str] = []

    def read(self, message: Any) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
        """Return position, velocity and effort, each (J,), NaN where there is no value.

        Velocity is None where the message has none. The attribute `missing` names the joints
        that the message lacks, `twice` those that it names more than once.
        """
        if message.name != self._names:
            self.find(list(message.name))
        return (self._pick(message.position),
                self._pick(message.velocity) if len(message.velocity) else None,
                self._pick(message.effort))

    def find(self, names: list[str]) -> None:
        """Find the indices of the joints in the names of a message."""
        index_of = {name: k for k, name in enumerate(names)}
        columns = [index_of.get(name, -1) for name in self._joints]
        # As they stand, the most frequent case, needs no picking.
        self._columns = None if columns == list(range(len(names))) else columns
        self.missing = [name for name in self._joints if name not in index_of]
        self.twice = [name for name in self._joints if names.count(name) > 1]
        self._names, self._count = names, len(names)

    def _pick(self, values: Any) -> Any:
        if len(values) != self._count:
            return np.full(len(self._joints), np.nan)
        if self._columns is None:
            return np.array(values, dtype=float)
        return np.array([values[k] if k >= 0 else np.nan for k in self._columns])


class JointStateInput:
    """The stream of joint states of a node: what is new in it, and what it says.

    A state is new when its stamp is later than that of the one before from the same joints, and
    within the timeout of the node's clock. One that is earlier by more than the timeout, yet
    fresh by the clock, begins a new time base (a simulation or a driver started again).

    States may hold some of the joints only, from several publishers: they are put together by
    name. A round is complete, and new, when all joints that were heard within the timeout have
    come; a joint that was not is missing, and its values are NaN.

    Parameters
    ----------
    joints : list of str
    timeout : int
        ns.

    Attributes
    ----------
    stamp : int
        Of the last new state, in ns; 0 before the first.
    position, effort : ndarray, shape (J,)
        rad, N·m; NaN where there is no value.
    velocity : ndarray or None
        rad/s. None where it is missing for a joint whose position is there: NaN in a velocity
        is how ros2_control says that there is none.
    missing : list of str
        Joints of which the last new state knows nothing.
    gap, restarted : bool
        Whether the last new state came after a gap longer than the timeout by its stamps, and
        whether it began a new time base.
    passed_over : int
        Number of states so far that were late.
    publishers : list of str
        Who publishes joint states, where there are several: to be set by the node now and then.
        Each numbers its messages: where the numbers of a joint do not rise, two of them send
        it, and nobody knows which is right.
    wrong : str
        What is wrong with the state that was judged last, where something is.
    """

    def __init__(self, joints: Sequence[str], timeout: int) -> None:
        self._joints, self._timeout = list(joints), timeout
        self._columns = JointColumns(joints)
        self.passed_over = 0
        self.publishers: list[str] = []
        self.forget()

    def forget(self) -> None:
        """Take the next state as new whatever its stamp."""
        size = len(self._joints)
        self.stamp, self.gap, self.restarted, self.age = 0, False, False, 0
        self.position = self.effort = np.full(size, np.nan)
        self.velocity: np.ndarray | None = None
        self.missing = list(self._joints)
        self._last: dict[tuple[str, ...], int] = {}
        self._named: list[str] | None = None
        self._key: tuple[str, ...] = ()
        self._whole = 0
        self._round = np.full((3, size), np.nan)
        self._received = [0] * size
        self._fresh = [False] * size
        self._numbers = [0] * size
        self._clash: int | None = None
        self._rivals = self.wrong = ''

    def take(self, message: Any, now: int, received: int = 0, sequence: int = 0) -> str:
        """Validate a joint state, and keep its values if it is new.

        Parameters
        ----------
        message : sensor_msgs.msg.JointState
        now : int
            The node's clock in ns.
        received : int
            When the middleware received it, ns of the same clock; stands in for a stamp of zero.
        sequence : int
            Its publisher's number of it; 0 where the middleware gives none.

        Returns
        -------
        str
            NEW, or why it is not.
        """
        self.wrong = ''
        stamp = nanoseconds(message.header.stamp)
        bears = stamp != 0
        stamp = stamp or received or now
        if message.name != self._named:
            self._named, self._key = list(message.name), tuple(message.name)
            self._columns.find(self._named)
        names = self._key
        if sequence and self._contested(sequence, now):
            return CONTESTED
        last = self._last.get(names, 0)
        if last and bears:
            if stamp == last:
                return AGAIN
            if 0 < last - stamp <= self._timeout:
                self.passed_over += 1
                return LATE
        self.age = now - stamp
        if abs(self.age) > self._timeout:
            self.wrong = self._of_another_time()
            return STALE if self.age > 0 else AHEAD
        if self._malformed(message, len(names)):
            return MALFORMED
        restarted = stamp < last
        if restarted or len(self._last) > _MOST_SOURCES:
            self._last.clear()
        self._last[names] = stamp
        position, velocity, effort = self._columns.read(message)
        if self._columns.missing:
            if len(self._columns.missing) == len(self._joints):
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
        self.velocity = _known(velocity, position)
        return NEW

    def _merge(self, stamp: int, position: np.ndarray, velocity: np.ndarray | None,
               effort: np.ndarray | None, restarted: bool) -> tuple[Any, ...] | None:
        """Add some joints to the round; return the round when it is complete, else None."""
        if restarted:
            self._received = [0] * len(self._joints)
        absent = set(self._columns.missing)
        if velocity is None:
            velocity = np.full(len(self._joints), np.nan)
        for j, joint in enumerate(self._joints):
            if joint in absent:
                continue
            self._round[:, j] = position[j], velocity[j], effort[j]
            self._received[j], self._fresh[j] = stamp, True
        lost = [not fresh and stamp - max(heard, self._whole) > self._timeout
                for fresh, heard in zip(self._fresh, self._received)]
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
        """Return whether two publishers send a joint of the message now."""
        known, clashing = self._numbers, []
        for j, joint in enumerate(self._joints):
            if joint not in self._columns.missing:
                if sequence <= known[j]:
                    clashing.append(joint)
                known[j] = sequence
        if clashing and len(self.publishers) > 1:
            self._clash = now
            self._rivals = (f'joint_states of {", ".join(clashing)} come from several publishers: '
                            + ', '.join(self.publishers))
        if self._clash is None or abs(now - self._clash) >= _CONTESTED_FOR:
            return False
        self.wrong = self._rivals
        return True

    def _of_another_time(self) -> str:
        if self.age < 0:
            return (f'joint_states are stamped {-self.age / NANO:.3g} s ahead'
                    ' (clocks differ, or /clock stands still?)')
        return (f'joint_states are {self.age / NANO:.3g} s old'
                ' (clocks differ, or use_sim_time is not set alike?)')


def are_finite(values: np.ndarray) -> bool:
    """Return whether all of a few values are finite; several times as fast as with numpy."""
    return all(map(math.isfinite, values.tolist()))


def within(values: np.ndarray, limit: float) -> bool:
    """Return whether all of a few values are numbers and not beyond a limit; as fast."""
    return all(-limit <= value <= limit for value in values.tolist())


def _known(velocity: np.ndarray, position: np.ndarray) -> Any:
    """Return the velocity where it is known for every joint with a position, else None."""
    if velocity is None:
        return None
    if are_finite(velocity):
        return velocity
    unknown = np.isnan(velocity)
    if not unknown.any():
        return velocity
    if (unknown & ~np.isnan(position)).any():
        return None
    return np.where(unknown, 0.0, velocity)
