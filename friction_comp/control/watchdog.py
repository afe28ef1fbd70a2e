# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Watches a stream from a separate thread, on the monotonic clock.

The thread shares neither executor nor callbacks with the watched stream, only Python's interpreter
lock: it runs while the watched thread waits, sleeps or executes Python, but not during a call of
compiled code that holds the lock. Such calls of the control loop take microseconds. If the process
hangs or is killed, only the timeout of the driver helps.
"""

from __future__ import annotations

from collections.abc import Callable
import threading
import time


class Watchdog:
    """Calls an alarm, in its thread, if it is not fed within a timeout in s.

    It starts with the first `feed`, calls the alarm once, and restarts with the next `feed`.
    """

    def __init__(self, timeout: float, alarm: Callable[[], None],
                 clock: Callable[[], float] = time.monotonic) -> None:
        # Earlier, so that its effect arrives in time.
        self._timeout = timeout - min(0.1 * timeout, 0.005)
        self._alarm, self._clock = alarm, clock
        self._fed: float | None = None
        self._lock = threading.Lock()
        self._closed = False

    def start(self) -> Watchdog:
        """Start the thread and return the watchdog."""
        threading.Thread(target=self._run, name='watchdog', daemon=True).start()
        return self

    def feed(self) -> None:
        """Reset the watchdog."""
        with self._lock:
            self._fed = self._clock()

    def rest(self) -> None:
        """Pause until the next `feed`."""
        with self._lock:
            self._fed = None

    def close(self) -> None:
        """End the thread, without an alarm."""
        self._closed = True
        self.rest()

    def check(self) -> float | None:
        """Call the alarm if it is due; return the time until then in s, None while idle."""
        with self._lock:
            if self._fed is None:
                return None
            left = self._fed + self._timeout - self._clock()
            if left > 0.0:
                return left
            self._fed = None
        self._alarm()
        return None

    def _run(self) -> None:
        # While idle, no alarm is due before a timeout after the next `feed`.
        while not self._closed:
            time.sleep(self.check() or self._timeout)
