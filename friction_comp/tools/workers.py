# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Works on many recordings in parallel, on this machine or on a cluster, with Dask.

Dask is an extra. Without it, work is done in the tool's own process, one recording after the other.
A process that is killed, for want of memory say, is replaced, and costs the recording it had.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
import importlib.util
import logging
from multiprocessing import resource_tracker
import os
import signal
from typing import TYPE_CHECKING, TypeVar

from friction_comp import __version__
from friction_comp.attempts import attempt, Failure, in_turn, Outcomes, Runner
from friction_comp.errors import InputError, one_line
from friction_comp.tools.common import Arguments, whole_number

if TYPE_CHECKING:
    from distributed import Client

T = TypeVar('T')
U = TypeVar('U')

# Number of recordings from which processes save more time than their start takes: about 6 s of
# processor time each, as much as four short recordings take.
MIN_SHARED = 8
# s within which a scheduler must respond.
_PATIENCE = 10.0
# s within which it must have a worker.
_WORKER_PATIENCE = 60.0
_CONFIGURATION = {
    # One recording at a time for each process, so that losing a process loses one recording; a
    # recording that killed a process is not retried.
    'distributed.scheduler.worker-saturation': 1.0,
    'distributed.scheduler.allowed-failures': 0,
    'distributed.comm.timeouts.connect': _PATIENCE,
}


def add_workers(parser: Arguments) -> Arguments:
    """Add --jobs and --scheduler to a tool's arguments."""
    parser.add_argument(
        '--jobs', metavar='N', type=whole_number(),
        help='recordings that are worked on at once, each in a process of its own (by default, '
        'where that saves time, as many as there are processors; more than one needs '
        'dask.distributed)')
    parser.add_argument(
        '--scheduler', metavar='ADDRESS',
        help='Dask scheduler of a cluster that does the work instead, such as tcp://host:8786; '
        'its workers need this package, and the recordings under the same paths')
    return parser


def for_workers(arguments: Namespace) -> Namespace:
    """Return a tool's arguments with paths that a cluster's workers can follow.

    They were started in folders of their own, from which a relative path leads elsewhere.
    """
    if arguments.scheduler is None:
        return arguments
    return Namespace(**{
        **vars(arguments), 'recordings': [path.absolute() for path in arguments.recordings],
        'model': arguments.model and arguments.model.absolute()})


def installed() -> bool:
    """Return whether dask.distributed is there."""
    return importlib.util.find_spec('distributed') is not None


@contextmanager
def workers(arguments: Namespace, count: int, share: bool | None = None) -> Iterator[Runner]:
    """Yield the executor that the arguments select.

    Parameters
    ----------
    arguments : Namespace
        With `jobs` and `scheduler`.
    count : int
        How many things there are to be done.
    share : bool, optional
        Whether to share the work where the arguments leave it open; with `MIN_SHARED` things and
        more when omitted.

    Yields
    ------
    callable
        As `friction_comp.attempts.in_turn`.

    Raises
    ------
    InputError
        If Dask is asked for and missing, or the scheduler does not answer.
    """
    jobs = arguments.jobs
    if jobs is None:
        shared = count >= MIN_SHARED if share is None else share
        jobs = (os.cpu_count() or 1) if shared and installed() else 1
    jobs = min(jobs, count)
    if arguments.scheduler is None and jobs < 2:
        yield in_turn
        return
    if not installed():
        raise InputError('more than one process needs dask.distributed: '
                         'pip install distributed, or leave --jobs and --scheduler out')
    with _client(jobs, arguments.scheduler) as client:
        yield partial(_spread, client)


@contextmanager
def _client(jobs: int, scheduler: str | None) -> Iterator[Client]:
    """Give a client of a cluster: the one that is named, else one of this machine's processes."""
    import dask
    from distributed import Client, LocalCluster

    for name in ('distributed', 'tornado.application', 'asyncio'):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with dask.config.set(_CONFIGURATION):
        if scheduler is not None:
            try:
                client = Client(scheduler, timeout=_PATIENCE)
            except (OSError, ValueError) as error:
                raise InputError(f'--scheduler {scheduler}: no Dask scheduler answers there '
                                 f'({one_line(error)})') from None
            with client:
                _check_workers(client, scheduler)
                yield client
            return
        # An interrupt from the keyboard reaches all processes of the terminal, but this process
        # stops the others: they, and the thread that supervises them, inherit a blocked signal
        # mask. Python's resource tracker would unblock it when it starts, so it is started before.
        resource_tracker.ensure_running()
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            cluster = LocalCluster(
                n_workers=jobs, threads_per_worker=1, processes=True, host='127.0.0.1',
                dashboard_address='127.0.0.1:0', silence_logs=logging.CRITICAL)
            client = Client(cluster)
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        try:
            yield client
        finally:
            client.close()
            cluster.close()


def _check_workers(client: Client, scheduler: str) -> None:
    """Wait for workers that can do the work: one without this package would fail.

    Clusters that grow on demand begin with no workers.
    """
    try:
        client.wait_for_workers(1, timeout=_WORKER_PATIENCE)
    except TimeoutError:
        raise InputError(f'--scheduler {scheduler}: it has had no workers for '
                         f'{_WORKER_PATIENCE:.3g} s') from None
    # This package may be missing there, so nothing of it can be sent to check.
    there = client.run(eval, "__import__('friction_comp').__version__", on_error='return')
    for worker, version in there.items():
        if version != __version__:
            raise InputError(f'--scheduler {scheduler}: the worker {worker} has no friction_comp '
                             f'{__version__} ({version})')


def _spread(client: Client, work: Callable[[T], U], things: Sequence[T]) -> Outcomes[U]:
    """Do the work on a cluster; results are given back as they come, and then forgotten there."""
    from distributed import as_completed, KilledWorker

    futures = client.map(partial(attempt, work), things, pure=False)
    index_of = {future.key: k for k, future in enumerate(futures)}
    try:
        for future in as_completed(futures):
            index = index_of[future.key]
            try:
                # Results that were not fetched before their process was killed are computed again.
                yield index, future.result()
            except KilledWorker:
                yield index, Failure(f'{things[index]}: the process that had it was killed '
                                      '(out of memory?)')
            future.release()
    finally:
        client.cancel(futures)
