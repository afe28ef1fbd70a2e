# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a model still fits the joint that it drives, told while the joint moves."""

from friction_comp.monitoring.live_residual import LiveResidual
from friction_comp.monitoring.residual_watch import ModelFit, ResidualWatch

__all__ = ['LiveResidual', 'ResidualWatch', 'ModelFit']
