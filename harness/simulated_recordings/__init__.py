# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Random simulated drives, and a loop around a joint, for tests and benchmarks.

Recordings of drives with undeclared effects (`drives`); and plant, law and person in one loop
without middleware (`closed_loop`), which the nodes in lockstep must agree with.
"""
