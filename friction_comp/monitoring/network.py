# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Checks whether nodes can discover each other."""

from __future__ import annotations

import socket

NO_PEER = ('compare ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE and RMW_IMPLEMENTATION of both '
           'sides; UDP multicast must pass the firewall')
"""Advice for a node that finds no other."""


def loopback_fault(address: str = '127.0.0.1') -> str:
    """Return why the loopback interface, which ROS 2 needs, does not work; '' if it works."""
    try:
        with (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
              socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender):
            receiver.bind((address, 0))
            sender.sendto(b'.', receiver.getsockname())
    except OSError as error:
        return ('this machine does not reach itself, its loopback interface is down '
                f'({error.strerror or error}): ip link set lo up')
    return ''
