# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Work for child processes, in a module that they import quickly, and a tool that uses it."""

import os
import signal
import sys
import threading
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


def refined_where_first(arguments, item):
    """Refine the first recording; never finish with another."""
    if item.piece.path.name != 'day_0':
        threading.Event().wait()
    from friction_comp.tools.refine import _refine_one
    return _refine_one(arguments, item)


if __name__ == '__main__':
    import work_that_may_die

    from friction_comp.__main__ import main
    from friction_comp.tools import refine
    refine._refine_one = work_that_may_die.refined_where_first
    sys.exit(main(sys.argv[1:]))
