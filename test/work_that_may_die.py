# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Work for child processes, in a module that they import quickly."""

import os
import signal
import time

from friction_comp.errors import InputError


def work_that_may_die(item):
    """Return the item and its process; the item that names a file ends its process once."""
    number, marker = item
    time.sleep(0.2)
    if marker is not None and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if number == 3:
        raise InputError(f'{number}: not this one')
    return number, os.getpid()
