# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Which joints of which recordings: what is done with each of many is done with a piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from friction_comp.errors import InputError
from friction_comp.recordings import find_recordings, recorded_joints
from friction_comp.tables.columns import Layout


@dataclass(frozen=True)
class Piece:
    """One joint of one recording, or the whole recording where the joint is None."""

    path: Path
    joint: str | None
    layout: Layout | None = None

    def __str__(self) -> str:
        return str(self.path)


def pieces_of(paths: Sequence[str | Path], joint: str | None = None,
              layout: Layout | None = None) -> tuple[list[Piece], list[str]]:
    """Return the pieces that can be used, and the reasons why other recordings cannot.

    `paths` are recordings or folders of them, `layout` has the columns of tables.
    """
    pieces: list[Piece] = []
    failures: list[str] = []
    found = find_recordings([Path(path) for path in paths])
    for index, path in enumerate(found):
        own = layout and layout.of_recording(index, len(found))
        try:
            names = [joint] if joint is not None else recorded_joints(path, own) or ['']
        except InputError as error:
            failures.append(str(error))
        else:
            pieces.extend(Piece(path, name or None, own) for name in names)
    return pieces, failures
