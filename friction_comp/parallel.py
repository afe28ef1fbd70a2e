# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs work on items, in child processes that end with their parent or on Dask's workers.

The work itself uses one thread: its matrices are small.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, ExitStack, suppress
from dataclasses import dataclass
import functools
import multiprocessing
from multiprocessing.connection import Connection
import os
import signal
import threading
from typing import Any, cast, TypeVar

from friction_comp.errors import InputError, one_line
from friction_comp.interrupts import interrupts_deferred

F = TypeVar('F', bound=Callable[..., Any])
Work = Callable[[Any], Any]
Outcomes = Generator[tuple[int, Any], None, None]
"""The index and outcome of each item when it is finished."""


def one_thread(function: F) -> F:
    """Return a function during which libraries of linear algebra use one thread.

    With small matrices their threads mostly wait for each other, and a control loop for them.
    """
    @functools.wraps(function)
    def limited(*arguments: Any, **named: Any) -> Any:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(1, 'blas'):
            return function(*arguments, **named)
    return cast(F, limited)


@dataclass(frozen=True)
class Failure:
    """Stands for a missing result; `reason` is one line."""

    reason: str


def attempt(work: Work, item: Any) -> Any:
    """Return the result of work on an item, or a `Failure` if it raises an error."""
    try:
        return work(item)
    except InputError as error:
        return Failure(one_line(error))
    except Exception as error:
        # A bug that affects one recording of a thousand must not lose the results of the others.
        return Failure(f'{item}: {type(error).__name__}: {one_line(error)}')


def run_each(work: Work, items: Sequence[Any], jobs: int = 1) -> Outcomes:
    """Do work on each item; yield the index of each with its result or a `Failure`.

    With several `jobs`, work and items are pickled and processed in so many processes. If a process
    is killed, for instance for lack of memory, its item fails and the process is replaced. If there
    is only one item, its errors are raised.
    """
    if len(items) == 1:
        yield 0, work(items[0])
    elif jobs < 2:
        for index, item in enumerate(items):
            yield index, attempt(work, item)
    else:
        yield from _in_processes(work, items, min(jobs, len(items)))


def _in_processes(work: Work, items: Sequence[Any], jobs: int) -> Outcomes:
    """Yield index and outcome of each item, the first finished first.

    Each process is a pool of its own: one that is killed fails its item alone, and is replaced.
    """
    waiting = iter(enumerate(items))
    running: dict[Future[Any], tuple[int, ProcessPoolExecutor]] = {}

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
                try:
                    outcome = future.result()
                except BrokenProcessPool:
                    outcome = Failure(f'{items[index]}: the process working on it was killed '
                                      '(out of memory?)')
                    process = stack.enter_context(child_process())
                begin_next(process)
                yield index, outcome


@contextmanager
def child_process() -> Iterator[ProcessPoolExecutor]:
    """Yield an executor with one process; leaving the block ends its work."""
    # A fresh interpreter: a fork of a process that has run compiled threads may deadlock.
    context = multiprocessing.get_context('spawn')
    child_end, parent_end = context.Pipe(duplex=False)
    # Close the pipe before the pool, which waits for work that has begun.
    with ProcessPoolExecutor(max_workers=1, mp_context=context, initializer=_end_with_parent,
                             initargs=(child_end,)) as pool, parent_end:
        # Ctrl-C reaches both processes: the child inherits that it is ignored, and waits until this
        # one closes the pipe.
        with interrupts_deferred():
            former = signal.signal(signal.SIGINT, signal.SIG_IGN)
            pool.submit(int)
            signal.signal(signal.SIGINT, former)
        yield pool


def _end_with_parent(child_end: Connection) -> None:
    """End this process, which might work on for long, when its parent closes a pipe or dies."""
    def end() -> None:
        with suppress(EOFError):
            child_end.recv()
        os._exit(1)
    threading.Thread(target=end, daemon=True).start()


# s within which a scheduler must answer.
_PATIENCE = 10.0
# A worker may have several threads, but the work is not written for that.
_ALONE = threading.Lock()


@contextmanager
def runner_on_cluster(address: str) -> Iterator[Callable[[Work, Sequence[Any]], Outcomes]]:
    """Yield a function that does work on items as `parallel.run_each` does, on Dask's workers.

    Workers read the items themselves: files need the same path everywhere. Leaving the block
    cancels what is not done. Raises InputError if Dask is not installed, or no scheduler with
    workers answers at the address.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--scheduler needs Dask: pip install 'friction_comp[fleet]'") from None
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f'--scheduler {address}: no Dask scheduler answers: {one_line(error)}'
                         ) from None
    with client:
        if not client.scheduler_info()['workers']:
            raise InputError(f'--scheduler {address}: has no workers: start some with '
                             f'dask worker {address} --nthreads 1')
        yield functools.partial(_run, client)


def _run(client: Any, work: Work, items: Sequence[Any]) -> Outcomes:
    from distributed import as_completed

    futures = {client.submit(_alone, work, item, pure=False): index
               for index, item in enumerate(items)}
    try:
        for future in as_completed(list(futures), loop=client.loop):
            index, error = futures.pop(future), future.exception()
            yield index, future.result() if error is None else Failure(
                f'{items[index]}: the workers that did it ended: {one_line(error)}')
            # The workers may forget the result.
            future.release()
    finally:
        client.cancel(list(futures))


def _alone(work: Work, item: Any) -> Any:
    with _ALONE:
        return attempt(work, item)
