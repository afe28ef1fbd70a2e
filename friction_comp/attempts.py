# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs the same work on many items; one that fails does not stop the others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from friction_comp.errors import InputError, one_line

T = TypeVar('T')
U = TypeVar('U')


@dataclass(frozen=True)
class Failure:
    """The reason why there is no result, in one line."""

    reason: str


Outcomes = Iterator[tuple[int, 'U | Failure']]
Runner = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[tuple[int, Any]]]
"""Does work on each of several things, and yields index and outcome in the order of their end."""


def attempt(work: Callable[[T], U], thing: T) -> U | Failure:
    """Return what work makes of a thing, or why it made nothing.

    Parameters
    ----------
    work : callable
    thing : object
        Named by its text where the error does not.
    """
    try:
        return work(thing)
    except InputError as error:
        return Failure(one_line(error))
    except Exception as error:
        # An error in the program on one recording of a thousand must not lose the others.
        return Failure(f'{thing}: {type(error).__name__}: {one_line(error)}')


def in_turn(work: Callable[[T], U], things: Sequence[T]) -> Outcomes[U]:
    """Do the work here, one thing after the other; an error is raised if there is but one.

    Parameters
    ----------
    work : callable
    things : sequence

    Yields
    ------
    int, object or Failure
        Index of the thing, and the outcome.
    """
    if len(things) == 1:
        yield 0, work(things[0])
        return
    for index, thing in enumerate(things):
        yield index, attempt(work, thing)
