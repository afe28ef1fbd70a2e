# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The documentation: its commands, links, figures and YAML are valid; each effect has a page.

`make docs` draws its pictures and builds it without a warning.
"""

import json
import re

from doc_pages import commands, ROOT, script
import pytest
import yaml

from friction_comp import __version__
from friction_comp.__main__ import NODES, TOOLS
from friction_comp.model.effects import EFFECTS
from friction_comp.model.effects.definitions import VARIABLES
from friction_comp.model.friction_model import FrictionModel
from friction_comp.simulation.undeclared import Undeclared

DOCS = ROOT / 'docs'


def test_every_effect_has_a_page_that_says_how_to_record_for_it(tmp_path, monkeypatch):
    pages = script('effect_pages')
    monkeypatch.setattr(pages, 'to_svg', lambda _: '')
    assert set(pages.RECORD) == set(VARIABLES)
    pages.write_pages(tmp_path)
    index = (tmp_path / 'index.md').read_text(encoding='utf-8')
    for name, kind in EFFECTS.items():
        page = (tmp_path / f'{name}.md').read_text(encoding='utf-8')
        assert f'[{name}]({name}.md)' in index
        assert kind.variable in page
        assert pages.RECORD[kind.variable] in page
        assert all(f'`{constant}`' in page for constant in kind.constants)
        for picture in re.findall(r'\]\((\w+\.svg)\)', page):
            assert (tmp_path / picture).is_file()
    assert len(list(tmp_path.glob('*.svg'))) > len(EFFECTS) / 2


def test_the_page_on_the_notes_errors_agrees_with_its_numbers():
    module = script('note_figures')
    page = (DOCS / 'note_errors.md').read_text(encoding='utf-8')
    told = re.findall(r'^\| (configuration .+) \|$', page, re.MULTILINE)
    assert told == [' | '.join(cells) for cells in module.tables()]
    for words in module.sentences():
        assert words.split()[0] in page
        assert words.partition(' ')[2] in page


def test_the_yaml_of_the_own_robot_loads():
    text = (DOCS / 'own_robot.md').read_text(encoding='utf-8')
    controllers, model = [yaml.safe_load(block) for block in re.findall(
        r'```yaml\n(.*?)```', text, re.DOTALL)]
    named = controllers['controller_manager']['ros__parameters']
    assert named['current_controller']['type'].startswith('forward_command_controller/')
    assert controllers['current_controller']['ros__parameters']['joints'] == [model['joint']]
    assert FrictionModel.from_dict(model).drive.current_limit == 0.5


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
    # What `make docs` writes is not there for who reads the sources: pages name it as a role.
    written = ROOT / 'docs' / 'effects'
    for folder in ('.', 'docs', 'msg_docs', 'sros2', 'bench'):
        for page in (ROOT / folder).glob('*.md'):
            for target in re.findall(r'\]\((?!http)([^)#\s]+)(?:#[^)]*)?\)', page.read_text()):
                file = (page.parent / target).resolve()
                assert file.exists(), (page.name, target)
                assert written not in file.parents, (page.name, target)
    for option, path in re.findall(r'(\S+) (config/\w+\.yaml)', README):
        if option == '--undeclared':
            Undeclared.from_file(ROOT / path)
        else:
            FrictionModel.load(ROOT / path)


def test_quoted_tables_and_pictures_are_what_is_stored_of_their_command():
    quote = script('quote_figures')
    for name, kind in quote.KINDS.items():
        stored = ROOT / 'docs' / 'figures' / f'{name}.json'
        numbers = json.loads(stored.read_text(encoding='utf-8'))
        for page in kind.pages:
            text = page.read_text(encoding='utf-8')
            assert quote.quoted(text, name) == kind.table(numbers)
            # The command stands beside the table.
            assert f'`{numbers["command"]}' in text.partition(f'<!-- {name} -->')[0][-700:]
        if kind.picture:
            picture = (ROOT / 'docs' / f'{name}.svg').read_text(encoding='utf-8')
            assert f'<desc>{kind.words(numbers)}</desc>' in picture


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
