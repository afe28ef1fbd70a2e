# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Takes over what an earlier run of ``refine --each`` did, so that an interrupted one continues.

Refining the same recording with the same arguments gives the same result: only what differs in
either is done again.
"""

from __future__ import annotations

from argparse import Namespace
import hashlib
import json
from pathlib import Path
from typing import Any, TYPE_CHECKING

from friction_comp import __version__

if TYPE_CHECKING:
    from friction_comp.evaluation.sessions import Piece

# Written last into the folder of a recording.
DONE = 'resume.json'
# Arguments that do not change the result of a recording.
_NEUTRAL = ('recordings', 'joint', 'output', 'jobs', 'json', 'command', 'scheduler')


def fingerprint(arguments: Namespace, piece: Piece) -> str:
    """Return a text that changes with the recording's files, the model and the arguments."""
    files = sorted(piece.path.rglob('*')) if piece.path.is_dir() else [piece.path]
    states = [(str(file.relative_to(piece.path)), state.st_size, state.st_mtime_ns)
              for file in files if file.is_file() for state in [file.stat()]]
    options = sorted((name, str(value)) for name, value in vars(arguments).items()
                     if name not in _NEUTRAL and not callable(value))
    model = arguments.model.read_bytes() if arguments.model else b''
    content = repr((__version__, str(piece.path.absolute()), piece.joint, states, options))
    return hashlib.sha256(content.encode('utf-8', 'backslashreplace') + model).hexdigest()


def earlier_result(folder: Path, made_from: str) -> dict[str, Any] | None:
    """Return what `DONE` in a recording's folder holds if it has this fingerprint, else None."""
    try:
        found = json.loads((folder / DONE).read_text(encoding='utf-8'))
    except (OSError, ValueError):
        return None
    usable = isinstance(found, dict) and found.get('made_from') == made_from
    return found if usable and (folder / 'report.json').is_file() else None
