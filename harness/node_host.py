# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the server of forks imports once, for each node that a test starts is forked from it.

Importing takes longer than most tests of nodes. From its `main` on, a node runs as in a separate
interpreter, but reports more often, and is not taken apart at its end.
"""

import atexit
import gc
import importlib
import inspect
import os
import signal
import sys

from rclpy.type_support import check_for_type_support
from rosbags.typesys import get_typestore, Stores

from friction_comp.__main__ import NODES, run
from friction_comp.nodes import compile_nodes
from friction_comp.ros import node_parts


def become(name, arguments, folder, output, environment, period):
    """Turn this process into a node whose output goes to a file.

    It reports on /diagnostics every `period` s.
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
    # Those of the server may be able to do what the new ones cannot, such as to seek.
    sys.stdout, sys.stderr = (open(end, 'w', buffering=1, closefd=False) for end in (1, 2))
    signal.signal(signal.SIGINT, signal.default_int_handler)
    status = run(name, arguments)
    atexit._run_exitfuncs()
    gc.collect()
    sys.exit(status)


# What each node would load at its start: code, types of messages, its place for logs.
for node in NODES:
    importlib.import_module(f'friction_comp.nodes.{node}')
for kind in {value for name, module in list(sys.modules.items())
             if name.startswith(('friction_comp.', 'rclpy.')) for value in vars(module).values()
             if hasattr(type(value), '__import_type_support__')}:
    check_for_type_support(kind)
get_typestore(Stores.ROS2_JAZZY)
inspect.getframeinfo(inspect.currentframe())
compile_nodes()
gc.freeze()
