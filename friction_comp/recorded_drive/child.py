# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Refines recordings in a process of its own, so that whoever asks for it stays responsive."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
import multiprocessing
from multiprocessing.connection import Connection
import os
from pathlib import Path
import shlex
import signal
import sys
import traceback
from typing import Any, NoReturn, TYPE_CHECKING

from friction_comp.errors import InputError, one_line
from friction_comp.recorded_drive.refine_recordings import Given

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.refinement import RefinementReport


@dataclass(frozen=True)
class Refined:
    """The result of a refinement, and the files that it wrote."""

    report: RefinementReport
    model: FrictionModel
    model_file: Path
    page: Path


class RefinementProcess:
    """Runs `refine_to_folder` on one recording.

    The attributes `share` (0 to 1) and `step` are its progress.
    """

    def __init__(self, given: Given, recording: Path, output: Path) -> None:
        self.share, self.step = 0.0, 'reading'
        self._outcome: Refined | InputError | None = None
        # Not forked: threads of this process may hold locks.
        context = multiprocessing.get_context('spawn')
        self._pipe, end = context.Pipe(duplex=False)
        self._process = context.Process(
            target=_refine, args=(end, given, recording, output), daemon=True)
        self._process.start()
        end.close()

    def poll(self) -> bool:
        """Update the progress, and return whether the process is done."""
        while self._outcome is None and self._pipe.poll():
            try:
                message = self._pipe.recv()
            except (EOFError, OSError):
                message = InputError('refinement ended without a result')
            if isinstance(message, tuple):
                share, self.step = message
                self.share = max(self.share, share)
            else:
                self._outcome = message
        return self._outcome is not None

    def cancel(self) -> None:
        """Stop the process, which leaves nothing half-written behind."""
        self._process.terminate()
        self._process.join(2.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def result(self) -> Refined:
        """Return the result of a process that is done; raise InputError if it failed."""
        if not isinstance(self._outcome, Refined):
            raise self._outcome or InputError('refinement is not done')
        return self._outcome


def _refine(pipe: Connection, given: Given, recording: Path, output: Path) -> None:
    """Refine in this process; send its progress (share, step), then what came of it."""
    # The keyboard interrupts all processes of a terminal; the parent decides what becomes of this.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    # The control loop has priority.
    with suppress(OSError):
        os.nice(10)
    command = ['refine', str(recording), '--model', str(given.model), '--joint',
               str(given.joint), '--output', str(output)]
    try:
        from friction_comp.recorded_drive.refine_recordings import refine_to_folder

        result = refine_to_folder(
            given, [recording], output, f'`friction_comp {shlex.join(command)}`',
            lambda share, step: pipe.send((float(share), step)))
        outcome: Any = Refined(result.report, result.model, (output / 'model.yaml').absolute(),
                               (output / 'report.html').absolute())
    except InputError as error:
        outcome = error
    except Exception as error:
        traceback.print_exc()
        outcome = InputError(f'{type(error).__name__}: {one_line(error)}')
    with suppress(OSError):     # whoever asked is gone
        pipe.send(outcome)


def _leave(*_: object) -> NoReturn:
    sys.exit(1)
