# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What `law_judge` asks of a world."""

from independent_gear.gears import draw_gears, frictionless, KINDS
from independent_gear.plant import Plant
from independent_gear.refined import draw_refined, REFINED
from independent_gear.truth import breakaway_currents, presliding, steady_friction

__all__ = ['breakaway_currents', 'draw_gears', 'draw_refined', 'frictionless', 'KINDS', 'Plant',
           'presliding', 'REFINED', 'steady_friction']
