# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds in recordings the effects that a friction model lacks."""

from friction_comp.refinement.refine import refine, RefineResult

__all__ = ['RefineResult', 'refine']
