# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Every code block of the documentation runs, or is parsed by the program that reads it."""

import json
import re
import shlex

import doc_pages
from doc_pages import PAGES, ROOT
from helpers import note_model
import numpy as np
import pytest
from report_pages import assert_documented, promised
import yaml

from friction_comp.__main__ import main, NODES, TOOLS
from friction_comp.model.effects import EFFECTS
from friction_comp.model.effects.torque_effects import Inertia
from friction_comp.model.friction_model import FrictionModel
from friction_comp.recordings import write_samples
from friction_comp.refinement import refine
from friction_comp.samples import Samples
from friction_comp.statistics import rms
from friction_comp.tools.common import Arguments

# Tools that are run as the page has them; the others take minutes, and their arguments are read.
RUN = ('convert', 'evaluate', 'refine', 'predict')
# But for an arm, which is refined with its URDF in test_whole_arm, for what test_many_recordings
# does with each of many, and in processes, and for the fleet of test_fleet.
READ = {'--urdf', '--each', '--jobs'}
# Options of each tool that were run already: with other files the arguments are read.
TRIED = {name: set() for name in RUN}


def commands():
    """Give every command of the documentation as a parameter of a test."""
    return [pytest.param(line, id=f'{place} {line[:60]}') for line, place in doc_pages.commands()]


def blocks(language):
    return [pytest.param(text, id=place) for text, place in doc_pages.blocks(language)]


def trial(name, direction):
    """Simulate movements to and fro at several speeds; return the model that drives them.

    Configuration 2 moves an inertia, and the recording holds no velocity: whoever predicts has to
    differentiate.
    """
    model = note_model(2)
    model.effects = [Inertia({'coefficients': [0.02]})]
    step, velocity = 8e-3, []
    for speed in (0.3, 0.6, 0.2, 0.9, 0.45, 0.75):
        for sign in (1.0, -1.0):
            ramp = np.arange(0.0, 1.0, step / 0.3)
            velocity += [np.zeros(125), sign * speed * np.concatenate(
                [ramp, np.ones(round(0.8 / speed / step)), ramp[::-1]])]
    velocity = np.concatenate([*velocity, np.zeros(125)])
    random = np.random.default_rng(len(name))
    position = np.cumsum(velocity) * step
    write_samples(name, Samples(
        time=np.arange(len(velocity)) * step, position=position,
        current=(model.sigmoid(velocity) + 0.02 * np.gradient(velocity, step)
                 + 0.003 * random.standard_normal(len(velocity))),
        load=np.sign(velocity) * (0.5 - 0.3 * direction),
        direction=direction * np.sign(velocity), reference_position=position,
        reference_velocity=velocity, joint='elbow'),
        model.drive.torque_constant, model.drive.gear_ratio)
    return model


@pytest.fixture(scope='module')
def workplace(tmp_path_factory):
    """A folder that holds what the commands ask for: README's are there, the others a user's."""
    folder = tmp_path_factory.mktemp('workplace')
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name in ('examples', 'config'):
            (folder / name).symlink_to(ROOT / name)
        model = trial('trial', 1)
        trial('identification_recording', 0)
        for day, direction in (('monday', 0), ('tuesday', 1)):
            trial(f'sessions/{day}', direction)
        model.save('elbow.yaml')
        yield folder


def test_every_block_says_what_it_is_and_is_tried():
    languages = {match for page in PAGES for match in re.findall(
        r'^ *```(\w*)\n.*?^ *```', page.read_text(encoding='utf-8'), re.DOTALL | re.MULTILINE)}
    assert languages <= {'sh', 'python', 'yaml'}


def check_other(words):
    """Commands that are not this package's own: what they name of it is there."""
    if words[0] == 'make':
        targets = re.findall(r'^(\w+):', (ROOT / 'Makefile').read_text(), re.MULTILINE)
        assert {word for word in words[1:] if '=' not in word} <= set(targets)
    elif words[0] == 'python3':
        script = (ROOT / words[1]).read_text(encoding='utf-8')
        for option in (word for word in words if word.startswith('--')):
            # `table_parser` takes numbers by name.
            assert f"'{option}'" in script or f'{option[2:]}=' in script
    elif words[:2] == ['ros2', 'action']:
        action = ROOT / f'{words[-2]}.action'
        goal = action.read_text(encoding='utf-8').partition('---')[0]
        fields = re.findall(r'^\S+ (\w+)$', goal, re.MULTILINE)
        assert set(yaml.safe_load(words[-1])) <= set(fields)
    elif words[:3] == ['ros2', 'param', 'set']:
        assert words[3].strip('/') in NODES
        assert yaml.safe_load(words[5])
    else:
        assert words[0] in ('ros2', 'git', 'pip', 'pre-commit', '.', 'export', 'cd', 'dask'), words


def check_node(arguments):
    assert arguments[0] == '--ros-args'
    sources = ''.join(path.read_text(encoding='utf-8') for path in (
        ROOT / 'friction_comp' / 'nodes').glob('*.py'))
    for flag, value in zip(arguments[1::2], arguments[2::2]):
        if flag == '--params-file':
            assert yaml.safe_load((ROOT / value).read_text(encoding='utf-8'))
            continue
        left, right = value.split(':=')
        assert left
        if flag == '-p':
            assert re.search(rf"declare\w*\(\s*(?:self|node), '{left}'", sources) or (
                left == 'joints' and 'declare_joints' in sources), left
            assert yaml.safe_load(right) is not None
        else:
            assert flag == '-r'


@pytest.mark.parametrize('page', PAGES, ids=lambda path: path.name)
def test_files_that_a_page_names_are_there(page):
    named = re.findall(r'`((?:test|bench|harness|config|docs|launch|friction_comp)/[\w./]+)`',
                       page.read_text(encoding='utf-8'))
    # NAME is a placeholder for an addition.
    assert [name for name in named if 'NAME' not in name and not (ROOT / name).exists()] == []


