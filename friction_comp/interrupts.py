# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Which signals end a program, and how: one place for all nodes and tools.

Whatever ends a tool raises `Ended` in its main thread, so that it leaves in order: a motion that it
asked for is cancelled, its nodes are stopped, nothing is left half-written. A node hears of signals
in a thread of its own (`friction_comp.ros.node_main`), since its motor cannot wait for the main
thread; it ends by the same ones.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
import signal
import sys
import threading

STOPPING = [getattr(signal, name) for name in ('SIGTSTP', 'SIGTTIN', 'SIGTTOU')
            if hasattr(signal, name)]
"""Signals of job control, which stop a process that may go on later."""
_HARMLESS = {'SIGCHLD', 'SIGCONT', 'SIGURG', 'SIGWINCH', 'SIGPIPE', 'SIGXFSZ'}
# Nobody can catch the first two, and after the others nothing can be relied on.
_FATAL = {'SIGKILL', 'SIGSTOP', 'SIGSEGV', 'SIGBUS', 'SIGFPE', 'SIGILL'}
ENDING = sorted(number for number in signal.valid_signals()
                if getattr(number, 'name', '') not in _HARMLESS | _FATAL
                and number not in STOPPING)
"""All other signals that can be caught, also those without a name."""

# How many blocks defer the end of this program, and the signals that came meanwhile.
_deferring = 0
_deferred: list[int] = []


class Ended(KeyboardInterrupt):
    """A signal has asked this program to end; `number` is the signal's."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


def end_by_exception(numbers: Collection[int] = ENDING) -> None:
    """From now on, raise `Ended` in the main thread at each of these signals.

    Signals that whoever started the program has told it to ignore, as `nohup` does, stay ignored,
    and so do handlers that are not Python's own.
    """
    _set_handler(numbers)


def _set_handler(numbers: Collection[int]) -> dict[int, object]:
    """Set `_end` as the handler of signals; return the former handlers of those that had none."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    return {number: signal.signal(number, _end) for number in numbers
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler)}


def _end(number: int, _: object) -> None:
    if _deferring:
        _deferred.append(number)
        return
    # Half-initialised libraries, such as numba, would print errors during the interpreter's
    # shutdown.
    sys.unraisablehook = lambda _: None
    raise Ended(number)


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Let nothing end this program within the block, but as soon as it is over."""
    global _deferring
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    # Python's own handler of SIGINT, where no tool has set one, would not wait.
    former = _set_handler([signal.SIGINT])
    _deferring += 1
    try:
        yield
    finally:
        _deferring -= 1
        for number, handler in former.items():
            signal.signal(number, handler)   # type: ignore[arg-type]
    if _deferred and not _deferring:
        number = _deferred[0]
        _deferred.clear()
        raise Ended(number)
