# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the units of a fleet: what varies, which unit is out, and what to expect of a new one.

Everything is computed from sums of products over each recording, never from samples.
"""
