# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is kept of the last minutes, and a refinement on it or on a recording."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path
import threading
from typing import NamedTuple

from friction_comp.errors import InputError
from friction_comp.layout import Layout
from friction_comp.model.friction_model import FrictionModel
from friction_comp.recorded_drive.child import Refined, RefinementProcess
from friction_comp.recorded_drive.given import Given
from friction_comp.recordings.writer import RecordingWriter
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


def refusal(refined: Refined, old: FrictionModel) -> str:
    """Return why a refined model must not replace the old one; empty if it may."""
    report, model = refined.report, refined.model
    if report.verdict == 'record again':
        return 'the data do not support it: record again'
    if not report.after.held_out_rmse < report.before.held_out_rmse:
        return 'it is not better than the initial model'
    if model.drive != old.drive:
        return "it has another drive's torque constant, gear ratio or current limit"
    return ''


class RefineJob:
    """Refines a recording, or messages that are first written as one, in a separate process."""

    def __init__(self, joint: str, model_file: str, output: Path, recording: str,
                 messages: Sequence[Message], in_ampere: bool = False) -> None:
        self._given = Given(joint, Path(model_file), layout=Layout(
            units={'effort': 'A'} if in_ampere else {}))
        self._recording, self._output = Path(recording or output / 'recording'), output
        self._error: InputError | None = None
        self._process: RefinementProcess | None = None
        self.cancelled = ''    # why the job was cancelled, if it was
        # Writing minutes of messages takes seconds.
        self._thread = threading.Thread(target=self._write, args=(messages,), daemon=True)
        self._thread.start()

    def _write(self, messages: Sequence[Message]) -> None:
        try:
            if messages:
                self._output.mkdir(parents=True, exist_ok=True)
                with RecordingWriter(self._recording, {
                        'recorded_by': 'friction_comp refinement'}) as writer:
                    for message in sorted(messages, key=lambda one: one.stamp):
                        writer.write(message.topic, message.type_name, message.stamp, message.cdr)
        except (InputError, OSError) as error:
            self._error = InputError(str(error))

    @property
    def progress(self) -> tuple[float, str]:
        """The share 0..1 that is done, and the present step."""
        if self._process is None:
            return 0.0, 'writing the recording'
        return self._process.share, self._process.step

    def poll(self) -> bool:
        """Update the progress, and return whether the job is done."""
        if self.cancelled:
            return True
        if self._process is None:
            if self._thread.is_alive():
                return False
            if self._error is not None:
                return True
            self._process = RefinementProcess(self._given, self._recording, self._output)
        return self._process.poll()

    def cancel(self, why: str) -> None:
        """Stop the job."""
        self.cancelled = why
        if self._process is not None:
            self._process.cancel()

    def result(self) -> Refined:
        """Return the result of a job that is done; raise InputError if the refinement failed."""
        if self.cancelled:
            raise InputError(self.cancelled)
        if self._process is None:
            raise self._error or InputError('nothing was refined')
        return self._process.result()
