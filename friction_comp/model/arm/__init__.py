# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Torques of the rest of the arm on a joint, computed from the parameters in a model file.

The parameters are fitted by `friction_comp.arm` and `friction_comp.refinement` (groups of
terms). Programs that run with a robot need only this package, neither a URDF nor Pinocchio.
"""
