# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects that a model can have in addition to the sigmoid: one class each, listed here."""

from friction_comp.model.effects import (
    history_effects as history,
    position_effects as position,
    torque_effects as torque,
    velocity_effects as velocity,
)
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
    VARIABLES,
)

EFFECTS: dict[str, type[Effect]] = {}
"""Every effect by its name, in the order in which refinement tries them."""


def register(effect: type[Effect]) -> type[Effect]:
    """Make an effect known to refinement, model files and the compensator; a class decorator."""
    EFFECTS[effect.name] = effect
    return effect


for _effect in (
        velocity.Stribeck, velocity.ViscousShape, velocity.DirectionAsymmetry, torque.Gravity,
        torque.Spring, position.Cogging, position.FrictionRipple, position.Bump, torque.Inertia,
        torque.RigidBody, torque.OtherJoints, torque.LoadTorque, torque.LoadFriction,
        torque.CarriedLoadFriction, torque.InnerLoadFriction, history.Temperature, history.WarmUp,
        history.OffsetDrift, history.Hysteresis, history.Backlash, history.RestTime):
    register(_effect)

__all__ = [
    'CARRIES', 'EFFECTS', 'NEITHER', 'RESISTS', 'VARIABLES', 'Coverage', 'Effect', 'LiveTerm',
    'ResidualView', 'SearchRange', 'Signals', 'register',
]
