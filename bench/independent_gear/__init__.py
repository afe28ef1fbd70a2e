# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated geared joints to evaluate the compensation law, independent of the package.

Nothing here uses the package's simulation or the law's code; `law_judge` brings them together. Even
seeds are for tuning, odd seeds for evaluation.
"""

from contextlib import suppress
from pathlib import Path


def _forget_stale_machine_code():
    """Remove compiled code older than any source here: numba looks at a function's own file only.

    What `plant` compiles holds the functions of `friction` and of `law_judge.person` too.
    """
    here = Path(__file__).parent
    sources = [*here.glob('*.py'), here.parent / 'law_judge' / 'person.py']
    newest = max(source.stat().st_mtime for source in sources)
    for index in (here / '__pycache__').glob('*.nbi'):
        with suppress(FileNotFoundError):  # another process removes it, too
            if index.stat().st_mtime < newest:
                index.unlink()


_forget_stale_machine_code()
