# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds in recordings the effects that a friction model lacks.

Settings, effects, constants and the verdict: all is decided by errors of parts of the recording
that were not fitted.
"""

from friction_comp.refinement.refine import refine
from friction_comp.refinement.result import Origin, RefinementReport, RefineResult

__all__ = ['Origin', 'RefineResult', 'RefinementReport', 'refine']
