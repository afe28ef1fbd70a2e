# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reserves a ROS domain that no other process on this machine uses."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import fcntl
import os
from pathlib import Path
import random
import tempfile

from friction_comp.errors import InputError

# Domain IDs that ROS 2 calls safe on all systems: their ports are below the ephemeral ports.
_DOMAINS = range(1, 102)
# DDSI-RTPS 2.2, section 9.6.1.1: port base and domain gain.
_PORT_BASE, _PORT_GAIN = 7400, 250
_SOCKETS = (Path('/proc/net/udp'), Path('/proc/net/udp6'))


@contextmanager
def leased_domain() -> Iterator[int]:
    """Hold a ROS domain that no process uses, and that no other holder gets meanwhile.

    The lock on a file in the temporary folder goes with the process that holds it, however it
    ends; programs that do not ask for one are known by their sockets.

    Yields
    ------
    int
        To be set as ``ROS_DOMAIN_ID``.

    Raises
    ------
    InputError
        If all domains are in use.
    """
    used = domains_in_use()
    numbers = [domain for domain in _DOMAINS if domain not in used]
    # Other participants use small ones by default.
    random.SystemRandom().shuffle(numbers)
    for domain in numbers:
        lock = _lock(domain)
        if lock is not None:
            try:
                yield domain
            finally:
                os.close(lock)
            return
    raise InputError('all ROS domains of this machine are in use')


def domains_in_use() -> set[int]:
    """Return the domains to which UDP ports of this machine are bound."""
    used = set()
    for path in _SOCKETS:
        try:
            lines = path.read_text(encoding='ascii').splitlines()[1:]
        except OSError:
            continue
        for line in lines:
            port = int(line.split()[1].rpartition(':')[2], 16)
            used.add((port - _PORT_BASE) // _PORT_GAIN)
    return used


def _lock(domain: int) -> int | None:
    """Return the descriptor of a domain's lock, None where another holds it."""
    path = Path(tempfile.gettempdir()) / f'ros_domain_{domain}.lock'
    try:
        # In a shared folder, another user's file cannot be opened for creation, but can be locked.
        descriptor = os.open(path, os.O_RDONLY | (0 if path.exists() else os.O_CREAT), 0o644)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor
