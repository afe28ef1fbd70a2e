# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates recorded trials, and compares units: how much compensation helps, which unit is odd.

What was recorded under one condition is averaged, and conditions are compared where that answers a
question.
"""
