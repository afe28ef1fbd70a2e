# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Fixtures and settings that all tests share, and the mark of tests that start nodes."""

import gc
from importlib.util import find_spec
import os
from pathlib import Path
import signal

# As `python3 -m friction_comp` does for tools, before the first import of NumPy: threads of linear
# algebra that wait for each other take up to twelve times the processor time here.
os.environ.setdefault('OMP_NUM_THREADS', '1')
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
# A list of fonts of these tests alone: any program whose environment was removed under it may have
# written the user's without Matplotlib's own fonts, and each tool with a figure would then warn.
os.environ['MPLCONFIGDIR'] = str(Path(__file__).parents[1] / 'build' / 'matplotlib')

from hypothesis import HealthCheck, settings
import pytest

from friction_comp.__main__ import run
from friction_comp.files import add_environment_to_ament_path
from friction_comp.reports import figures

# As `python3 -m friction_comp` does for nodes: some tests import ROS 2 by themselves.
add_environment_to_ament_path()
# A shell's background jobs, and what they start, ignore interrupts: tools that tests interrupt
# would never end.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# No test fails because the machine is busy. The same examples are drawn in every run, so that what
# fails here fails everywhere; `pytest --hypothesis-profile search` looks for others.
_SETTINGS = settings(deadline=None, suppress_health_check=[
    HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
settings.register_profile('shared', _SETTINGS, max_examples=20, derandomize=True)
settings.register_profile('search', _SETTINGS, max_examples=500)
settings.load_profile('shared')


# The tests of nodes need ROS 2 and the package's own interfaces.
ROS_2 = all(map(find_spec, ('rclpy', 'friction_comp_interfaces')))
collect_ignore_glob = [] if ROS_2 else ['test_node_*.py']


def pytest_terminal_summary(terminalreporter):
    """Say what was left out."""
    if not ROS_2:
        terminalreporter.write_line('ROS 2 is not in this environment: without test_node_*.py')


def pytest_collection_modifyitems(items):
    """Mark the tests of nodes, which `make check` leaves out, and order the files.

    Long files come first: short ones then fill the remaining time, so that no worker waits for
    another at the end. Among them, those with nodes, which wait for much of their time, are spread
    evenly: side by side they would leave the processor idle. The file that forks comes before all:
    in a process with threads of the middleware a child may wait for a lock that nobody returns.
    """
    long = {'processes': {}, 'slow': {}}
    for item in items:
        if item.path.stem.startswith('test_node_'):
            item.add_marker(pytest.mark.processes)
        for kind, files in long.items():
            if item.get_closest_marker(kind):
                files[item.path] = None
    place = {path: (k + 0.5) / len(files) for files in reversed(long.values())
             for k, path in enumerate(files)}
    items.sort(key=lambda item: item.path.stem != 'test_damaged_files' and place.get(
        item.path, 1.0))


def pytest_collection_finish():
    """Exclude imported objects, half a million, from garbage collection: they stay anyway."""
    gc.freeze()


_DRAWN = {}
_draw = figures.for_page


def drawn_once(figure, linear=False):
    """Draw a figure, or return a cached one with the same axes, which saves a tenth of a second."""
    axes = tuple(words for one in figure.axes for words in (
        one.get_title(loc='left'), one.get_xlabel(), one.get_ylabel()))
    if axes not in _DRAWN or not any(axes) or linear:
        _DRAWN[axes] = _draw(figure, linear)
    return _DRAWN[axes]


@pytest.fixture(scope='session', autouse=True)
def plain_pages():
    """Draw figures once of each kind."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(figures, 'for_page', drawn_once)
        yield


@pytest.fixture
def refuses(capsys, tmp_path):
    """Check that a tool refuses its arguments in one line that has some words, and writes nothing.
    """
    def check(words, tool, *arguments):
        output = tmp_path / 'refused'
        capsys.readouterr()
        assert run(tool, [*map(str, arguments), '--output', str(output)]) == 2
        error = capsys.readouterr().err
        assert words in error
        assert error.count('\n') == 1
        assert not output.exists()
    return check


@pytest.fixture(scope='module')
def shared_compensator(tmp_path_factory):
    """One compensator of two joints for all tests of a module that leave it as they found it."""
    from ros_system import compensator
    with compensator(tmp_path_factory.mktemp('compensator'), [1, 1]) as driver:
        yield driver


@pytest.fixture
def driver(shared_compensator):
    """The shared compensator, freshly activated: without history."""
    shared_compensator.restore()
    return shared_compensator
