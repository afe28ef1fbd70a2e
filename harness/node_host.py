# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A process that has imported what nodes need, and forks for each node that a test starts.

Importing takes longer than most tests of nodes. From its `main` on, a node runs as in a separate
interpreter, but reports more often, and only the first of each kind ends as in one.
"""

import atexit
import gc
import importlib
import inspect
import json
import os
import signal
import sys
import threading

from rclpy.type_support import check_for_type_support
from rosbags.typesys import get_typestore, Stores

from friction_comp.__main__ import NODES, run
from friction_comp.nodes import compile_nodes
from friction_comp.ros import node_parts


def load_once():
    """Load what each node would load at its start: code, types of messages, its place for logs."""
    for name in NODES:
        importlib.import_module(f'friction_comp.nodes.{name}')
    kinds = {value for name, module in list(sys.modules.items())
             if name.startswith(('friction_comp.', 'rclpy.')) for value in vars(module).values()
             if hasattr(type(value), '__import_type_support__')}
    for kind in kinds:
        check_for_type_support(kind)
    get_typestore(Stores.ROS2_JAZZY)
    inspect.getframeinfo(inspect.currentframe())


def become(name, arguments, folder, output, environment, period, whole):
    """Turn this process into a node whose output goes to a file.

    It reports on /diagnostics every `period` s. At a `whole` end, the interpreter takes all apart
    that it has imported, which takes longer than many a test.
    """
    node_parts.PERIOD = period
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    for path, mode, ends in ((os.devnull, os.O_RDONLY, (0,)), (output, os.O_WRONLY, (1, 2))):
        opened = os.open(path, mode)
        for end in ends:
            os.dup2(opened, end)
        os.close(opened)
    # Those of the host may be able to do what the new ones cannot, such as to seek.
    sys.stdout, sys.stderr = (open(end, 'w', buffering=1, closefd=False) for end in (1, 2))
    signal.signal(signal.SIGINT, signal.default_int_handler)
    status = run(name, arguments)
    if whole:
        sys.exit(status)
    threading._shutdown()
    atexit._run_exitfuncs()
    gc.collect()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def main():
    # Stop what the test has started.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    compile_nodes()
    load_once()
    gc.freeze()
    print('ready', flush=True)
    known = set()
    for line in sys.stdin:
        request = json.loads(line)
        if isinstance(request, list):
            name, answer = request[0], os.fork()
            if not answer:
                # The first one of each kind.
                become(*request, whole=name in NODES and name not in known)
            known.add(name)
        else:
            # It has ended.
            answer = os.waitstatus_to_exitcode(os.waitpid(request, 0)[1])
        print(json.dumps(answer), flush=True)


if __name__ == '__main__':
    main()
