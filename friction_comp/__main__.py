# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The command line: ``python3 -m friction_comp NAME …`` and ``ros2 run friction_comp NAME …``."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import importlib
import itertools
import os
import re
import sys

from friction_comp import __version__
from friction_comp.errors import InputError, one_line
from friction_comp.files import add_environment_to_ament_path
from friction_comp.interrupts import end_by_exception, Ended, ENDING, STOPPING
from friction_comp.terminal import tolerant_output

NODES = {
    'plant': 'simulates geared joints and the person who moves them',
    'identification': 'measures the friction of a joint (action server)',
    'compensator': 'feeds the friction forward to the motor',
    'exercise': 'publishes the reference movement and its direction',
    'direction': 'announces the direction from a plan, a leader or a cheap sensor',
    'recorder': 'records topics into a rosbag2 folder',
    'refinement': 'warns when a model no longer fits, and refines it (action server)',
}
TOOLS = {
    'demo': 'runs the whole loop on this machine, with a report at the end',
    'reproduce': "repeats the technical note's experiments in simulation",
    'evaluate': 'computes the back-driving torque of recorded movements',
    'refine': 'finds in recordings the effects that a model lacks',
    'doctor': 'checks what is installed and running, and says what to do',
    'convert': 'converts a recording into a CSV table, and back',
    'export': "writes a model's friction for MuJoCo, URDF or SDF, or as a table",
    'excite': 'plans a motion within limits that distinguishes effects (JointTrajectory)',
    'teach': 'makes an exercise of a recorded movement that a person guided',
    'play': 'moves joints along a trajectory, with motor currents',
    'predict': 'writes measured and predicted current of a recording',
}
# Where tools stand that have no module of their own.
_MODULES = {'demo': 'laboratory', 'reproduce': 'laboratory', 'evaluate': 'recordings',
            'convert': 'recordings', 'teach': 'recordings', 'excite': 'motion', 'play': 'motion'}
USAGE = '\n'.join([
    'usage: python3 -m friction_comp [--help] [--version] NAME [ARGUMENT ...]',
    '',
    'nodes (they take ROS arguments after --ros-args):',
    *(f'  {name:<15} {text}' for name, text in NODES.items()),
    '',
    'tools (--help lists the arguments of each):',
    *(f'  {name:<15} {text}' for name, text in TOOLS.items()),
])
NODE_USAGE = """usage: python3 -m friction_comp {name} [--help] [--ros-args ...]

{text}

Parameters, remappings and names are given after --ros-args, for instance
--ros-args -p NAME:=VALUE -r FROM:=TO."""

# Modules of ROS 2: which of them is reported missing depends on the order of imports.
_ROS_MODULE = re.compile(r'rclpy|\w+_(msgs|srvs|interfaces)')


def tool(name: str) -> Callable[[list[str]], int | None]:
    """Return the function of a tool, which takes its arguments."""
    module = importlib.import_module(f'friction_comp.tools.{_MODULES.get(name, name)}')
    return getattr(module, name)


def run(name: str, argv: list[str] | None = None) -> int:
    """Run a node or tool with its arguments, by default those of the process.

    Returns 0 when it did its work, 1 when ROS 2 is missing, 2 when its input cannot be used (one
    line on standard error says why), 128 + N when signal N has ended it.
    """
    argv = sys.argv[1:] if argv is None else argv
    before_ros_args = itertools.takewhile(lambda word: word != '--ros-args', argv)
    if name in NODES and {'-h', '--help'} & set(before_ros_args):
        # Handled here, since importing ROS 2 takes a second.
        print(NODE_USAGE.format(name=name, text=NODES[name]))
        return 0
    # Matrices are small here: threads of linear algebra libraries would mostly wait for each other,
    # and take up to twenty times the processor time if other processes run. Only before numpy is
    # imported, so that nothing above imports it.
    for library in ('OMP', 'OPENBLAS', 'MKL'):
        os.environ.setdefault(f'{library}_NUM_THREADS', '1')
    if name in NODES or name in ('demo', 'doctor', 'play'):
        add_environment_to_ament_path()
    # A motion would go on without a program that is only stopped. Nodes get handlers of their own.
    end_by_exception([*ENDING, *(STOPPING if name in ('play', 'demo') else ())])
    with tolerant_output():
        try:
            # Imported only now, so that tools that do not need ROS 2 run without it.
            if name in TOOLS:
                return tool(name)(argv) or 0
            module = importlib.import_module(f'friction_comp.nodes.{name}')
            from friction_comp.ros import node_main

            return node_main.run(name, getattr(module, f'{name.capitalize()}Node'), argv)
        except InputError as error:
            print(f'{name}: {one_line(error)}', file=sys.stderr)
            return 2
        except ModuleNotFoundError as error:
            missing = (error.name or '').partition('.')[0]
            if not _ROS_MODULE.fullmatch(missing):
                raise
            print(f'{name}: ROS 2 is missing or incomplete: no module {missing}. Source a ROS 2 '
                  'workspace that contains friction_comp, or use the environment that `make setup` '
                  'creates', file=sys.stderr)
            return 1
        except Ended as ended:
            return 128 + ended.number
        except KeyboardInterrupt:
            return 130
    return 141      # 128 + SIGPIPE: its reader was gone before it was done


def main(argv: list[str] | None = None) -> int:
    """Run the node or tool named by the first argument with the others; return the exit code."""
    argv = sys.argv[1:] if argv is None else argv
    first = argv[0] if argv else None
    if first in NODES or first in TOOLS:
        return run(first, argv[1:])
    answers = {'-h': USAGE, '--help': USAGE, '--version': f'friction_comp {__version__}'}
    with tolerant_output():
        if first in answers:
            print(answers[first])
            return 0
        if first is not None:
            print(f'friction_comp: there is no node or tool named {first!r}', file=sys.stderr)
        print(USAGE, file=sys.stderr)
    return 2


def __getattr__(name: str) -> Callable[[], int]:
    """Return the entry point of a node or tool, as setup.py installs it for `ros2 run`."""
    if name in NODES or name in TOOLS:
        return partial(run, name)
    raise AttributeError(name)


if __name__ == '__main__':
    sys.exit(main())
