# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Stamps of messages as whole nanoseconds, which add and compare without rounding."""

from __future__ import annotations

from typing import Any

NANO = 1_000_000_000
"""Nanoseconds in a second."""


def nanoseconds(stamp: Any) -> int:
    """Return a builtin_interfaces/Time in ns."""
    return stamp.sec * NANO + stamp.nanosec


def set_stamp(stamp: Any, value: int) -> None:
    """Set a builtin_interfaces/Time to a time in ns."""
    stamp.sec, stamp.nanosec = divmod(value, NANO)
