# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is judged, by the package's public names alone; the one place that imports it."""

from friction_comp import (
    CompensationLaw,
    Drive,
    FrictionModel,
    IdentificationGoal,
    IdentificationRun,
)

__all__ = ['CompensationLaw', 'Drive', 'FrictionModel', 'IdentificationGoal', 'IdentificationRun']
