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
from friction_comp.nodes.recent_past import Message, write_messages

# The control loop has priority over refinement.
_NICE = 10
_KILL_TIMEOUT = 2.0


@dataclass(frozen=True)
class JobResult:
    """Result of a refinement.

    Parameters
    ----------
    report : dict
        As in report.json.
    model : FrictionModel
    model_file, page : Path
    """

    report: dict[str, Any]
    model: FrictionModel
    model_file: Path
    page: Path

    @property
    def before(self) -> float:
        """Error of the initial model on held-out data, A."""
        return float(self.report['before']['held_out_rmse'])

    @property
    def after(self) -> float:
        """Error of the refined model on held-out data, A."""
        return float(self.report['after']['held_out_rmse'])

    @property
    def verdict(self) -> str:
        """Verdict in report.json."""
        return str(self.report.get('verdict', ''))

    @property
    def reasons(self) -> str:
        """The verdict and its reasons as one line."""
        why = '; '.join(str(line).rstrip('.') for line in self.report.get('reasons') or ())
        return f'{self.verdict}: {why}' if why else self.verdict

    def refusal(self, old: FrictionModel) -> str:
        """Return why the model must not replace the old one; empty if it may."""
        if self.verdict == 'record again':
            return 'the data do not support it: record again'
        if not self.after < self.before:
            return 'it is not better than the initial model'
        if self.model.drive != old.drive:
            return "it has another drive's torque constant, gear ratio or current limit"
        if old.breakaway is not None and self.model.breakaway != old.breakaway:
            return 'its breakaway currents differ from the measured ones'
        return ''


class RefineJob:
    """Runs the tool `refine`.

    Parameters
    ----------
    joint : str
    model_file : path-like
        Model to start from.
    output : path-like
        Folder for report and model.
    recording : path-like, optional
        Recording to refine from.
    messages : sequence of Message, optional
        Messages to refine from instead; they are first written as a recording to `output`.

    Attributes
    ----------
    share : float
        Progress, 0 to 1.
    step : str
        Present step.
    """

    def __init__(self, joint: str, model_file: str | Path, output: str | Path,
                 recording: str | Path = '', messages: Sequence[Message] = ()):
        self.share, self.step = 0.0, 'writing the recording' if not recording else 'reading'
        self._joint, self._model_file, self._output = joint, model_file, Path(output)
        self._recording, self._messages = recording, messages
        self._error: InputError | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._log = tempfile.TemporaryFile('w+')
        self._cancelled = False
        self._thread: threading.Thread | None = None
        if recording:
            self._start_process()
        else:
            # Writing minutes of messages takes seconds.
            self._thread = threading.Thread(target=self._write, daemon=True)
            self._thread.start()

    def _write(self) -> None:
        try:
            self._output.mkdir(parents=True, exist_ok=True)
            self._recording = self._output / 'recording'
            write_messages(self._recording, self._messages)
        except (InputError, OSError) as error:
            self._error = InputError(str(error))
        self._messages = ()

    def _start_process(self) -> None:
        self.share, self.step = 0.05, 'reading'
        # With the same Python and environment, which may have been set up for ROS.
        self._process = subprocess.Popen(
            [sys.executable, '-m', 'friction_comp', 'refine', str(self._recording),
             '--model', str(self._model_file), '--joint', self._joint,
             '--output', str(self._output)],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=self._log,
            env={**os.environ, 'FRICTION_COMP_PROGRESS': 'lines'})
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, self._process.pid, _NICE)

    def poll(self) -> bool:
        """Update the progress, and return whether the job is done."""
        if self._thread is not None:
            if self._thread.is_alive():
                return False
            self._thread = None
            if self._error is None and not self._cancelled:
                self._start_process()
        if self._process is None:
            return True
        for line in reversed(self._lines()):
            word, _, rest = line.partition(' ')
            if word == 'progress':
                share, _, self.step = rest.partition(' ')
                self.share = max(self.share, min(1.0, float(share)))
                break
        return self._process.poll() is not None

    def _lines(self) -> list[str]:
        self._log.seek(0)
        return self._log.read().splitlines()

    def cancel(self) -> None:
        """Stop the job."""
        self._cancelled = True
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(_KILL_TIMEOUT)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()

    def result(self) -> JobResult:
        """Return the result.

        Raises
        ------
        InputError
            If the refinement failed; the text says why.
        """
        if self._cancelled:
            raise InputError('cancelled on request')
        if self._error is not None:
            raise self._error
        if self._process is None or self._process.returncode is None:
            raise InputError('the refinement is not finished')
        if self._process.returncode != 0:
            messages = [line for line in self._lines() if not line.startswith('progress ')]
            raise InputError(messages[-1] if messages else
                             f'refine ended with status {self._process.returncode}')
        model_file = (self._output / 'model.yaml').absolute()
        report = json.loads((self._output / 'report.json').read_text(encoding='utf-8'))
        return JobResult(report, FrictionModel.load(model_file), model_file,
                         (self._output / 'report.html').absolute())
