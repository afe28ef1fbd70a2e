# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated arms to evaluate refinement without a URDF (bench/arm_table.py).

It shares nothing with the package's simulation nor with its rigid bodies: Pinocchio computes the
dynamics. `recording.case(seed)` draws an arm, its friction, one of four types of motion and what
encoders and torque sensors saw of it; `judging.judge(seed)` fits one recording and scores others.
Seeds 0 to 23 were used for tuning, seeds from 24 on are for evaluation.
"""
