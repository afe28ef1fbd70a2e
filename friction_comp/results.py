# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Results in a folder, written whole or not at all: report.json, report.html and other files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
import json
import os
from pathlib import Path
import shutil
import tempfile
from typing import Any, Protocol

from friction_comp.errors import InputError
from friction_comp.files import encodable, plain

# Version of the JSON that the tools write: increased when an entry is removed or changes its
# meaning.
REPORT_VERSION = 1


class Page(Protocol):
    """A page of a report, such as `reports.html.Report`."""

    def made_by(self, *lines: str) -> None:
        """Add lines to its footer."""

    def save(self, path: str | Path) -> None:
        """Write it."""


@contextmanager
def output_folder(path: Path) -> Iterator[Path]:
    """Yield a hidden folder for results, which are moved to `path` when the block succeeds.

    Files with the same names in `path` are replaced, others are kept.
    """
    if path.exists() and not path.is_dir():
        raise InputError(f'{path}: exists and is not a folder')
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    unfinished = None
    try:
        path.mkdir(parents=True, exist_ok=True)
        unfinished = Path(tempfile.mkdtemp(prefix='.unfinished.', dir=path))
        yield unfinished
        _move_content(unfinished, path)
        made = []
    except OSError as error:
        name = error.filename if error.filename and unfinished is None else path
        raise InputError(f'{name}: cannot be written: {error.strerror or error}') from None
    finally:
        if unfinished is not None:
            shutil.rmtree(unfinished, ignore_errors=True)
        # Without success, folders that were made are removed as well, the innermost first.
        for folder in made:
            with suppress(OSError):
                folder.rmdir()


def _move_content(unfinished: Path, path: Path) -> None:
    sources = sorted(unfinished.rglob('*'))
    for source in sources:
        target = path / source.relative_to(unfinished)
        kind = 'folder' if source.is_dir() else 'file'
        if target.exists() and not (target.is_dir() if kind == 'folder' else target.is_file()):
            raise InputError(f'{target}: exists and is no ordinary {kind}')
    for source in sources:
        target = path / source.relative_to(unfinished)
        if source.is_dir():
            target.mkdir(exist_ok=True)
        else:
            os.replace(source, target)


def write_report(folder: Path, content: dict[str, Any], page: Page, command: str) -> None:
    """Write report.json and report.html, whose footer names the command."""
    (folder / 'report.json').write_text(to_json(content), encoding='utf-8')
    page.made_by(command)
    page.save(folder / 'report.html')


def to_json(content: dict[str, Any]) -> str:
    """Return a report as JSON text, its schema version first: see msg_docs/reports.md.

    Numpy values become plain ones, NaN and infinity null.
    """
    values = {'version': REPORT_VERSION, **plain(content, not_finite=None)}
    return encodable(json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False)) + '\n'
