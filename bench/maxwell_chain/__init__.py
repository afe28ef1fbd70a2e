# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Drives with the note's friction behind chains of Maxwell elements; for identification only.

A chain is springs in parallel, each of which slips at its share of the level (Iwan 1966; Lampaert,
Al-Bender and Swevers 2003, with elements that relax at once). Its breakaway current is a number of
the gear, not the outcome of a ramp, so that nothing is measured to judge a measurement. Even seeds
are for tuning, odd seeds for evaluation.
"""
