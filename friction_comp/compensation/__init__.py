# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The law that turns a model of friction into a motor current, and the safety it cannot skip."""

from contextlib import suppress
from pathlib import Path
import time

# Numba compiles a function anew when its own file has changed, not when one that it calls has or
# has moved: code that is older than any file of the package is forgotten. Files from the future, of
# a computer whose clock is not set yet, do not count: nothing would ever be newer.
_package = Path(__file__).parents[1]
_now = time.time()
_newest = max((changed for path in _package.rglob('*.py')
               if (changed := path.stat().st_mtime) <= _now), default=0.0)
for _index in _package.rglob('*.nbi'):
    with suppress(OSError):
        if _index.stat().st_mtime < _newest:
            _index.unlink()
