# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What samples tell of themselves: every check of a signal, each with its one limit.

A fact is a function of arrays; it says what is so, in words or numbers, and decides nothing. Who
reads a file refuses it (`recorded`), who moves a motor commands zero, who refines or looks at a
robot reports. The functions also run in control loops, so they need NumPy alone.
"""
