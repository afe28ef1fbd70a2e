# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Counts lost messages of a topic from the sequence numbers of its publishers."""

from __future__ import annotations

from dataclasses import dataclass

# Checks during which a publisher must have been silent after a jump of the sequence numbers: the
# first message of another publisher may arrive before it is discovered.
_SILENT_CHECKS = 2
_MAX_STREAMS = 100


@dataclass
class _Stream:
    """Messages with consecutive sequence numbers."""

    start: int
    age: int = 0
    silent: int = 0


class Losses:
    """Distinguishes lost messages from another publisher's.

    Each publisher numbers its messages, but a message does not name its publisher. Consecutive
    numbers belong to one publisher. If a sequence ends and another one starts at a higher number
    while no publisher came or went, the messages between them are lost. If the first sequence
    continues later, the second belonged to a new publisher, and nothing was lost.

    Attributes
    ----------
    count : int
        Messages lost so far.
    """

    def __init__(self) -> None:
        self.count = 0
        self._streams: dict[int, _Stream] = {}
        # Losses counted at interrupted streams, by the first missing number.
        self._interrupted: dict[int, int] = {}

    def add(self, sequence: int) -> None:
        """Add the sequence number of a message."""
        stream = self._streams.pop(sequence, None)
        if stream is None:
            lost = self._interrupted.pop(sequence, 0)
            self.count -= lost
            stream = _Stream(0 if lost else sequence)
        stream.silent = 0
        self._streams[sequence + 1] = stream

    def check(self, changed: bool) -> None:
        """Update the losses; to be called a few times per second.

        Parameters
        ----------
        changed : bool
            Whether publishers came or went since the last call.
        """
        for stream in self._streams.values():
            stream.age += 1
            stream.silent += 1
        if changed:
            # This may explain interrupted and new streams.
            for stream in self._streams.values():
                stream.start = 0
        new = [stream for stream in self._streams.values()
                if stream.start and stream.age == _SILENT_CHECKS]
        for stream in sorted(new, key=lambda one: one.start):
            before = [sequence for sequence, other in self._streams.items() if other is not stream
                      and other.silent >= _SILENT_CHECKS and sequence < stream.start]
            if before:
                self.count += stream.start - max(before)
                self._interrupted[max(before)] = stream.start - max(before)
                del self._streams[max(before)]
        for known in (self._streams, self._interrupted):
            while len(known) > _MAX_STREAMS:
                del known[next(iter(known))]
