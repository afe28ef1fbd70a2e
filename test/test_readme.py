# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The commands, links and figures of the README are valid."""

import importlib.util
import json
import re
from xml.dom import minidom

from doc_pages import commands, ROOT
import pytest

from friction_comp import __version__
from friction_comp.__main__ import NODES, TOOLS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.simulation.undeclared import Undeclared

README = (ROOT / 'README.md').read_text(encoding='utf-8')
COMMANDS = [line for line, _ in commands([ROOT / 'README.md', *(
    ROOT / 'docs' / f'{name}.md' for name in ('nodes', 'tools'))])]


def started(line):
    found = re.search(r'(?:-m|ros2 run) friction_comp (\w+)', line)
    return found and found[1]


def test_every_node_and_tool_has_a_line_to_run_it():
    names = {started(line) for line in COMMANDS} - {None}
    assert names == set(NODES) | set(TOOLS)


def test_lines_are_in_the_order_in_which_they_run():
    """What a line reads is there or made by a line above it, its joints are those of the plant."""
    made, joints = set(), []
    for line in COMMANDS:
        for path in re.findall(r'(?:examples|config|output)/[\w./]+', line):
            assert (ROOT / path).exists() or f'--output {path}' in line or any(
                path.startswith(folder) for folder in made), line
        made.update(re.findall(r'--output (\S+)', line))
        named = re.search(r"joints:=\"\['(.*?)'\]\"", line)
        if named and started(line) == 'plant':
            joints = named[1].split("', '")
        elif named:
            assert set(named[1].split("', '")) <= set(joints), line
        for path in re.findall(r"'(config/\w+\.yaml)'", line):
            # Otherwise the first message of the compensator is a warning.
            assert FrictionModel.load(ROOT / path).joint == ''


def test_files_that_are_linked_or_read_are_there():
    for target in re.findall(r'\]\((?!http)([^)#]+)\)', README):
        assert (ROOT / target).exists(), target
    for option, path in re.findall(r'(\S+) (config/\w+\.yaml)', README):
        if option == '--undeclared':
            Undeclared.from_file(ROOT / path)
        else:
            FrictionModel.load(ROOT / path)


@pytest.mark.parametrize('name', ['demo', 'reproduce'])
def test_quoted_tables_are_what_is_stored_of_their_command(name):
    spec = importlib.util.spec_from_file_location(
        'quote_figures', ROOT / 'docs' / 'quote_figures.py')
    quote = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(quote)
    numbers = json.loads((ROOT / 'docs' / 'figures' / f'{name}.json').read_text(encoding='utf-8'))
    text = quote.PAGES[name].read_text(encoding='utf-8')
    assert quote.quoted(text, name) == quote.KINDS[name][1](numbers)
    # The command stands beside the table.
    assert f'`{numbers["command"]}' in text.partition(f'<!-- {name} -->')[0][-700:]
    if name == 'demo':
        assert f'<desc>{quote.demo_words(numbers)}</desc>' in quote.PICTURE.read_text(
            encoding='utf-8')


@pytest.mark.parametrize('name', ['loop', 'demo'])
def test_the_pictures_are_sound(name):
    document = minidom.parse(str(ROOT / 'docs' / f'{name}.svg'))
    assert document.getElementsByTagName('title')
    assert document.getElementsByTagName('desc')


@pytest.mark.parametrize(('number', 'plateau', 'breakaway'), [(2, 0.16, 0.138), (3, 0.36, 0.336)])
def test_plateaus_are_near_breakaway_since_two_rows_of_the_note_are_swapped(
        number, plateau, breakaway):
    model = FrictionModel.load(ROOT / 'config' / f'armin_configuration_{number}.yaml')
    assert model.sigmoid.upper == pytest.approx(plateau, abs=0.006)
    assert model.breakaway.positive_mean == pytest.approx(breakaway, abs=5e-4)
    assert abs(model.sigmoid.upper / breakaway - 1.0) < 0.2


def test_changelog_has_this_version():
    text = (ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8')
    assert re.search(rf'^{re.escape(__version__)} \(\d{{4}}-\d\d-\d\d\)\n-+$', text, re.MULTILINE)
