# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""One refinement at the request of a client, on a recording or on messages that were kept."""

from collections.abc import Sequence
from pathlib import Path
import threading

from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.nodes.recent_past import Message
from friction_comp.recorded_drive.child import Refined, RefinementProcess
from friction_comp.recorded_drive.given import Given
from friction_comp.recordings.writer import RecordingWriter


def refusal(refined: Refined, old: FrictionModel) -> str:
    """Return why a refined model must not replace the old one; empty if it may."""
    report, model = refined.report, refined.model
    if report.verdict == 'record again':
        return 'the data do not support it: record again'
    if not report.after.held_out_rmse < report.before.held_out_rmse:
        return 'it is not better than the initial model'
    if model.drive != old.drive:
        return "it has another drive's torque constant, gear ratio or current limit"
    if old.breakaway is not None and model.breakaway != old.breakaway:
        return 'its breakaway currents differ from the measured ones'
    return ''


class RefineJob:
    """Refines a recording, or messages that are first written as one, in a separate process."""

    def __init__(self, joint: str, model_file: str, output: Path, recording: str,
                 messages: Sequence[Message]) -> None:
        self._given = Given(joint, Path(model_file))
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
