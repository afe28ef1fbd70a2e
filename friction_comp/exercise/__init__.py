# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Movements shown to a person, with the announced direction of each."""
