# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Fits the rigid bodies of a URDF to recordings of an arm, offline.

The result, a `friction_comp.model.arm.tree.Tree` with fitted parameters, becomes part of the model.
"""
