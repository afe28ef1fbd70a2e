# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Monitors whether a model still fits its joint, and checks a running system."""
