# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Plans motion that distinguishes the effects of a drive, within limits.

A motion is judged by the columns that refinement will fit: by the part of an effect for which no
other can stand in.
"""
