# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Geared joints in MuJoCo, to evaluate the compensation law with another engine.

Stick and slip are MuJoCo's own ``frictionloss``, gravity its own, springs its tendons. What it
lacks is set from outside, once a millisecond, and never gives energy: levels that depend on place,
rest and side, springs that differ by side, damping that acts only while teeth touch.
"""

from world.mujoco_gear.gears import draw_gears, frictionless, KINDS
from world.mujoco_gear.plant import Plant
from world.mujoco_gear.truth import breakaway_currents, presliding, steady_friction

__all__ = ['breakaway_currents', 'draw_gears', 'frictionless', 'KINDS', 'Plant', 'presliding',
           'steady_friction']
