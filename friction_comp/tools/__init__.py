# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The command line: a tool reads its arguments, lets other rooms work, writes all or nothing."""
