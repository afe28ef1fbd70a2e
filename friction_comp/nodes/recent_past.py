# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Keeps the last minutes of some topics in memory as serialised messages."""

from collections import deque
from typing import NamedTuple

from friction_comp.stamps import NANO

# Two successive stamps this much older than the newest of their topic (queues are read at different
# times), ns, mean that time went back; a single one is an outlier.
_BACK = NANO


class Message(NamedTuple):
    """One message."""

    stamp: int    # ns
    topic: str
    type_name: str
    cdr: bytes


class RecentPast:
    """Keeps messages for `seconds` of their own time, at most `size` bytes of them."""

    def __init__(self, seconds: float, size: int):
        self._seconds, self._max_size = seconds, size
        self.size, self._newest = 0, 0
        self._forget()

    def add(self, message: Message) -> None:
        """Add a message, and remove the oldest ones beyond the limits."""
        outlier = self._outliers.pop(message.topic, None)
        newest = self._newest_of.get(message.topic)
        if newest is not None and not self._is_plausible_after(message.stamp, newest):
            if outlier is None or not self._is_plausible_after(message.stamp, outlier.stamp):
                self._outliers[message.topic] = message
                return
            self._forget()
            self.add(outlier)
        self._newest_of[message.topic] = max(self._newest_of.get(message.topic, 0), message.stamp)
        self._newest = max(self._newest, message.stamp)
        self._messages.append(message)
        self.size += len(message.cdr)
        oldest = self._newest - self._seconds * NANO
        while self._messages and (
                self.size > self._max_size or self._messages[0].stamp < oldest):
            self.size -= len(self._messages.popleft().cdr)

    def _is_plausible_after(self, stamp: int, before: int) -> bool:
        return -_BACK <= stamp - before <= self._seconds * NANO

    def _forget(self) -> None:
        self._outliers: dict[str, Message] = {}
        self._messages: deque[Message] = deque()
        self._newest_of: dict[str, int] = {}
        self.size = self._newest = 0

    @property
    def span(self) -> float:
        """Duration of the messages, s."""
        return (self._newest - self._messages[0].stamp) / NANO if self._messages else 0.0

    def last(self, seconds: float = 0.0) -> list[Message]:
        """Return the messages of the last `seconds`; all of them for zero or less."""
        since = self._newest - seconds * NANO
        return [message for message in self._messages if seconds <= 0.0 or message.stamp >= since]
