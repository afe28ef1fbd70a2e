# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables as samples: a table is no bag, and its rows are no messages."""
