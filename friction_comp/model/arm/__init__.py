# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a joint's current owes to the rest of the arm, as a model file holds it."""
