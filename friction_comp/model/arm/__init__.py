# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Torques of the rest of the arm on a joint, as a model file holds them: computed, not fitted.

Numbers that `friction_comp.rigid_bodies` and `friction_comp.refinement` (groups of terms) have
fitted; all that runs beside a robot needs this room alone, and neither a URDF nor Pinocchio.
"""
