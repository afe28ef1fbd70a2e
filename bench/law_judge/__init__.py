# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Experiments that judge the compensation law on any world of gears, and what they are made of.

A world is a module with ``KINDS``, ``draw(kind, draws, seed)``, ``true_models(gears, seed,
repetitions)`` and a class ``Plant``; `independent_gear` and `mujoco_gear` are two. The package is
touched in one place, `subject`.
"""
