# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A third kind of geared joint to evaluate law and identification (bench/third_table.py).

It shares nothing with the package's simulation nor with `independent_gear`, and no constant was
chosen on it. `plant` is the physics, `joints` draws gears and persons and gives the model that a
gear's own friction amounts to.
"""

from contextlib import suppress
from pathlib import Path


def _forget_stale_machine_code():
    """Remove compiled code older than what it holds: numba looks at a function's own file only."""
    here = Path(__file__).parent
    law = here.parents[1] / 'friction_comp' / 'compensation'
    newest = max(source.stat().st_mtime for folder in (here, law) for source in folder.glob('*.py'))
    for index in (here / '__pycache__').glob('*.nbi'):
        with suppress(FileNotFoundError):  # another process removes it, too
            if index.stat().st_mtime < newest:
                index.unlink()


_forget_stale_machine_code()
