# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies of a URDF, fitted to recordings of an arm: all that is done offline and once.

What comes of it, a `friction_comp.model.arm.tree.Tree` with fitted parameters, belongs to the
model.
"""
