# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compensation laws that feed friction forward in announced directions."""
