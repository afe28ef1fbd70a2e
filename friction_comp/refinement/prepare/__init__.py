# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""From recordings to data that can be fitted."""
