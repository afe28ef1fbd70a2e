# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reserves a ROS domain that no other process on this machine uses."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import random
import socket

from friction_comp.errors import InputError

# Domain IDs that ROS 2 calls safe on all systems: their ports are below the ephemeral ports.
_DOMAINS = range(1, 102)
# DDSI-RTPS 2.2, section 9.6.1.1: port base and domain gain.
_PORT_BASE, _PORT_GAIN = 7400, 250
# What tools set for as long as they have a domain of their own.
_OF_DOMAIN = ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'FASTRTPS_DEFAULT_PROFILES_FILE',
              'ROS_LOG_DIR')
_SOCKETS = (Path('/proc/net/udp'), Path('/proc/net/udp6'))


@contextmanager
def leased_domain() -> Iterator[int]:
    """Reserve a ROS domain that no process uses, by a socket of this one; yields its number."""
    free = sorted(set(_DOMAINS) - domains_in_use())
    # Other participants use small ones by default.
    for domain in random.SystemRandom().sample(free, len(free)):
        holder = _reserve(domain)
        if holder is not None:
            with holder:
                yield domain
            return
    raise InputError('all ROS domains of this machine are in use')


def _reserve(domain: int) -> socket.socket | None:
    holder = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        # The fifth port of a domain has no use.
        holder.bind(('127.0.0.1', _PORT_BASE + _PORT_GAIN * domain + 5))
    except OSError:
        holder.close()
        return None
    return holder


@contextmanager
def private_domain() -> Iterator[None]:
    """Use an unused ROS domain in this process and its children, so that no robot is disturbed."""
    before = {name: os.environ.get(name) for name in _OF_DOMAIN}
    with leased_domain() as domain:
        os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
        try:
            yield
        finally:
            # The domain may be another process's from here on.
            for name, value in before.items():
                os.environ.pop(name, None)
                if value is not None:
                    os.environ[name] = value


def domains_in_use() -> set[int]:
    """Return the domains to which UDP ports of this machine are bound."""
    used = set()
    for path in _SOCKETS:
        with suppress(OSError):
            for line in path.read_text(encoding='ascii').splitlines()[1:]:
                port = int(line.split()[1].rpartition(':')[2], 16)
                used.add((port - _PORT_BASE) // _PORT_GAIN)
    return used
