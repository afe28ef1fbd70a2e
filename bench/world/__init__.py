# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""One engine for all judges: joints, gears, persons, motions and sensors, from the literature.

Nothing here uses the package's simulation, its models or its law: that is its point.

joint, drive    one joint with hidden effects under a controller, for `second_world`, which judges
                refinement; motion, sensing, arm: how it is moved, recorded, and linked to others
gear            banks of geared joints with five kinds of friction, for `law_judge`
mujoco_gear     the same in an engine that is not ours
maxwell_chain   the note's drives behind chains of Maxwell elements, for identification only
person          who holds a joint of a bank

Even seeds are for tuning, odd seeds for evaluation.
"""

from contextlib import suppress
from pathlib import Path


def _forget_stale_machine_code():
    """Remove compiled code older than any source here: numba looks at a function's own file only.

    What one module compiles holds the functions of others too.
    """
    here = Path(__file__).parent
    newest = max(source.stat().st_mtime for source in here.rglob('*.py'))
    for index in here.rglob('*.nbi'):
        with suppress(FileNotFoundError):  # another process removes it, too
            if index.stat().st_mtime < newest:
                index.unlink()


_forget_stale_machine_code()
