# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the compensation loop commands its motors through, whatever carries the commands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

# Smaller currents are set to zero, since decaying ones would become denormal numbers, A.
NEGLIGIBLE = 1e-12


class Port(Protocol):
    """Carries one command for each joint state; zero takes precedence, from any thread.

    Every zero command increases `ticket`, and currents with an earlier ticket are not carried: it
    is read before a current is computed. It is the one place where currents are limited and must be
    finite before they leave. `last` is the last command in A.
    """

    ticket: int
    last: list[float]

    @property
    def ready(self) -> bool:
        """Whether somebody can hear commands."""

    def set_limits(self, limits: Sequence[float], torques: Sequence[float]) -> None:
        """Set the joints' largest currents, A, and their torques at the joint, N·m per A."""

    def answer(self, currents: Sequence[float] | np.ndarray, ticket: int, stamp: int = 0) -> bool:
        """Carry currents in A, one for each joint, as the answer to a state's stamp in ns.

        Where one is not finite, all are zero. Return whether all are finite.
        """

    def repeat(self, sent: int) -> None:
        """Answer a state that was `sent` again, system time in ns, if its answer was lost."""

    def zero(self) -> None:
        """Command zero current on all joints now."""
