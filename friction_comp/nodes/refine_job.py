# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs one refinement in a process of its own, so that the node stays responsive."""

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

# Refinement is in no hurry; the control loop is.
_NICE = 10
_PATIENCE = 2.0


@dataclass(frozen=True)
class JobResult:
    """What a refinement left behind.

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
        """Error of the model at the start on data that were not fitted, A."""
        return float(self.report['before']['held_out_rmse'])

    @property
    def after(self) -> float:
        """The same of the refined model."""
        return float(self.report['after']['held_out_rmse'])

    @property
    def verdict(self) -> str:
        """How far to believe it, in the words of report.json."""
        return str(self.report.get('verdict', ''))

    @property
    def reasons(self) -> str:
        """The verdict and why, in a line."""
        why = '; '.join(str(line).rstrip('.') for line in self.report.get('reasons') or ())
        return f'{self.verdict}: {why}' if why else self.verdict

    def refusal(self, old: FrictionModel) -> str:
        """Return why the model must not be loaded in place of an old one; empty if it may."""
        if self.verdict == 'record again':
            return 'the data do not carry it: record again'
        if not self.after < self.before:
            return 'it is not better than the model at the start'
        if self.model.drive != old.drive:
            return "it has another drive's torque constant, gear ratio or current limit"
        if old.breakaway is not None and self.model.breakaway != old.breakaway:
            return 'its breakaway currents are not those that were measured'
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
        What to refine from.
    messages : sequence of Message, optional
        The same from memory; the recording is written to `output` first.

    Attributes
    ----------
    share : float
        How much is done, 0 to 1.
    step : str
        What is being done.
    """

    def __init__(self, joint: str, model_file: str | Path, output: str | Path,
                 recording: str | Path = '', messages: Sequence[Message] = ()):
        self.share, self.step = 0.0, 'writing what is kept' if not recording else 'reading'
        self._joint, self._model_file, self._output = joint, model_file, Path(output)
        self._recording, self._messages = recording, messages
        self._error: InputError | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._log = tempfile.TemporaryFile('w+')
        self._cancelled = False
        self._thread: threading.Thread | None = None
        if recording:
            self._begin()
        else:
            # Minutes at a kilohertz take seconds to write.
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

    def _begin(self) -> None:
        self.share, self.step = 0.05, 'reading'
        # The environment's own Python may have been restarted for ROS: that holds for it too.
        self._process = subprocess.Popen(
            [sys.executable, '-m', 'friction_comp', 'refine', str(self._recording),
             '--model', str(self._model_file), '--joint', self._joint,
             '--output', str(self._output)],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=self._log,
            env={**os.environ, 'FRICTION_COMP_PROGRESS': 'lines'})
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, self._process.pid, _NICE)

    def poll(self) -> bool:
        """Look how far it is, and return whether it is over."""
        if self._thread is not None:
            if self._thread.is_alive():
                return False
            self._thread = None
            if self._error is None and not self._cancelled:
                self._begin()
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
        """End it, whatever it does."""
        self._cancelled = True
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()

    def result(self) -> JobResult:
        """Return what came of it.

        Raises
        ------
        InputError
            If nothing did; the text says why.
        """
        if self._cancelled:
            raise InputError('cancelled on request')
        if self._error is not None:
            raise self._error
        if self._process is None or self._process.returncode is None:
            raise InputError('the refinement is not over')
        if self._process.returncode != 0:
            said = [line for line in self._lines() if not line.startswith('progress ')]
            raise InputError(said[-1] if said else
                             f'refine ended with status {self._process.returncode}')
        model_file = (self._output / 'model.yaml').absolute()
        report = json.loads((self._output / 'report.json').read_text(encoding='utf-8'))
        return JobResult(report, FrictionModel.load(model_file), model_file,
                         (self._output / 'report.html').absolute())
