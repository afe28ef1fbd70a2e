# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Keeps the last minutes of some topics in memory as serialised messages."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from friction_comp.errors import InputError
from friction_comp.nodes.joint_states import NANO
from friction_comp.recordings.writer import RecordingWriter

# Two successive stamps this much older than the newest of their topic, ns, mean that time went
# back; a single one is an outlier. Topics are compared separately, since their queues may be read
# at different times.
_BACK = NANO


class Message(NamedTuple):
    """One message: its time in ns, topic, type and serialised content."""

    stamp: int
    topic: str
    type_name: str
    cdr: bytes


class RecentPast:
    """Keeps messages for a limited time and within a limited memory.

    Parameters
    ----------
    seconds : float
        How long a message is kept, in the time of the messages.
    size : int
        Largest size of the contents, bytes; the oldest messages are removed first.
    """

    def __init__(self, seconds: float, size: int):
        self._seconds, self._max_size = seconds, size
        self._messages: deque[Message] = deque()
        self.size = 0
        self._newest = 0
        self._newest_of: dict[str, int] = {}
        self._outliers: dict[str, Message] = {}

    def add(self, message: Message) -> None:
        """Add a message, and remove those beyond the limits."""
        outlier = self._outliers.pop(message.topic, None)
        newest = self._newest_of.get(message.topic)
        if newest is not None and not self._is_plausible_after(message.stamp, newest):
            if outlier is None or not self._is_plausible_after(message.stamp, outlier.stamp):
                self._outliers[message.topic] = message
                return
            self.forget()
            self.add(outlier)
        self._newest_of[message.topic] = max(
            self._newest_of.get(message.topic, 0), message.stamp)
        self._newest = max(self._newest, message.stamp)
        self._messages.append(message)
        self.size += len(message.cdr)
        oldest = self._newest - self._seconds * NANO
        while self._messages and (
                self.size > self._max_size or self._messages[0].stamp < oldest):
            self.size -= len(self._messages.popleft().cdr)

    def _is_plausible_after(self, stamp: int, before: int) -> bool:
        return -_BACK <= stamp - before <= self._seconds * NANO

    def forget(self) -> None:
        """Remove all messages."""
        self._outliers.clear()
        self._messages.clear()
        self._newest_of.clear()
        self.size = self._newest = 0

    @property
    def span(self) -> float:
        """Duration of the messages, s."""
        if not self._messages:
            return 0.0
        return (self._newest - self._messages[0].stamp) / NANO

    def last(self, seconds: float = 0.0) -> list[Message]:
        """Return the messages of the last s; all of them for zero or less."""
        if seconds <= 0.0:
            return list(self._messages)
        since = self._newest - seconds * NANO
        return [message for message in self._messages if message.stamp >= since]


def write_messages(path: Path, messages: Sequence[Message]) -> None:
    """Write messages as a recording.

    Raises
    ------
    InputError
        If there are no messages, or the folder cannot be written.
    """
    if not messages:
        raise InputError('no messages are kept')
    with RecordingWriter(path, {'recorded_by': 'friction_comp refinement'}) as writer:
        for message in sorted(messages, key=lambda one: one.stamp):
            writer.write(message.topic, message.type_name, message.stamp, message.cdr)
