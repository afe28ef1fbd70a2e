# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Keeps the last minutes of some topics in memory as serialised messages."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from friction_comp.errors import InputError
from friction_comp.recordings.writer import RecordingWriter

NANO = 1_000_000_000
# Two stamps in a row this much older than the newest of their topic, ns, mean that time started
# over; one alone is wrong. Between topics such a difference says only that one was taken from its
# queue before the other.
_BACK = NANO


class Message(NamedTuple):
    """One message: its date in ns, topic, type and serialised content."""

    stamp: int
    topic: str
    type_name: str
    cdr: bytes


class RecentPast:
    """Keeps messages for a time, within a limit of memory.

    Parameters
    ----------
    seconds : float
        How long a message is kept, by the messages' own time.
    size : int
        Bytes of content kept at most; the oldest go first.
    """

    def __init__(self, seconds: float, size: int):
        self._seconds, self._most = seconds, size
        self._messages: deque[Message] = deque()
        self.size = 0
        self._newest = 0
        self._newest_of: dict[str, int] = {}
        self._odd: dict[str, Message] = {}

    def add(self, message: Message) -> None:
        """Keep a message, and let go of those that are too old or too many."""
        odd = self._odd.pop(message.topic, None)
        newest = self._newest_of.get(message.topic)
        if newest is not None and not self._follows(message.stamp, newest):
            if odd is None or not self._follows(message.stamp, odd.stamp):
                self._odd[message.topic] = message
                return
            self.forget()
            self.add(odd)
        self._newest_of[message.topic] = max(
            self._newest_of.get(message.topic, 0), message.stamp)
        self._newest = max(self._newest, message.stamp)
        self._messages.append(message)
        self.size += len(message.cdr)
        oldest = self._newest - self._seconds * NANO
        while self._messages and (
                self.size > self._most or self._messages[0].stamp < oldest):
            self.size -= len(self._messages.popleft().cdr)

    def _follows(self, stamp: int, before: int) -> bool:
        return -_BACK <= stamp - before <= self._seconds * NANO

    def forget(self) -> None:
        """Keep nothing."""
        self._odd.clear()
        self._messages.clear()
        self._newest_of.clear()
        self.size = self._newest = 0

    @property
    def span(self) -> float:
        """How many s are kept."""
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
        If there are none, or the folder cannot be written.
    """
    if not messages:
        raise InputError('nothing is kept of the recent past')
    with RecordingWriter(path, {'recorded_by': 'friction_comp refinement'}) as writer:
        for message in sorted(messages, key=lambda one: one.stamp):
            writer.write(message.topic, message.type_name, message.stamp, message.cdr)
