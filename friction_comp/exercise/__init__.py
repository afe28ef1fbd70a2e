# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reference movements that a person follows, with announced directions."""
