# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects that a model can have beside the sigmoid: one file each, and one line in the list."""

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.bump import Bump
from friction_comp.model.effects.direction_asymmetry import DirectionAsymmetry
from friction_comp.model.effects.gravity import Gravity
from friction_comp.model.effects.hysteresis import Hysteresis
from friction_comp.model.effects.inertia import Inertia
from friction_comp.model.effects.inner_load import InnerLoadFriction
from friction_comp.model.effects.live_term import LiveTerm
from friction_comp.model.effects.load_effects import LoadFriction, LoadTorque
from friction_comp.model.effects.other_joints import (
    CarriedLoadFriction,
    OtherJoints,
    RigidBody,
)
from friction_comp.model.effects.rest_time import RestTime
from friction_comp.model.effects.ripple import Cogging, FrictionRipple
from friction_comp.model.effects.scene import (
    CARRIES,
    Look,
    NEITHER,
    RESISTS,
    Scene,
    SearchRange,
    Signals,
    VARIABLES,
)
from friction_comp.model.effects.spring import Spring
from friction_comp.model.effects.stribeck import Stribeck
from friction_comp.model.effects.temperature import Temperature
from friction_comp.model.effects.viscous_shape import ViscousShape
from friction_comp.model.effects.warm_up import OffsetDrift, WarmUp

EFFECTS: dict[str, type[Effect]] = {}
"""Every effect by its name, in the order in which refinement tries them."""


def register(effect: type[Effect]) -> type[Effect]:
    """Make an effect known to refinement, to model files and to the compensator.

    Parameters
    ----------
    effect : type
        A subclass of `Effect`.

    Returns
    -------
    type
        The same, so that this can stand above a class as its decorator.
    """
    EFFECTS[effect.name] = effect
    return effect


for _effect in (
        Stribeck, ViscousShape, DirectionAsymmetry, Gravity, Spring, Cogging, FrictionRipple, Bump,
        Inertia, RigidBody, OtherJoints, LoadTorque, LoadFriction, CarriedLoadFriction,
        InnerLoadFriction, Temperature, WarmUp, OffsetDrift, Hysteresis, RestTime):
    register(_effect)

__all__ = [
    'CARRIES', 'EFFECTS', 'NEITHER', 'RESISTS', 'VARIABLES', 'Effect', 'LiveTerm', 'Look', 'Scene',
    'SearchRange', 'Signals', 'register',
]
