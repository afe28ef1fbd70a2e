# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A geared drive: the constants that convert current to torque and encoder counts to angle."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any

from friction_comp.errors import check_number, Checked, number, stated


def _as_written(value: Any, name: str) -> Any:
    check_number(value, name, above=0.0)
    return value


@dataclass(frozen=True)
class Drive(Checked):
    """A motor with gears, described at the joint (the gear's output).

    Parameters
    ----------
    torque_constant : float
        k_t of Eq. 1 in N·m/A.
    gear_ratio : float
        n, motor turns per joint turn.
    encoder_counts : int, optional
        Counts of the motor encoder per motor turn; None if unknown.
    current_limit : float
        Largest motor current in A that may ever be commanded.

    Raises
    ------
    InputError
        If a number is not finite or not positive, or k_t · n is absurd.
    """

    torque_constant: float = stated(number(above=0.0))
    gear_ratio: float = stated(number(above=0.0))
    encoder_counts: int | None = stated(_as_written, None)
    current_limit: float = stated(number(above=0.0), 3.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number(self.torque_per_current, 'drive.torque_constant times drive.gear_ratio',
                     least=1e-9, most=1e9)

    @property
    def torque_per_current(self) -> float:
        """Joint torque per motor current, k_t · n, in N·m/A."""
        return self.torque_constant * self.gear_ratio

    def in_words(self, current: float, torque: bool = False) -> str:
        """Return a motor current in A as text with its unit, or the torque that it gives."""
        if torque:
            return f'{current * self.torque_per_current:.3g} N·m at the joint'
        return f'{current:.3g} A'

    @property
    def position_resolution(self) -> float | None:
        """Joint angle of one encoder count in rad; None if the encoder is unknown."""
        if self.encoder_counts is None:
            return None
        return 2.0 * math.pi / (self.encoder_counts * self.gear_ratio)
