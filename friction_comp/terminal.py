# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What people read: output, progress, and numbers as text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import io
import math
from numbers import Integral
import os
import re
import sys
from typing import TypeVar

T = TypeVar('T')
PROGRESS = 'FRICTION_COMP_PROGRESS'
"""Environment variable of who wants lines of progress on standard error: share and step."""


@contextmanager
def tolerant_output() -> Iterator[None]:
    """Escape characters that the terminal lacks, and end the block when its reader is gone."""
    streams = [stream for stream in (sys.stdout, sys.stderr) if stream]
    for stream in streams:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors='backslashreplace')
    try:
        yield
        for stream in streams:
            stream.flush()
    except BrokenPipeError:
        # Redirect the file descriptors: Python's buffers are flushed again when the process ends.
        null = os.open(os.devnull, os.O_WRONLY)
        for stream in streams:
            os.dup2(null, stream.fileno())


@contextmanager
def progress(description: str) -> Iterator[Callable[..., None]]:
    """Show a progress bar on standard error while the block runs, if that is a terminal.

    Yields ``report(share, description=None)`` for the share 0..1 that is done, None if unchanged.
    For a program that has set `PROGRESS`, these become lines.
    """
    if PROGRESS in os.environ:
        yield lambda share, step='': print(share, step, file=sys.stderr, flush=True)
        return
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


def number(value: float | int | None, digits: int = 3) -> str:
    """Return a number with few significant digits (thousands in full); a dash for None or NaN."""
    if value is None or math.isnan(value):
        return '–'
    if isinstance(value, Integral):
        return str(value)
    if value == 0 or math.isinf(value):
        return f'{value:g}'
    magnitude = math.floor(math.log10(abs(value)))
    form = f'.{max(digits - 1 - magnitude, 0)}f' if -4 <= magnitude < 6 else f'.{digits - 1}e'
    return format(value, form).replace('-', '\u2212')


def interval_text(ends: Sequence[float | None]) -> str:
    """Return an interval as text."""
    low, high = ends
    if low is None or high is None:
        return 'not determined'
    return f'{number(low)} to {number(high)}'


def quantity(value: float, unit: str) -> str:
    """Return a number with its unit, small currents in mA, and a dash for NaN.

    Examples
    --------
    >>> quantity(0.0123, 'A')
    '12.3 mA'
    >>> quantity(0.0123, 'N·m')
    '0.0123 N·m'
    """
    if unit == 'A' and abs(value) < 0.1:
        value, unit = 1e3 * value, 'mA'
    return '–' if math.isnan(value) else f'{number(value)} {unit}'


def aligned(rows: Sequence[Sequence[str]], before: str = '') -> list[str]:
    """Return rows of text as lines whose columns begin below each other."""
    widths = [max(map(len, column)) for column in zip(*rows)]
    return [before + '  '.join(f'{text:<{width}}' for text, width in zip(row, widths)).rstrip()
            for row in rows]


def in_own_units(content: T, linear: bool) -> T:
    """Return text, or the texts of a report, with m and N instead of rad and N·m if `linear`."""
    if not linear:
        return content
    if isinstance(content, str):
        # Waves over a length are per metre, not per turn of 2π.
        text = re.sub(r'([\d.]+) times a turn', lambda match: (
            f'{float(match[1]) / (2.0 * math.pi):.4g} times a metre'), content)
        text = text.replace('kg·m²', 'kg').replace('N·m', 'N')
        return re.sub(r'\brad\b', 'm', text)  # type: ignore[return-value]
    if isinstance(content, dict):
        return {key: in_own_units(value, True)      # type: ignore[return-value]
                for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [in_own_units(value, True) for value in content]     # type: ignore[return-value]
    return content
