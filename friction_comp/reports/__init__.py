# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reports and figures: results of other rooms in words and pictures.

A page is one file that needs nothing from elsewhere, and its verdict comes first.
"""
