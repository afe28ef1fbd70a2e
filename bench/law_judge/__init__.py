# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Experiments that evaluate the compensation law on any set of simulated gears.

A world is a module with ``KINDS``, ``draw(kind, draws, seed)``, ``true_models(gears, seed,
repetitions)`` and a class ``Plant``; `independent_gear` and `mujoco_gear` are two. The package is
touched in one place, `subject`.
"""
