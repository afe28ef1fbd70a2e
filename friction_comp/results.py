# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Results as plain values, and the files of a report in a folder: report.json and report.html."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any, Protocol

from friction_comp.files import encodable


class Page(Protocol):
    """A page of a report, such as `reports.html.Report`."""

    def made_by(self, *lines: str) -> None:
        """Add lines to its footer."""

    def save(self, path: str | Path) -> None:
        """Write it."""


def write_report(folder: Path, content: dict[str, Any], page: Page, command: str) -> None:
    """Write report.json and report.html, whose footer names the command."""
    (folder / 'report.json').write_text(to_json(content), encoding='utf-8')
    page.made_by(command)
    page.save(folder / 'report.html')


def to_json(content: dict[str, Any]) -> str:
    """Return a report as JSON text, its schema version first: see docs/reports.md.

    Numpy values become plain ones, NaN and infinity null.
    """
    # The version increases when an entry is removed or changes its meaning.
    values = {'version': 1, **plain(content, not_finite=None)}
    return encodable(json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False)) + '\n'


def plain(value: Any, not_finite: float | None = math.nan) -> Any:
    """Convert nested values with numpy types, tuples and paths to types of YAML and JSON.

    JSON has no NaN and no infinity: they become None if `not_finite` is None.
    """
    if isinstance(value, dict):
        return {str(key): plain(item, not_finite) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item, not_finite) for item in value]
    if hasattr(value, 'tolist'):
        # A numpy array or scalar, recognised without importing numpy.
        return plain(value.tolist(), not_finite)
    if isinstance(value, os.PathLike):
        return str(value)
    if isinstance(value, float) and not_finite is None and not math.isfinite(value):
        return None
    return value
