# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of random simulated drives with undeclared effects, for tests and benchmarks."""
