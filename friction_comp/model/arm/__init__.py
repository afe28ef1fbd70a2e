# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the rest of the arm asks of a joint, as a model file holds it: to be computed, not fitted.

Numbers that `friction_comp.rigid_bodies` and `friction_comp.refinement` (groups of terms) have
fitted; all that runs beside a robot needs this room alone, and neither a URDF nor Pinocchio.
"""
