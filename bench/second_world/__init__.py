# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated test recordings that share nothing with the package's simulation.

Its physics is written from the literature, its drives are under controllers, its recordings are
coarse, late, short or broken, and what is behind each is known: `families.draw(family, seed)`
gives a case, `cases.make(case, 'fit')` what happened and what was seen of it, `oracle` what can be
known at best, `judging` what was right in what was said. Seeds that are even are for tuning, odd
ones are kept.
"""
