# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What several benchmarks need. Importing it lets them import the package beside this folder."""

import argparse
from concurrent.futures import ProcessPoolExecutor
import multiprocessing
import os
from pathlib import Path
import sys

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'harness')]


def processes(number, **options):
    """Return a pool of fresh processes, since numba's and BLAS's threads do not survive a fork.

    Each, and this process from now on, uses one thread: the threads of several processes would
    mostly wait for each other.
    """
    for library in ('OMP', 'OPENBLAS', 'MKL'):
        os.environ.setdefault(f'{library}_NUM_THREADS', '1')
    return ProcessPoolExecutor(number, multiprocessing.get_context('spawn'), **options)


def processor_time(pid):
    """Return the processor time that a process has used, s."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def table_parser(doc, **numbers):
    """Return a parser that shows a table's docstring; numbers are options with their defaults."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in numbers.items():
        parser.add_argument(f'--{name.replace("_", "-")}', type=type(default), default=default)
    return parser
