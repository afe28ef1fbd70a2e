# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates recorded trials: how much compensation helps a person.

What was recorded under one condition is averaged, and conditions are compared where that answers a
question.
"""
