# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated test recordings that share nothing with the package's simulation.

The physics is written from the literature; drives are under controllers, recordings are coarse,
late, short or broken. `families.draw(family, seed)` gives a case, `families.make(case, 'fit')` its
true motion and its recording, `judging` the smallest possible error, and compares a report with the
truth. Even seeds are for tuning, odd seeds for evaluation. Arms: `arm_table.py`; files: the tests.
"""
