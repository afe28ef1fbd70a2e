# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Geared joints in five kinds of friction, and what `law_judge` asks of a world."""

from world.gear.gears import draw_gears, frictionless, KINDS
from world.gear.plant import Plant
from world.gear.truth import breakaway_currents, presliding, steady_friction

__all__ = ['breakaway_currents', 'draw_gears', 'frictionless', 'KINDS', 'Plant', 'presliding',
           'steady_friction']
