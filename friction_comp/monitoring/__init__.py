# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Monitors whether a model still fits its joint, and checks a running system.

It observes, and says what is wrong and what to do; it commands and changes nothing.
"""
