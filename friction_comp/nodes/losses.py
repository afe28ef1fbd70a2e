# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Counts lost messages of a topic from the sequence numbers of its publishers."""

from __future__ import annotations

from dataclasses import dataclass

# Looks for which a publisher must have been silent behind a jump of the numbers: another
# publisher's first message comes before it is known that there is one.
_SILENT = 2
_MOST_STREAMS = 100


@dataclass
class _Stream:
    """Messages whose numbers follow each other."""

    start: int
    age: int = 0
    silent: int = 0


class Losses:
    """Distinguishes lost messages from another publisher's.

    Each publisher numbers its messages, but who sent which is not said. Numbers that follow each
    other are one publisher's. Where one breaks off and another begins further on, while nobody
    came or went, what lies between is lost. If the first goes on after all, it was only slow, and
    the other a publisher that had not been heard before: then nothing was lost.

    Attributes
    ----------
    count : int
        Messages lost so far.
    """

    def __init__(self) -> None:
        self.count = 0
        self._streams: dict[int, _Stream] = {}
        # What was counted for streams that broke off, by the number that never came.
        self._broken_off: dict[int, int] = {}

    def see(self, sequence: int) -> None:
        """Take a message's number."""
        stream = self._streams.pop(sequence, None)
        if stream is None:
            lost = self._broken_off.pop(sequence, 0)
            self.count -= lost
            stream = _Stream(0 if lost else sequence)
        stream.silent = 0
        self._streams[sequence + 1] = stream

    def look(self, changed: bool) -> None:
        """Judge what has come; to be called a few times a second.

        Parameters
        ----------
        changed : bool
            Whether publishers came or went since the last look.
        """
        for stream in self._streams.values():
            stream.age += 1
            stream.silent += 1
        if changed:
            # Whatever broke off or began may have its reason in that.
            for stream in self._streams.values():
                stream.start = 0
        born = [stream for stream in self._streams.values()
                if stream.start and stream.age == _SILENT]
        for stream in sorted(born, key=lambda one: one.start):
            before = [sequence for sequence, other in self._streams.items() if other is not stream
                      and other.silent >= _SILENT and sequence < stream.start]
            if before:
                self.count += stream.start - max(before)
                self._broken_off[max(before)] = stream.start - max(before)
                del self._streams[max(before)]
        for known in (self._streams, self._broken_off):
            while len(known) > _MOST_STREAMS:
                del known[next(iter(known))]
