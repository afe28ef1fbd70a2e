# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Lets nothing that a program prints or logs wait for a reader, a terminal or a disk.

A log line of ROS 2 is written by compiled code that holds Python's interpreter lock: where standard
error is a pipe that nobody reads, such as that of a ``| less`` at its first page, one line would
stop every thread of a node, its watchdog included. The same holds for its log file.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import select
import sys
import threading
import time

from rclpy.logging import get_logging_directory

# Bytes that a pipe takes as a whole, less the words below; s to wait until the reader takes them.
_PIECE, _PATIENCE = select.PIPE_BUF - 100, 0.1
# s in which a program that ends waits for what it has printed.
_FAREWELL = 0.5


@contextmanager
def dropping_output(name: str) -> Iterator[None]:
    """Drop what standard output and error do not take at once, whoever prints it, in the block.

    Both become pipes that never block, and a thread forwards what comes through them. It also
    writes the log file of ROS 2, of the program's `name`.
    """
    targets = {}
    for end in (1, 2):
        reader, writer = os.pipe()
        os.set_blocking(writer, False)
        targets[reader] = os.dup(end)
        os.dup2(writer, end)
        os.close(writer)
    if os.isatty(targets[max(targets)]):
        # ROS 2 would see a pipe.
        os.environ.setdefault('RCUTILS_COLORIZED_OUTPUT', '1')
    thread = threading.Thread(
        target=_forward, args=(dict(targets), name), name='output', daemon=True)
    thread.start()
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for end in (1, 2):
            # The thread then finds the end of its pipes.
            os.dup2(nowhere, end)
        os.close(nowhere)
        thread.join(_FAREWELL)
        if not thread.is_alive():
            for end, (reader, target) in zip((1, 2), targets.items()):
                os.dup2(target, end)
                os.close(target)
                os.close(reader)


def _forward(targets: dict[int, int], name: str) -> None:
    dropped = dict.fromkeys(targets, 0)
    log = -1
    with suppress(OSError):
        folder = Path(get_logging_directory())
        folder.mkdir(parents=True, exist_ok=True)
        log = os.open(folder / f'{name}_{os.getpid()}_{time.time_ns() // 1_000_000}.log',
                      os.O_WRONLY | os.O_CREAT, 0o644)
    while targets:
        for reader in select.select(list(targets), [], [])[0]:
            piece = os.read(reader, _PIECE)
            if not piece:
                del targets[reader]
                continue
            target = targets[reader]
            with suppress(OSError):
                os.write(log, piece)
            if not select.select([], [target], [], _PATIENCE)[1]:
                dropped[reader] += len(piece)
                continue
            if dropped[reader]:
                piece = b'(%d bytes were dropped, which nobody read)\n' % dropped[reader] + piece
                dropped[reader] = 0
            # Its reader may be gone.
            with suppress(OSError):
                os.write(target, piece)
