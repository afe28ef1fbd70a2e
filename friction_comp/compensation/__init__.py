# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The law that turns a model of friction into a motor current, and the safety it cannot skip."""

from contextlib import suppress
from pathlib import Path

# Numba compiles a function anew when its own file has changed, not when one that it calls has: code
# that is older than any file of the law is forgotten, also that of simulations that run it.
_here = Path(__file__).parent
_newest = max(path.stat().st_mtime for path in _here.glob('*.py'))
for _index in [*_here.rglob('*.nbi'), *_here.with_name('simulation').rglob('*.nbi')]:
    with suppress(OSError):
        if _index.stat().st_mtime < _newest:
            _index.unlink()
