# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What `law_judge` asks of a world."""

from mujoco_gear.gears import draw_gears, frictionless, KINDS
from mujoco_gear.plant import Plant
from mujoco_gear.truth import breakaway_currents, presliding, steady_friction

__all__ = ['breakaway_currents', 'draw_gears', 'frictionless', 'KINDS', 'Plant', 'presliding',
           'steady_friction']
