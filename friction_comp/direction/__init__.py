# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Where the direction of a movement comes from: a plan, a leader, or a cheap sensor.

A direction is announced only on evidence, ends with the evidence, and is 0 in any doubt; whatever
is announced comes with its reason.
"""
