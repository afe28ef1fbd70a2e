# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Closes the loop on measured data: from the residual to the effect that the model lacks."""

from friction_comp.refinement.refine import refine, RefineResult

__all__ = ['RefineResult', 'refine']
