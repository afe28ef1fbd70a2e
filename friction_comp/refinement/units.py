# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Converts sentences about currents to the unit of the recording."""

from __future__ import annotations

import re


def in_unit(text: str, unit: str) -> str:
    """Return a sentence about currents with A replaced by the unit of the recording.

    Effects describe themselves in A; a recording may hold torque in N·m or a servo's voltage.
    """
    if unit == 'A':
        return text
    return re.sub(r'(?<=\d) A\b', f' {unit}', text)
