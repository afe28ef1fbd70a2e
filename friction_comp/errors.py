# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The error for unusable input, which a user can correct."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """Input that cannot be used: a file, an argument, a message or a parameter.

    The message is one line that names the input and the reason. Command-line tools print it to
    standard error and exit with status 2; nodes reject the parameter, goal or message.
    """


@contextmanager
def errors_name(thing: object) -> Iterator[None]:
    """Prefix the message of an InputError with the origin of the input, usually a path."""
    try:
        yield
    except InputError as error:
        raise InputError(f'{thing}: {error}') from None


@contextmanager
def os_errors_name(thing: object, what: str = '') -> Iterator[None]:
    """Turn an error of the operating system into an InputError: origin, `what` failed, and why."""
    try:
        yield
    except OSError as error:
        raise InputError(f'{thing}: {what}{error.strerror or error}') from None


def one_line(error: BaseException) -> str:
    """Return an error's message in one line, or its type if it has none."""
    return ' '.join(str(error).split()) or type(error).__name__
