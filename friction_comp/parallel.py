# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs work in child processes that end with their parent, on one item or on many."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, ExitStack, suppress
from dataclasses import dataclass
import multiprocessing
from multiprocessing import resource_tracker
import os
import signal
import threading
from typing import Any, TYPE_CHECKING, TypeVar

from friction_comp.errors import InputError, one_line

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

T = TypeVar('T')
U = TypeVar('U')


@dataclass(frozen=True)
class Failure:
    """The reason why there is no result, in one line."""

    reason: str


Outcomes = Generator[tuple[int, 'U | Failure'], None, None]
Runner = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[tuple[int, Any]]]
"""Does work on each of several items; yields index and outcome in the order of their end."""


def attempt(work: Callable[[T], U], item: T) -> U | Failure:
    """Return what work makes of an item, or why it made nothing."""
    try:
        return work(item)
    except InputError as error:
        return Failure(one_line(error))
    except Exception as error:
        # An error in the program on one recording of a thousand must not lose the others.
        return Failure(f'{item}: {type(error).__name__}: {one_line(error)}')


def run_each(work: Callable[[T], U], items: Sequence[T], jobs: int = 1) -> Outcomes[U]:
    """Do work on each of several items; yield the index of each and its outcome, or a `Failure`.

    With more than one job, work and items are pickled and done in so many processes. A process that
    is killed, for want of memory say, is replaced, and costs the item that it had, but no other. An
    error on the only item is raised.
    """
    if len(items) == 1:
        yield 0, work(items[0])
    elif jobs < 2:
        for index, item in enumerate(items):
            yield index, attempt(work, item)
    else:
        yield from _in_processes(work, items, min(jobs, len(items)))


def _in_processes(work: Callable[[T], U], items: Sequence[T], jobs: int) -> Outcomes[U]:
    waiting = iter(enumerate(items))
    running: dict[Future[U | Failure], tuple[int, ProcessPoolExecutor]] = {}

    def begin_next(process: ProcessPoolExecutor) -> None:
        for index, item in waiting:
            running[process.submit(attempt, work, item)] = index, process
            break

    with ExitStack() as stack:
        for _ in range(jobs):
            begin_next(stack.enter_context(child_process()))
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                index, process = running.pop(future)
                outcome: U | Failure
                try:
                    outcome = future.result()
                except BrokenProcessPool:
                    outcome = Failure(f'{items[index]}: the process that had it was killed '
                                      '(out of memory?)')
                    process = stack.enter_context(child_process())
                begin_next(process)
                yield index, outcome


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
def child_process() -> Iterator[ProcessPoolExecutor]:
    """Yield an executor with one process; leaving the block ends its work."""
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

    def end() -> None:
        with suppress(EOFError):
            listening.recv()
        os._exit(1)
    threading.Thread(target=end, daemon=True).start()
