# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Work for processes, in a module that they import at once."""

import os
import signal
import time

from friction_comp.errors import InputError


def work_that_may_die(number):
    time.sleep(0.2)
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    if number == 3:
        raise InputError(f'{number}: not this one')
    return number ** 2, os.getpid()
