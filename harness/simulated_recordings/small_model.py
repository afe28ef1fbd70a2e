# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The smallest model that the law compensates."""

from friction_comp.drive import Drive
from friction_comp.model.friction_model import Breakaway, FrictionModel, Presliding
from friction_comp.model.sigmoid import Sigmoid

LEVEL = 0.1


def small_model(factor=1.0):
    """A drive of 0.1 A, sliding and breaking away."""
    return FrictionModel(
        drive=Drive(0.1, 100.0, 4000), sigmoid=Sigmoid(factor * LEVEL, -factor * LEVEL, 200.0),
        breakaway=Breakaway(factor * LEVEL, -factor * LEVEL), presliding=Presliding(3e-4))
