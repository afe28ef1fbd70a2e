# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The technical note's experiments, repeated on simulated joints."""
