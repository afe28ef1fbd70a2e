# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What tools show: streams that never stop a tool, whose results are in files, and progress.

If a pipe is closed (``| head``) or a terminal lacks some characters, only printed text is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
import sys
from typing import Any


class _TolerantStream:
    """A text stream that discards its output once its reader has closed the pipe."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        try:
            return int(self._stream.write(text))
        except BrokenPipeError:
            self._discard_output()
        except BlockingIOError:
            # That of a node, which does not wait for its reader.
            pass
        return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except BrokenPipeError:
            self._discard_output()
        except BlockingIOError:
            pass

    def _discard_output(self) -> None:
        # Redirect the file descriptor: Python's buffers are flushed again when the process ends.
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, self._stream.fileno())
        os.close(null)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def tolerant_output() -> Iterator[None]:
    """Tolerate closed pipes in the block, and escape characters that the terminal lacks."""
    before = sys.stdout, sys.stderr
    for stream in before:
        if hasattr(stream, 'reconfigure'):
            stream.reconfigure(errors='backslashreplace')
    sys.stdout, sys.stderr = (stream and _TolerantStream(stream) for stream in before)
    try:
        yield
    finally:
        for stream in filter(None, (sys.stdout, sys.stderr)):
            stream.flush()
        sys.stdout, sys.stderr = before


@contextmanager
def progress(description: str) -> Iterator[Callable[..., None]]:
    """Show a progress bar on standard error while the block runs, if that is a terminal.

    Yields ``report(share, description=None)`` for the share 0..1 that is done, None if unchanged.
    """
    if not sys.stderr or not sys.stderr.isatty():
        yield lambda *_, **__: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn('{task.description}'), BarColumn(), TextColumn(
        '{task.percentage:>3.0f} %'), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(description, total=1.0)

        def report(share: float | None, description: str | None = None) -> None:
            completed = None if share is None else min(max(float(share), 0.0), 1.0)
            bar.update(task, completed=completed, description=description)

        yield report
