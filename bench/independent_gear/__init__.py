# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A world of geared joints for judging the compensation law, written apart from the package's own.

Nothing here uses the package's simulation or the law's code. The package is touched in two places:
`subject` (the law and the identification under test) and `truth` (the model files' classes).

Draws with an even seed are for tuning on, draws with an odd seed are kept for judging.
"""
