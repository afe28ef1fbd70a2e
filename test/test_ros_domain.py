# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A private ROS domain: it is exclusive, whoever else uses the machine."""

from contextlib import ExitStack
import os
import signal
import socket
import subprocess
import sys

import pytest

from friction_comp.errors import InputError
from friction_comp.tools import ros_domain
from friction_comp.tools.ros_domain import domains_in_use, leased_domain

HOLD = """
import sys
from friction_comp.tools.ros_domain import leased_domain
with leased_domain() as number:
    print(number, flush=True)
    sys.stdin.read()
"""


def test_a_leased_domain_is_exclusive_and_freed_if_its_process_is_killed(monkeypatch):
    monkeypatch.setattr(ros_domain, '_DOMAINS', range(95, 98))
    free = set(ros_domain._DOMAINS) - domains_in_use()
    with ExitStack() as stack:
        def lease():
            held.append(stack.enter_context(leased_domain()))
            return lease()
        held = []
        with pytest.raises(InputError, match='in use'):
            lease()
        assert len(held) == len(set(held)) <= len(free)
    other = subprocess.Popen(
        [sys.executable, '-c', HOLD.replace(
            'with', 'from friction_comp.tools import ros_domain\n'
            'ros_domain._DOMAINS = range(95, 98)\nwith')],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    number = int(other.stdout.readline())
    try:
        assert ros_domain._reserve(number) is None
    finally:
        other.send_signal(signal.SIGKILL)
        other.communicate()
    with ros_domain._reserve(number) as again:
        assert again is not None


@pytest.mark.skipif(not ros_domain._SOCKETS[0].exists(), reason='needs /proc')
def test_a_domain_in_use_without_a_lease_is_found_by_its_sockets():
    # Of the first participant in domain 99, for unicast discovery.
    port = 7400 + 250 * 99 + 10
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(('127.0.0.1', port))
        assert 99 in domains_in_use()
