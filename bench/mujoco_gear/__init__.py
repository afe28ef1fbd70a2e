# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Geared joints in MuJoCo: an engine that is not ours judges the compensation law.

Stick and slip are MuJoCo's own ``frictionloss``, gravity its own, springs its tendons. What it
lacks is set from outside, once a millisecond, and never gives energy: levels that depend on place,
rest and side, springs that differ by side, damping that acts only while teeth touch.

Draws with an even seed are for tuning on, draws with an odd seed are kept for judging.
"""
