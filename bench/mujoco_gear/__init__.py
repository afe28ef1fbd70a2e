# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Geared joints in MuJoCo, to evaluate the compensation law with another engine.

Stick and slip are MuJoCo's own ``frictionloss``, gravity its own, springs its tendons. What it
lacks is set from outside, once a millisecond, and never gives energy: levels that depend on place,
rest and side, springs that differ by side, damping that acts only while teeth touch.

Even seeds are for tuning, odd seeds for evaluation.
"""
