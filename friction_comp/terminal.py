# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Standard output and error streams whose failure never stops a tool.

The results of a tool are in files; what it prints is additional. A closed pipe (``| head``) or a
terminal without some characters only loses text.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
import sys
from typing import Any


class _Patient:
    """A text stream that tolerates a reader that has gone."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        try:
            return int(self._stream.write(text))
        except BrokenPipeError:
            self._let_go()
            return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except BrokenPipeError:
            self._let_go()

    def _let_go(self) -> None:
        # Below Python's buffers, which are flushed again when the process ends.
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._stream.fileno())
        os.close(nowhere)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def patient_output() -> Iterator[None]:
    """Let nothing that is printed within end the work; letters that cannot be shown are escaped."""
    before = sys.stdout, sys.stderr
    for stream in before:
        if hasattr(stream, 'reconfigure'):
            stream.reconfigure(errors='backslashreplace')
    sys.stdout, sys.stderr = (stream and _Patient(stream) for stream in before)
    try:
        yield
    finally:
        for stream in filter(None, (sys.stdout, sys.stderr)):
            stream.flush()
        sys.stdout, sys.stderr = before
