# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How late the measured current follows the commanded one, and how large it then is."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

MEMORY = 0.5
"""s of measured current that are compared."""
LATEST = 0.3
"""Latest answer that is looked for, s: a busy machine takes a tenth of a second or two to hand a
current on. What comes later still is no answer to anybody who would tell it from silence."""

# s between the points that are compared: a delay is told to the nearest of these.
_GRID = 0.005
# A delay is believed where it raises the correlation by this much: with a current that is steady
# any delay is as good as none.
_CLEARLY = 0.005


class Answer(NamedTuple):
    """The measured current as a late multiple of the commanded one.

    Parameters
    ----------
    delay : float
        s.
    gain : float
        Measured over commanded current of so long before.
    likeness : float
        Their correlation about zero: 1 or -1 where the one is the other but for its size.
    earliest : float
        Root mean square in A of the commanded current that had time to be answered even by
        `LATEST`.
    """

    delay: float
    gain: float
    likeness: float
    earliest: float


class CurrentLag:
    """Remembers commanded and measured current for as long as it takes to compare them."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, float, float]] = deque()

    def add(self, time: float, command: float, measured: float) -> None:
        """Take the currents in A, smoothed alike, at a time in s."""
        past = self._past
        past.append((time, command, measured))
        while time - past[0][0] > MEMORY + LATEST:
            past.popleft()

    def answer(self) -> Answer:
        """Return the delay at which the two are most alike; 0 where that is no clear matter."""
        time, command, measured = np.array(self._past).T
        back = np.arange(round(MEMORY / _GRID)) * _GRID
        found = np.interp(time[-1] - back, time, measured, left=0.0)
        delays = np.arange(round(LATEST / _GRID) + 1) * _GRID
        asked = np.interp(time[-1] - back - delays[:, None], time, command, left=0.0)
        power, product = np.sum(asked ** 2, axis=1), asked @ found
        alike = product / np.sqrt(np.maximum(power * (found @ found), 1e-300))
        size = np.abs(alike)
        place = int(np.argmax(size)) if size.max() > size[0] + _CLEARLY else 0
        return Answer(
            float(delays[place]), float(product[place] / max(power[place], 1e-300)),
            float(alike[place]), float(np.sqrt(power[-1] / len(back))))