@pytest.mark.slow
@pytest.mark.parametrize('command', commands())
def test_commands(command, workplace, monkeypatch):
    words = shlex.split(command, comments=True)
    if words[:3] not in (['python3', '-m', 'friction_comp'], ['ros2', 'run', 'friction_comp']):
        check_other(words)
        return
    name, *arguments = words[3:]
    if name in NODES:
        check_node(arguments)
        return
    assert name in TOOLS
    if name in RUN and not READ & set(arguments):
        options = {word for word in arguments if word.startswith('--')}
        output = arguments[arguments.index('--output') + 1]
        # What is converted is read by the commands that follow.
        if options - TRIED[name] or name == 'convert':
            TRIED[name] |= options
            write_what_is_read(workplace, arguments, output)
            assert main([name, *arguments]) == 0
            assert (workplace / output).exists()
            return
        # The same with other files, which are there.
        write_what_is_read(workplace, arguments, output)
        files = {word for word in arguments if not (word.startswith('--') or word.isdigit())}
        assert [word for word in files - {output} if not (workplace / word).exists()] == []
    parse = Arguments.parse

    def parse_only(self, argv=None):
        raise SystemExit(0 if parse(self, argv) else 1)
    monkeypatch.setattr(Arguments, 'parse', parse_only)
    with pytest.raises(SystemExit, match='0'):
        main([name, *arguments])


def write_what_is_read(workplace, arguments, output):
    """Run the commands of the documentation that write what one reads, where it is not there."""
    for line, _ in doc_pages.commands():
        words = shlex.split(line, comments=True)
        if '--output' not in words or words[:3] != ['python3', '-m', 'friction_comp']:
            continue
        written = words[words.index('--output') + 1]
        if written != output and not (workplace / written).exists() and any(
                word == written or word.startswith(written + '/') for word in arguments):
            write_what_is_read(workplace, words[3:], written)
            assert main(words[3:]) == 0


def report_of(workplace, start):
    """Return what README's first line that starts so has written; run it where it has not."""
    line = next(line for line, _ in doc_pages.commands() if line.startswith(
        f'python3 -m friction_comp {start}'))
    words = shlex.split(line)
    folder = workplace / words[words.index('--output') + 1]
    if not folder.exists():
        assert main(words[3:]) == 0
    return json.loads((folder / 'report.json').read_text(encoding='utf-8'))


@pytest.mark.slow
def test_the_examples_show_what_the_tools_are_for(workplace):
    evaluated = report_of(workplace, 'evaluate examples')
    assert_documented(evaluated, 'evaluate')
    for condition in evaluated['conditions']:
        assert not set(condition) - promised('evaluate')
        assert condition['stuck'] == 0
    assert evaluated['peak_reduction'] > 0.5
    refined = report_of(workplace, 'refine examples')
    assert_documented(refined, 'refine')
    effects = {effect['name']: effect for effect in refined['effects']}
    hidden, = (effect for effect in yaml.safe_load(
        (ROOT / 'config' / 'undeclared_example.yaml').read_text(encoding='utf-8'))['effects']
        if effect['name'] == 'friction_ripple')
    # Over 40 degrees, gravity acts like a spring.
    assert {'gravity', 'spring'} & set(effects)
    assert 'inertia' in effects
    assert 'load_torque' not in effects
    assert refined['after']['held_out_rmse'] < 1.2 * refined['noise_floor']
    assert refined['before']['model'].startswith('the given model')
    model = FrictionModel.load(workplace / 'output' / 'refined' / 'model.yaml')
    assert model.drive == note_model(2).drive
    assert effects['friction_ripple']['parameters']['frequency'] == pytest.approx(
        hidden['parameters']['frequency'], rel=0.02)


def finds(kind):
    """Refinement finds an effect of the documentation where the current holds it."""
    time = np.arange(0.0, 60.0, 0.01)
    position = 0.5 * np.sin(0.9 * time) + 0.3 * np.sin(2.3 * time + 1.0)
    velocity = 0.45 * np.cos(0.9 * time) + 0.69 * np.cos(2.3 * time + 1.0)
    samples = Samples(time=time, position=position, velocity=velocity, current=position)
    extra = kind({'width': 0.2, 'coefficients': [0.004]}).current(samples)
    noise = 0.002 * np.random.default_rng(3).standard_normal(time.size)
    result = refine([samples.with_(
        current=0.1 * np.tanh(velocity / 0.02) + 0.05 * velocity + extra + noise)])
    assert result.report.effects[0].name == kind.name


@pytest.mark.parametrize('text', blocks('yaml'))
def test_yaml(text):
    assert yaml.safe_load(text)


@pytest.mark.slow
@pytest.mark.parametrize('text', blocks('python'))
def test_python(text, workplace):
    if 'output/refined' in text:
        report_of(workplace, 'refine examples')
    known = set(EFFECTS)
    names = {'__name__': __name__}
    try:
        exec(compile(text, 'the documentation', 'exec'), names)
        for name in set(EFFECTS) - known:
            finds(EFFECTS[name])
    finally:
        for name in set(EFFECTS) - known:
            del EFFECTS[name]
    if 'residual' in names:
        # As refine reports it, and as the page says.
        error = rms(names['residual'])
        assert error < 1.3 * report_of(workplace, 'refine examples')['after']['held_out_rmse']
        told = re.search(r'here\s+([\d.]+) mA', (ROOT / 'docs' / 'tools.md').read_text(
            encoding='utf-8'))[1]
        assert 1e3 * error == pytest.approx(float(told), abs=0.3)
