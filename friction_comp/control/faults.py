# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Keeps a node's current faults; each is logged once when it begins and once when it ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import threading
import time
from typing import Any

WARN, ERROR = b'\x01', b'\x02'


@dataclass
class _Fault:
    text: str
    level: bytes
    begun: float
    seen: float


class Faults:
    """Present faults of a node, and latched ones that remain until they are reset; for all threads.

    A fault ends when it has not been reported for some time, so that an intermittent one counts as
    one. `latched` tells whether any fault is, `count` how many there were.
    """

    def __init__(self, logger: Any, clock: Callable[[], float] = time.monotonic) -> None:
        self._logger, self._clock = logger, clock
        self._faults: dict[str, _Fault] = {}
        self._latched: dict[str, str] = {}
        self.latched = False
        self._lock = threading.RLock()
        self.count = 0

    def report(self, cause: str, text: str, level: bytes = ERROR) -> None:
        """Report a fault that is present now; the cause identifies it, its text may vary."""
        now = self._clock()
        with self._lock:
            fault = self._faults.get(cause)
            if fault is not None:
                fault.text, fault.seen = text, now
                return
            self._faults[cause] = _Fault(text, level, now, now)
            self.count += 1
        self._log(level, text)

    def latch(self, cause: str, text: str) -> None:
        """Keep a fault until `reset`."""
        with self._lock:
            if cause in self._latched:
                return
            self._latched[cause] = text
            self.latched = True
            self.count += 1
        self._log(ERROR, f'{text}; stays until ~/reset_faults is called')

    def reset(self) -> list[str]:
        """Clear latched faults and return their texts."""
        with self._lock:
            texts, self._latched, self.latched = list(self._latched.values()), {}, False
        for text in texts:
            self._logger.info(f'reset: {text}')
        return texts

    def expire(self) -> None:
        """End faults that have not been reported for 2 s; to be called regularly."""
        now = self._clock()
        with self._lock:
            ended = [cause for cause, fault in self._faults.items() if now - fault.seen > 2.0]
            faults = [self._faults.pop(cause) for cause in ended]
        for fault in faults:
            lasted = fault.seen - fault.begun
            # A fault that was reported once has no duration.
            self._logger.info(('ended at once' if lasted < 1e-3 else f'ended after {lasted:.3g} s')
                              + f': {fault.text}')

    def clear(self) -> None:
        """Forget everything, as when the node starts over."""
        with self._lock:
            self._faults.clear()
            self._latched.clear()
            self.latched = False

    @property
    def worst(self) -> tuple[bytes, str] | None:
        """Level and text of the present fault, latched ones first; None if there is none."""
        with self._lock:
            if self._latched:
                return ERROR, '; '.join(self._latched.values()) + ' (latched)'
            if not self._faults:
                return None
            level = max(fault.level for fault in self._faults.values())
            return level, '; '.join(
                fault.text for fault in self._faults.values() if fault.level == level)

    def _log(self, level: bytes, text: str) -> None:
        # Separate calls: rclpy allows only one severity per source line.
        if level == ERROR:
            self._logger.error(text)
        else:
            self._logger.warning(text)
