# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects that a model can have beside the sigmoid: one file each, and one line in the list."""

from friction_comp.model.effects.actuation_lag import ActuationLag
from friction_comp.model.effects.base import Effect, OnlineTerm, Scene, VARIABLES
from friction_comp.model.effects.bump import Bump
from friction_comp.model.effects.direction_asymmetry import DirectionAsymmetry
from friction_comp.model.effects.gravity import Gravity
from friction_comp.model.effects.hysteresis import Hysteresis
from friction_comp.model.effects.inertia import Inertia
from friction_comp.model.effects.load import LoadFriction, LoadTorque
from friction_comp.model.effects.rest import RestTime
from friction_comp.model.effects.ripple import Cogging, FrictionRipple
from friction_comp.model.effects.spring import Spring
from friction_comp.model.effects.stribeck import Stribeck
from friction_comp.model.effects.temperature import Temperature
from friction_comp.model.effects.viscous_shape import ViscousShape
from friction_comp.model.effects.warm_up import OffsetDrift, WarmUp

EFFECTS = {effect.name: effect for effect in (
    Stribeck,
    ViscousShape,
    DirectionAsymmetry,
    Gravity,
    Spring,
    Cogging,
    FrictionRipple,
    Bump,
    Inertia,
    LoadTorque,
    LoadFriction,
    Temperature,
    WarmUp,
    OffsetDrift,
    Hysteresis,
    RestTime,
    ActuationLag,
)}

__all__ = ['EFFECTS', 'VARIABLES', 'Effect', 'OnlineTerm', 'Scene']
