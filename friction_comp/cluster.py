# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs work on the workers of a Dask scheduler, on one or many machines."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
import threading
from typing import Any
from urllib.parse import urlsplit

from friction_comp.errors import InputError, one_line
from friction_comp.parallel import attempt, Failure, Outcomes, Runner

# s within which a scheduler must answer.
_PATIENCE = 10.0
# A worker may have several threads, but the work is not written for that.
_ALONE = threading.Lock()


@contextmanager
def runner_on_cluster(address: str) -> Iterator[Runner]:
    """Yield a function that does work on items as `parallel.run_each` does, on Dask's workers.

    Workers read the items themselves: files need the same path everywhere. Leaving the block
    cancels what is not done. Raises InputError if Dask is not installed, or no scheduler with
    workers answers at the address.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--scheduler needs Dask: pip install 'friction_comp[fleet]'") from None
    _check_address(address)
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f'--scheduler {address}: no Dask scheduler answers: {one_line(error)}'
                         ) from None
    with client:
        if not client.scheduler_info()['workers']:
            raise InputError(f'--scheduler {address}: has no workers: start some with '
                             f'dask worker {address} --nthreads 1')
        yield partial(_run, client)


def _check_address(address: str) -> None:
    # Dask's client of an address without a port tries to end for 20 s, and prints a traceback.
    try:
        parts = urlsplit(address if '://' in address else f'tcp://{address}')
        complete = parts.scheme != 'tcp' or bool(parts.hostname and parts.port)
    except ValueError:
        complete = False
    if not complete:
        raise InputError(f'--scheduler {address}: an address has a host and a port, for instance '
                         'tcp://host:8786')


def _run(client: Any, work: Callable[[Any], Any], items: Sequence[Any]) -> Outcomes[Any]:
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


def _alone(work: Callable[[Any], Any], item: Any) -> Any:
    with _ALONE:
        return attempt(work, item)
