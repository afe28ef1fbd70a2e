# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How tests are dealt to several processes, where pytest-xdist is there to do so."""

import signal

import pytest

from friction_comp.package_files import name_this_environment

# The files that take longest begin, in the order of their longest single test or of what is made
# once for them, so that the short ones fill what is left in the end: one process would otherwise
# wait for the other. A file that is not here, or no longer so long, costs that wait and no more
# (`make test TESTS=--durations=40` tells). Each process that runs tests has a ROS domain of its own
# (ros_system), so nodes of several tests do not meet.
LONGEST = ('test_demo', 'test_whole_arm', 'test_reproduce', 'test_packaging', 'test_node_',
           'test_refinement_', 'test_many_recordings', 'test_identification', 'test_refine',
           'test_code_blocks', 'test_arm', 'test_evaluate_sessions', 'test_independent_gear',
           'test_sigmoid_fit', 'test_compiled_effects', 'test_presliding')


# As `python3 -m friction_comp` does for nodes: some tests import ROS 2 by themselves.
name_this_environment()
# A shell's background jobs, and what they start, ignore interrupts: tools that tests interrupt
# would never end.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def shared_in_its_file(item):
    """Tell whether a test uses something that is made once for its file."""
    made = item._fixtureinfo.name2fixturedefs.values()
    return any(one.scope == 'module' for several in made for one in several)


# Before xdist looks for the groups.
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Keep the tests that share something in one process; the others go where there is room."""
    for item in items:
        if shared_in_its_file(item):
            item.add_marker(pytest.mark.xdist_group(item.path.stem))

    def late(item):
        place = next((k for k, name in enumerate(LONGEST) if item.path.stem.startswith(name)),
                     len(LONGEST))
        return place, item.get_closest_marker('slow') is None
    items.sort(key=late)
