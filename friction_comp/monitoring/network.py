# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Checks whether nodes can find each other, and says what to look at if not."""

from __future__ import annotations

import os
import socket

NO_PEER = ('compare ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE and RMW_IMPLEMENTATION of both '
           'sides; UDP multicast must pass the firewall')
"""What to do where a node finds no other."""


def loopback_fault(address: str = '127.0.0.1') -> str:
    """Return why this machine does not reach itself, as ROS 2 needs it; '' where it does."""
    try:
        with (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear,
              socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mouth):
            ear.bind((address, 0))
            mouth.sendto(b'.', ear.getsockname())
    except OSError as error:
        return ('this machine does not reach itself, its loopback interface is down '
                f'({error.strerror or error}): ip link set lo up')
    return ''


def alone(seconds: float) -> str:
    """Return the warning for a node that has found no other for so many s."""
    domain = os.environ.get('ROS_DOMAIN_ID', '0')
    return (f'no other node was found in {seconds:g} s, in ROS domain {domain}: '
            + (loopback_fault() or NO_PEER))
