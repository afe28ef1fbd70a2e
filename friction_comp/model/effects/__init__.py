# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects that a model can have in addition to the sigmoid: one class each, listed here."""

from friction_comp.model.effects import kinds
from friction_comp.model.effects.base import (
    CARRIES,
    Coverage,
    Effect,
    LiveTerm,
    NEITHER,
    ResidualView,
    RESISTS,
    SearchRange,
    Signals,
)

EFFECTS: dict[str, type[Effect]] = {}
"""Every effect by its name, in the order in which refinement tries them."""


def register(effect: type[Effect]) -> type[Effect]:
    """Make an effect known to refinement, model files and the compensator; a class decorator."""
    EFFECTS[effect.name] = effect
    return effect


for _effect in (
        kinds.Stribeck, kinds.ViscousShape, kinds.DirectionAsymmetry, kinds.Gravity,
        kinds.Spring, kinds.Cogging, kinds.FrictionRipple, kinds.Bump, kinds.Inertia,
        kinds.RigidBody, kinds.OtherJoints, kinds.LoadTorque, kinds.LoadFriction,
        kinds.CarriedLoadFriction, kinds.InnerLoadFriction, kinds.Temperature, kinds.WarmUp,
        kinds.OffsetDrift, kinds.Hysteresis, kinds.Backlash, kinds.RestTime):
    register(_effect)

__all__ = [
    'CARRIES', 'EFFECTS', 'NEITHER', 'RESISTS', 'Coverage', 'Effect', 'LiveTerm',
    'ResidualView', 'SearchRange', 'Signals', 'register',
]
