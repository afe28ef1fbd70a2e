# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An arm from recordings and a URDF: its links together with what acts on each joint, offline.

The result, a `friction_comp.model.arm.Tree` with fitted parameters, becomes part of the model.
"""
