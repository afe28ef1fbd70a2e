# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The documentation: a page for each effect, and YAML that loads.

`make docs` draws its pictures and builds it without a warning.
"""

import importlib.util
from pathlib import Path
import re

import pytest
import yaml

from friction_comp.model.effects import EFFECTS
from friction_comp.model.effects.definitions import VARIABLES
from friction_comp.model.friction_model import FrictionModel

DOCS = Path(__file__).resolve().parent.parent / 'docs'


@pytest.fixture(scope='module')
def pages():
    spec = importlib.util.spec_from_file_location('effect_pages', DOCS / 'effect_pages.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_effect_has_a_page_that_says_how_to_record_for_it(pages, tmp_path, monkeypatch):
    monkeypatch.setattr(pages.Figure, 'savefig', lambda _, path, **__: Path(path).touch())
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
    spec = importlib.util.spec_from_file_location('note_figures', DOCS / 'note_figures.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
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


def test_prose_fits_into_a_window_of_120_columns():
    root = DOCS.parent
    for path in (*root.glob('*.md'), *root.glob('*/*.md')):
        blocks = re.split(r'^ *```.*$', path.read_text(encoding='utf-8'), flags=re.MULTILINE)
        for line in '\n'.join(blocks[::2]).splitlines():
            # Rows of tables and alternative texts of pictures cannot be wrapped.
            assert len(line) <= 120 or re.match(r'\s*(\||!\[)', line), f'{path.name}: {line}'
