# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How tests are dealt to several processes, where pytest-xdist is there to do so."""

import pytest

from friction_comp.package_files import name_this_environment

# Tests with nodes follow one another: each drives several processes as it is.
NODES = ('test_demo', 'test_node_', 'test_packaging')


# As `python3 -m friction_comp` does for nodes: some tests import ROS 2 by themselves.
name_this_environment()


# Before xdist looks for the groups.
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Keep the tests of a file, and all with nodes, in one process; nodes begin."""
    def with_nodes(item):
        return item.path.stem.startswith(NODES)
    for item in items:
        group = 'nodes' if with_nodes(item) else item.path.stem
        item.add_marker(pytest.mark.xdist_group(group))
    items.sort(key=lambda item: not with_nodes(item))
