# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What recorded trials say of the help a person gets."""
