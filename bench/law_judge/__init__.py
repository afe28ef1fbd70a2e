# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Experiments that judge the compensation law on any set of simulated gears.

A world is a module with the names of `world.gear` or `world.mujoco_gear`. Of the package, only
public names are used. What persons feel is in `hands`, what joints do by themselves in `alone`.
"""
