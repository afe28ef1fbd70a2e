# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is judged, by the package's public names alone; the one place that imports it."""

try:
    from friction_comp import CompensationLaw
except ImportError:
    try:
        from friction_comp.compensation.law import CompensationLaw
    except ImportError:
        from friction_comp.procedures.compensation import CompensationLaw
try:
    from friction_comp import FrictionModel
except ImportError:
    from friction_comp.model.friction_model import FrictionModel
try:
    from friction_comp import IdentificationGoal, IdentificationRun
except ImportError:
    IdentificationGoal = IdentificationRun = None

__all__ = ['CompensationLaw', 'FrictionModel', 'IdentificationGoal', 'IdentificationRun']
