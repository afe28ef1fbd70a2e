# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A drive's current as the sigmoid of Eq. 6 plus a sum of effects, and what else its file holds.

A room above asks a model; none changes one: what is measured or refined becomes a new model.
"""
