# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Refines a drive from its recordings: from files to report, page and model.

What the user tells counts first, then what the model holds, then what the recordings say.
"""
