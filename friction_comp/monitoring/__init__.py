# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Monitors whether a model still fits its joint, from the residual while the joint moves."""

from friction_comp.monitoring.live_residual import LiveResidual
from friction_comp.monitoring.residual_watch import ModelFit, ResidualWatch

__all__ = ['LiveResidual', 'ResidualWatch', 'ModelFit']
