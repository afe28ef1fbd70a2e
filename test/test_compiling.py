# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Kernels start as plain Python, agree with compiled ones, and are replaced by them."""

from pathlib import Path
import subprocess
import sys
import textwrap

import pytest

from friction_comp import compiling
from friction_comp.control.watchdog import Watchdog

ROOT = Path(__file__).resolve().parent.parent


def printed_by(code):
    """Run code in a process of its own, in which nothing is compiled yet."""
    done = subprocess.run([sys.executable, '-c', textwrap.dedent(code)], cwd=ROOT, text=True,
                          capture_output=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


LAW = """
    import sys
    from friction_comp import compiling
    compiling.defer_compilation()
    import numpy as np
    from friction_comp.compensation.law import CompensationLaw
    from friction_comp.model.friction_model import FrictionModel

    files = [f'config/armin_configuration_{k}.yaml' for k in (1, 2, 3)]
    models = [FrictionModel.load(path) for path in files]
    draw = np.random.default_rng(5)
    speeds = np.array([1.0, 2.0, 3.0])
    noise = draw.normal(0.0, 1e-4, (3000, 3))
    noise[1500, 1] = np.nan
    noise[1700, 2] = 0.3
    directions = draw.integers(-1, 2, (10, 3)).astype(float)

    def currents(law, begin, end):
        return np.array([law.update(
            1e-3 * k, np.sin(2e-3 * k * speeds) + noise[k], None if k % 700 > 500 else speeds,
            directions[k // 300]) for k in range(begin, end)])
"""


@pytest.mark.slow
def test_replacing_plain_kernels_by_compiled_ones_does_not_change_the_current():
    worst, largest, exchanged, again = map(float, printed_by(LAW + """
    laws = [CompensationLaw(models, name) for name in ('continuous', 'paper', 'kinetic')]
    begun = [currents(law, 0, 1000) for law in laws]
    exchanged = compiling.compile_deferred()
    mixed = [np.concatenate([b, currents(law, 1000, 3000)]) for b, law in zip(begun, laws)]
    compiled = [currents(CompensationLaw(models, name), 0, 3000)
                for name in ('continuous', 'paper', 'kinetic')]
    print(max(np.abs(a - b).max() for a, b in zip(mixed, compiled)), np.abs(compiled).max(),
          exchanged, compiling.compile_deferred())
    """))
    # The last bit of an exponential.
    assert worst < 1e-12
    assert largest > 0.1
    assert exchanged > 1
    assert again == 0


def test_the_law_starts_without_what_takes_long_to_import():
    assert printed_by(LAW + """
    law = CompensationLaw(models)
    currents(law, 0, 5)
    print('numba' in sys.modules, 'scipy' in sys.modules)
    """) == ['False', 'False']


@pytest.mark.slow
def test_a_kernel_that_is_first_called_afterwards_is_compiled_then():
    assert printed_by("""
    from friction_comp import compiling
    compiling.defer_compilation()
    from friction_comp.low_pass import low_pass_weight
    from friction_comp.model.sigmoid import compiled_kinetic_current
    before = low_pass_weight(1e-3, 1e-2)
    compiling.compile_deferred()
    print(before == low_pass_weight(1e-3, 1e-2), compiled_kinetic_current(0.1, 1, -1, 9, 0, 0) > 0,
          len(compiled_kinetic_current.dispatcher.signatures))
    """) == ['True', 'True', '1']


@pytest.mark.slow
def test_compilation_is_not_deferred_once_numba_is_imported():
    assert printed_by("""
    import numba
    from friction_comp import compiling
    compiling.defer_compilation()
    from friction_comp.low_pass import low_pass_weight
    print(type(low_pass_weight).__name__, compiling.compile_deferred())
    """) == ['CPUDispatcher', '0']


@pytest.mark.parametrize('timeout, limit', [(0.05, 0.035), (1.0, 0.98)])
def test_the_watchdog_alarms_earlier_while_its_process_compiles(monkeypatch, timeout, limit):
    now, alarms = [0.0], []
    watchdog = Watchdog(timeout, lambda: alarms.append(now[0]), lambda: now[0])
    watchdog.feed()
    now[0] = limit + 1e-6
    watchdog.check()
    assert not alarms
    monkeypatch.setattr(compiling, '_compiling', True)
    watchdog.check()
    assert alarms == [now[0]]


def test_scipy_can_be_imported_while_numba_is():
    """Numba's import hides a module of scipy, which must not fail another thread's import."""
    code = (
        'import threading, time\n'
        'import friction_comp.compiling as compiling\n'
        'thread = threading.Thread(target=compiling.import_numba)\n'
        'thread.start()\n'
        'while thread.is_alive() and not compiling._hiding.locked():\n'
        '    time.sleep(1e-4)\n'
        'compiling.import_beside("scipy.signal")\n'
        'thread.join()\n'
        'import sys\n'
        'print("numba" in sys.modules, "scipy.linalg.cython_blas" in sys.modules)\n')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert done.stdout.split() == ['True', 'True'], done.stderr
