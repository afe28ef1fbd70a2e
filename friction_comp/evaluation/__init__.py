# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates recorded trials: how much compensation helps a person."""
