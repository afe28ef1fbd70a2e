# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Watches a stream from a separate thread, on the monotonic clock.

The thread shares neither executor nor callbacks with what it watches. What it does share is
Python's interpreter lock: it runs while the watched thread waits, sleeps or computes in Python,
but not while one call into compiled code holds the lock. The calls of the control loop take
microseconds. Against a process that hangs altogether, or is killed, only the driver's own
timeout helps.
"""

from __future__ import annotations

from collections.abc import Callable
import os
import select
import threading
import time

from friction_comp.compiling import compiling

# The alarm comes this share of the timeout, at most so many seconds, before its end: what it
# sets off is to arrive within the timeout.
_EARLY, _EARLIEST = 0.1, 0.005
# The same while code is compiled in this process, which may hold up all its threads.
_EARLY_COMPILING, _EARLIEST_COMPILING = 0.3, 0.02


class Watchdog:
    """Calls for help when it is not fed for as long as a timeout.

    It begins with the first feeding, calls once, and starts over with the next feeding.

    Parameters
    ----------
    timeout : float
        s.
    alarm : callable
        Called in the watchdog's thread.
    clock : callable
        Returns s; `time.monotonic`, but for tests.
    """

    def __init__(self, timeout: float, alarm: Callable[[], None],
                 clock: Callable[[], float] = time.monotonic) -> None:
        self._patience = timeout - min(_EARLY * timeout, _EARLIEST)
        self._less_patience = timeout - min(_EARLY_COMPILING * timeout, _EARLIEST_COMPILING)
        self._alarm, self._clock = alarm, clock
        self._fed: float | None = None
        self._idle = True
        self._closed = False
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._ends: tuple[int, int] | None = None

    def start(self) -> Watchdog:
        """Start the thread and return the watchdog."""
        self._ends = os.pipe()
        self._thread = threading.Thread(target=self._run, name='watchdog', daemon=True)
        self._thread.start()
        return self

    def feed(self) -> None:
        """Reset the watchdog."""
        with self._lock:
            self._fed = self._clock()
            asleep, self._idle = self._idle, False
        if asleep:
            self._wake()

    def rest(self) -> None:
        """Expect nothing until the next feeding."""
        with self._lock:
            self._fed = None

    def close(self) -> None:
        """End the thread."""
        if self._thread is None or self._closed:
            return
        self._closed = True
        self._wake()
        self._thread.join()
        for end in self._ends:
            os.close(end)

    def look(self) -> float | None:
        """Call the alarm if it is time; return the s until it may be, None while idle."""
        with self._lock:
            if self._fed is not None:
                patience = self._less_patience if compiling() else self._patience
                left = self._fed + patience - self._clock()
                if left > 0.0:
                    return left
            alarm = self._fed is not None
            self._fed, self._idle = None, True
        if alarm:
            self._alarm()
        return None

    def _wake(self) -> None:
        if self._ends is not None:
            os.write(self._ends[1], b'.')

    def _run(self) -> None:
        # Waits with `select`: unlike those of threading, its timeouts never follow a clock that
        # is set.
        while not self._closed:
            ready, _, _ = select.select([self._ends[0]], [], [], self.look())
            if ready:
                os.read(self._ends[0], 64)
