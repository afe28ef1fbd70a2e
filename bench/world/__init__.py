# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated joints, gears, persons, motions and sensors, from the literature, for all judges.

Nothing here uses the package's simulation, its models or its law: that is its point.

joint           one joint with hidden effects under a controller, for `second_world`, which judges
                refinement; motion, sensing: how it is moved and recorded
gear            banks of geared joints with four kinds of friction, for laws and identification
mujoco_gear     the same in an engine that is not ours
person          who holds a joint of a bank

Even seeds are for tuning, odd seeds for evaluation.
"""

from contextlib import suppress
from pathlib import Path

# Numba looks at a function's own file only; what one module compiles holds others' functions too.
_SOURCES = max(source.stat().st_mtime for source in Path(__file__).parent.glob('*.py'))
for _index in Path(__file__).parent.rglob('*.nbi'):
    with suppress(FileNotFoundError):   # another process removes it, too
        if _index.stat().st_mtime < _SOURCES:
            _index.unlink()
