# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Pages of the documentation: their steps work in their order, their figures are generated."""

from dataclasses import replace
import importlib.util
from pathlib import Path
import re
import shlex

from helpers import note_model, ROOT, short_search
import pytest
import yaml

from friction_comp.__main__ import main, NODES
from friction_comp.drive import Drive
from friction_comp.model.effects import EFFECTS
from friction_comp.tools.common import Arguments

DOCS = ROOT / 'docs'
PAGES = sorted(path for folder in ('.', 'docs', 'msg_docs', 'bench')
               for path in (ROOT / folder).glob('*.md'))
# Pages that are followed step by step; of the others, arguments are read.
FOLLOWED = ('README', 'start', 'measure', 'own_robot', 'daily_use', 'excite', 'many_robots')
# What needs ROS 2, a robot or minutes, or what an earlier step may leave nothing to do for.
READ_ONLY = {'play', 'demo', 'reproduce', 'doctor', 'teach', '--scheduler', '--ambiguous'}
DRIVE = replace(note_model(2), joint='elbow')


def blocks(page):
    """Yield language and text of a page's code blocks, also of those within lists."""
    for match in re.finditer(r'^( *)```(\w*)\n(.*?)^\1```', page.read_text(encoding='utf-8'),
                             re.DOTALL | re.MULTILINE):
        yield match[2], '\n'.join(line[len(match[1]):] for line in match[3].splitlines())


def commands(text):
    """Return the commands of a block, each as words."""
    lines = [shlex.split(line, comments=True) for line in text.replace('\\\n', ' ').splitlines()]
    return [words for words in lines if words]


def is_own(words):
    return words[:3] in (['python3', '-m', 'friction_comp'], ['ros2', 'run', 'friction_comp'])


def words_of(page):
    """Return a page's words; the lines of a table are none."""
    return [word for word in page.read_text(encoding='utf-8').split()
            if any(letter.isalnum() for letter in word)]


def test_generated_parts_are_those_of_code_and_stored_figures():
    spec = importlib.util.spec_from_file_location('generate', DOCS / 'generate.py')
    generate = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(generate)
    assert {page.stem for page in generate.pages()} >= {'README', 'tools', 'reports', 'results'}
    for page in generate.pages():
        text = page.read_text(encoding='utf-8')
        assert text == generate.written(text), f'{page.name}: python3 docs/generate.py'


def test_no_page_is_longer_than_2000_words_and_all_together_are_25000():
    counts = {page.name: len(words_of(page)) for page in PAGES}
    assert {name: count for name, count in counts.items() if count > 2000} == {}
    assert sum(counts.values()) <= 25_000


def test_files_that_pages_name_are_there():
    lost = []
    for page in PAGES:
        text = page.read_text(encoding='utf-8')
        lost += [(page.name, name) for name in re.findall(
            r'\]\((?!http)([^)#\s]+)(?:#[^)]*)?\)', text) if not (page.parent / name).exists()]
        # NAME is a placeholder for an addition.
        lost += [(page.name, name) for name in re.findall(
            r'`((?:test|bench|harness|config|docs|launch|friction_comp)/[\w./]+)`', text)
            if 'NAME' not in name and not (ROOT / name).exists()]
    assert lost == []


def parsed(name, arguments):
    """Whether a tool takes the arguments."""
    def only_parse(self, argv=None):
        parse(self, argv)
        raise SystemExit(0)
    parse, Arguments.parse = Arguments.parse, only_parse
    try:
        main([name, *arguments])
    except SystemExit as ending:
        return ending.code == 0
    finally:
        Arguments.parse = parse


def check_node(arguments):
    """The arguments of a node: files are there, parameters are declared."""
    declared = (ROOT / 'config' / 'parameters.yaml').read_text(encoding='utf-8')
    assert arguments[0] == '--ros-args'
    for flag, value in zip(arguments[1::2], arguments[2::2]):
        left, _, right = value.partition(':=')
        if flag == '--params-file':
            assert yaml.safe_load((ROOT / value).read_text(encoding='utf-8'))
        elif flag == '-p':
            assert re.search(rf'\b{left}:', declared), left
            assert yaml.safe_load(right) is not None
        else:
            assert flag == '-r'


def check_other(words):
    """Commands that are not this package's own: what they name of it is there."""
    if words[0] == 'make':
        targets = re.findall(r'^(\w+):', (ROOT / 'Makefile').read_text(), re.MULTILINE)
        assert {word for word in words[1:] if '=' not in word} <= set(targets)
    elif words[0] == 'python3':
        assert (ROOT / words[1]).is_file()
    elif words[:2] == ['ros2', 'action']:
        goal = (ROOT / f'{words[-2]}.action').read_text(encoding='utf-8').partition('---')[0]
        assert set(yaml.safe_load(words[-1])) <= set(
            re.findall(r'^\S+ (\w+)$', goal, re.MULTILINE))
    elif words[:3] == ['ros2', 'param', 'set']:
        assert words[3].strip('/') in NODES


def make_what_is_read(arguments):
    """Write the files that a user has: recordings of the example's drive, and models of it."""
    for word, left in zip(arguments, ['', *arguments]):
        path = Path(word)
        if path.exists() or word.startswith('-') or left not in ('', '--model', *arguments[:1]):
            continue
        if path.suffix == '.yaml':
            DRIVE.save(path)
        elif re.fullmatch(r'[a-z]\w+', word):
            path.mkdir()
            for recording in (ROOT / 'examples' / 'elbow').glob(
                    '*' if word in ('trial', 'sessions', 'fleet') else 'with_d*'):
                (path / recording.name).symlink_to(recording)


def step(words, follow):
    """Do a step of a page, or only read its arguments."""
    if not is_own(words):
        check_other(words)
        return
    name, *arguments = words[3:] or ['--help']
    if name in NODES:
        check_node(arguments)
    elif not follow or READ_ONLY & {name, *arguments}:
        assert parsed(name, arguments)
    else:
        make_what_is_read(arguments)
        assert main([name, *arguments]) == 0


STEPS = [page for page in PAGES if any(language for language, _ in blocks(page))]


@pytest.mark.slow
@pytest.mark.parametrize('page', STEPS, ids=lambda page: page.stem)
def test_the_steps_of_a_page_work_in_its_order(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ('examples', 'config'):
        (tmp_path / name).symlink_to(ROOT / name)
    known = set(EFFECTS)
    try:
        for language, text in blocks(page):
            if language == 'python':
                exec(compile(text, page.name, 'exec'), {'__name__': __name__})
            elif language == 'yaml':
                content = yaml.safe_load(text)
                if 'drive' in content:
                    assert Drive(**content['drive']).current_limit > 0.0
            elif language != 'text':
                assert language == 'sh'
                with short_search():
                    for words in commands(text):
                        step(words, page.stem in FOLLOWED)
    finally:
        for name in set(EFFECTS) - known:
            del EFFECTS[name]
