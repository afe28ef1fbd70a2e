# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The code keeps the rules of docs/architecture.md, and the page agrees with the code."""

import ast
from collections import defaultdict
import functools
from graphlib import TopologicalSorter
import re

from helpers import ROOT

PACKAGE = ROOT / 'friction_comp'
PAGE = (ROOT / 'docs' / 'architecture.md').read_text(encoding='utf-8')
MODULES = sorted(PACKAGE.rglob('*.py'))
# The package's __init__ and __main__ may import everything.
DOORS = ('__init__.py', '__main__.py')


def declared():
    """Return what each room may import, in the order of the page's table."""
    table = {}
    for room, imports in re.findall(r'^\| (\w+) \|[^|]*\| ?([\w, ]*)\|$', PAGE, re.MULTILINE):
        if room != 'room':
            table[room] = {name.strip() for name in imports.split(',') if name.strip()}
    return table


def room_of(path):
    parts = path.relative_to(PACKAGE).parts
    return parts[0] if len(parts) > 1 else 'ground'


@functools.cache
def imports_of(path):
    """Return the statements of a file that import: for its types, and inside functions, too."""
    return [node for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
            if isinstance(node, (ast.Import, ast.ImportFrom))]


def imported_modules(path):
    """Give the package's modules that a file imports."""
    for node in imports_of(path):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif node.module == 'friction_comp':
            names = [f'friction_comp.{alias.name}' for alias in node.names]
        else:
            names = [node.module or '']
        yield from (name for name in names if name.startswith('friction_comp.'))


def arrows():
    """Return the imports from room to room, each with the files that make it."""
    found = defaultdict(set)
    for path in MODULES:
        if path.parent == PACKAGE and path.name in DOORS:
            continue
        for module in imported_modules(path):
            target = module.split('.')[1]
            if target == '__version__':
                continue
            room = target if (PACKAGE / target).is_dir() else 'ground'
            if room != room_of(path):
                found[room_of(path), room].add(str(path.relative_to(PACKAGE)))
    return found


def test_every_room_is_in_the_table():
    rooms = {path.parent.name for path in PACKAGE.glob('*/__init__.py')}
    assert set(declared()) == rooms | {'ground'}


def test_rooms_import_what_the_table_allows():
    table = declared()
    made = arrows()
    strays = {f'{a} -> {b}': sorted(files) for (a, b), files in made.items() if b not in table[a]}
    assert strays == {}


def test_each_room_imports_only_rooms_listed_before_it():
    above = []
    for room, names in declared().items():
        assert names <= set(above), room
        above.append(room)
    apart = {'identification', 'compensation', 'refinement', 'recordings'}
    assert all(not declared()[room] & apart for room in apart), 'procedures know each other'


def test_there_are_no_circular_imports():
    def name_of(path):
        return '.'.join(('friction_comp', *path.relative_to(PACKAGE).with_suffix('').parts))

    # __init__ and __main__ only forward what other modules define.
    files = {name_of(path): path for path in MODULES if path.name != '__init__.py'}
    TopologicalSorter({
        name: set(imported_modules(path)) & set(files) - {name}
        for name, path in files.items()}).prepare()


def test_only_nodes_and_ros_import_ros_2():
    def packages(path):
        for node in imports_of(path):
            named = [node.module or ''] if isinstance(node, ast.ImportFrom) else [
                alias.name for alias in node.names]
            yield from (name.split('.')[0] for name in named)

    ros = re.compile(r'rclpy|ament_\w+|launch\w*|rosidl_\w+|\w+_(msgs|srvs|interfaces)')
    assert [str(path) for path in MODULES if room_of(path) not in ('nodes', 'ros')
            and any(map(ros.fullmatch, packages(path)))] == []


def test_what_runs_without_pytest_imports_nothing_from_the_tests():
    """Benchmarks start without pytest, which would put test/ on the path."""
    tests = {path.stem for path in (ROOT / 'test').glob('*.py')}
    for path in [*(ROOT / 'harness').rglob('*.py'), *(ROOT / 'bench').rglob('*.py')]:
        names = {node.module for node in imports_of(path) if isinstance(node, ast.ImportFrom)} | {
            alias.name for node in imports_of(path) for alias in node.names}
        assert not names & tests, path
