# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects that a model can have in addition to the sigmoid: one class each, listed here."""

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.definitions import (
    CARRIES,
    Coverage,
    NEITHER,
    ResidualView,
    RESISTS,
    SearchRange,
    Signals,
    VARIABLES,
)
from friction_comp.model.effects.history_effects import (
    Backlash,
    Hysteresis,
    OffsetDrift,
    RestTime,
    Temperature,
    WarmUp,
)
from friction_comp.model.effects.live_term import LiveTerm
from friction_comp.model.effects.position_effects import Bump, Cogging, FrictionRipple
from friction_comp.model.effects.torque_effects import (
    CarriedLoadFriction,
    Gravity,
    Inertia,
    InnerLoadFriction,
    LoadFriction,
    LoadTorque,
    OtherJoints,
    RigidBody,
    Spring,
)
from friction_comp.model.effects.velocity_effects import DirectionAsymmetry, Stribeck, ViscousShape

EFFECTS: dict[str, type[Effect]] = {}
"""Every effect by its name, in the order in which refinement tries them."""


def register(effect: type[Effect]) -> type[Effect]:
    """Make an effect known to refinement, model files and the compensator; a class decorator."""
    EFFECTS[effect.name] = effect
    return effect


for _effect in (
        Stribeck, ViscousShape, DirectionAsymmetry, Gravity, Spring, Cogging, FrictionRipple, Bump,
        Inertia, RigidBody, OtherJoints, LoadTorque, LoadFriction, CarriedLoadFriction,
        InnerLoadFriction, Temperature, WarmUp, OffsetDrift, Hysteresis, Backlash,
        RestTime):
    register(_effect)

__all__ = [
    'CARRIES', 'EFFECTS', 'NEITHER', 'RESISTS', 'VARIABLES', 'Coverage', 'Effect', 'LiveTerm',
    'ResidualView', 'SearchRange', 'Signals', 'register',
]
