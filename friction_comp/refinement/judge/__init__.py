# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the residual still says, and what cannot be concluded."""
