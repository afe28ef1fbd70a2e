# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs one refinement in a separate process, so that the node stays responsive."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
import json
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import threading
from typing import Any

from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.nodes.recent_past import Message
from friction_comp.recordings.writer import RecordingWriter

# The control loop has priority over refinement.
_NICE = 10
_KILL_TIMEOUT = 2.0


@dataclass(frozen=True)
class JobResult:
    """Result of a refinement: the content of report.json, the model, and the files of both."""

    report: dict[str, Any]
    model: FrictionModel
    model_file: Path
    page: Path

    def refusal(self, old: FrictionModel) -> str:
        """Return why the model must not replace the old one; empty if it may."""
        if self.report['verdict'] == 'record again':
            return 'the data do not support it: record again'
        if not self.report['after']['held_out_rmse'] < self.report['before']['held_out_rmse']:
            return 'it is not better than the initial model'
        if self.model.drive != old.drive:
            return "it has another drive's torque constant, gear ratio or current limit"
        if old.breakaway is not None and self.model.breakaway != old.breakaway:
            return 'its breakaway currents differ from the measured ones'
        return ''


class RefineJob:
    """Runs the tool `refine` on a recording, or on messages that are first written as one.

    The attributes `share` (0 to 1) and `step` are its progress.
    """

    def __init__(self, joint: str, model_file: str, output: Path, recording: str,
                 messages: Sequence[Message]) -> None:
        self.share, self.step = 0.0, 'writing the recording'
        self._output = output
        # With the same Python and environment, which may have been set up for ROS.
        self._command = [
            sys.executable, '-m', 'friction_comp', 'refine',
            recording or str(output / 'recording'), '--model', model_file, '--joint', joint,
            '--output', str(output)]
        self._error: InputError | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._log = tempfile.TemporaryFile()
        # Why the job was cancelled, if it was.
        self.cancelled = ''
        # Writing minutes of messages takes seconds.
        self._thread = threading.Thread(target=self._write, args=(messages,), daemon=True)
        self._thread.start()

    def _write(self, messages: Sequence[Message]) -> None:
        try:
            if messages:
                self._output.mkdir(parents=True, exist_ok=True)
                with RecordingWriter(self._output / 'recording', {
                        'recorded_by': 'friction_comp refinement'}) as writer:
                    for message in sorted(messages, key=lambda one: one.stamp):
                        writer.write(message.topic, message.type_name, message.stamp, message.cdr)
        except (InputError, OSError) as error:
            self._error = InputError(str(error))

    def poll(self) -> bool:
        """Update the progress, and return whether the job is done."""
        if self.cancelled:
            return True
        if self._process is None:
            if self._thread.is_alive():
                return False
            if self._error is not None:
                return True
            self.step = 'reading'
            self._process = subprocess.Popen(
                self._command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                stderr=self._log, env={**os.environ, 'FRICTION_COMP_PROGRESS': 'lines'})
            with suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, self._process.pid, _NICE)
        for line in reversed(self._lines()):
            word, _, rest = line.partition(' ')
            if word == 'progress':
                share, _, self.step = rest.partition(' ')
                self.share = max(self.share, min(1.0, float(share)))
                break
        return self._process.poll() is not None

    def _lines(self) -> list[str]:
        """Return the complete lines that the process has written so far."""
        # The process shares the file's position: reading must not change it.
        file = self._log.fileno()
        text = os.pread(file, os.fstat(file).st_size, 0).decode(errors='replace')
        return text.rpartition('\n')[0].splitlines()

    def cancel(self, why: str) -> None:
        """Stop the job."""
        self.cancelled = why
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(_KILL_TIMEOUT)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()

    def result(self) -> JobResult:
        """Return the result of a job that is done; raise InputError if the refinement failed."""
        if self.cancelled:
            raise InputError(self.cancelled)
        if self._error is not None:
            raise self._error
        if self._process is None or self._process.returncode != 0:
            messages = [line for line in self._lines() if not line.startswith('progress ')]
            raise InputError(messages[-1] if messages else 'refine ended without a result')
        model_file = (self._output / 'model.yaml').absolute()
        report = json.loads((self._output / 'report.json').read_text(encoding='utf-8'))
        return JobResult(report, FrictionModel.load(model_file), model_file,
                         (self._output / 'report.html').absolute())
