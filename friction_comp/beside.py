# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs long work in a child process that ends with its parent."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
import multiprocessing
from multiprocessing import resource_tracker
import os
import signal
import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Let an interrupt or request to end, if one comes meanwhile, take effect afterwards."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came = []
    handlers = {signum: signal.signal(signum, lambda signum, _: came.append(signum))
                for signum in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for signum, handler in handlers.items():
            signal.signal(signum, signal.SIG_DFL if handler is None else handler)
        if came:
            signal.raise_signal(came[0])


@contextmanager
def process_beside() -> Iterator[ProcessPoolExecutor]:
    """Yield an executor with one process; leaving the block ends its work.

    Yields
    ------
    concurrent.futures.ProcessPoolExecutor
    """
    # A fresh interpreter: a fork of a process that has run compiled threads may deadlock.
    context = multiprocessing.get_context('spawn')
    listening, held = context.Pipe(duplex=False)
    # Close the pipe before the pool, which waits for work that has begun.
    with ProcessPoolExecutor(max_workers=1, mp_context=context, initializer=_end_with,
                             initargs=(listening,)) as pool, held:
        # An interrupt while the process starts would leave it half-initialised: it is blocked
        # there, and deferred here, where another thread may receive it. Python's resource tracker
        # would unblock it when it starts, so it is started before.
        resource_tracker.ensure_running()
        with interrupts_deferred():
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            try:
                pool.submit(int)
            finally:
                signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        yield pool


def _end_with(listening: Connection) -> None:
    """End this process when the other end of a pipe is closed, also when its process was killed.

    The work may take long, and there is no process left to receive the result.
    """
    # An interrupt from the keyboard reaches both processes; the pipe tells the child when to end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def wait() -> None:
        with suppress(EOFError):
            listening.recv()
        os._exit(1)
    threading.Thread(target=wait, daemon=True).start()
