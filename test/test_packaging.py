# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The package under pip, colcon and `ros2 run`: what it offers and loads, and its files' rules."""

import ast
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

from helpers import printed_by, ROOT
import pytest

import friction_comp
from friction_comp import __main__ as entry
from friction_comp.errors import InputError

NAMES = {**entry.NODES, **entry.TOOLS}
MODULES = sorted((ROOT / 'friction_comp').rglob('*.py'))
LAUNCH_FILES = sorted((ROOT / 'launch').glob('*.launch.py'))
INTERFACES = 'friction_comp_interfaces'
# What takes long to import.
SLOW = ('numba', 'scipy', 'matplotlib', 'rosbags', 'rclpy', 'rich')
# Where rosdep's key is not `python3-` and the name: the others come with the package named.
ROSDEP_KEYS = {
    'ament_index_python': 'ament_index_python', 'cycler': 'python3-matplotlib',
    'markdown_it': 'python3-rich', 'mcap': 'mcap-ros2-support',
    'rosbags': 'python3-rosbags-pip', 'zstandard': 'mcap-ros2-support'}
# Extras for pip, dependencies of the tests for rosdep.
OPTIONAL = {'pinocchio', 'pyarrow', 'h5py', 'mujoco', 'distributed'}


def imported(path):
    """Names of the top-level packages that a file imports anywhere."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            names.update(alias.name.partition('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names.add(node.module.partition('.')[0])
    return names


def tracked_files():
    listing = subprocess.run(
        ['git', 'ls-files', '-z'], cwd=ROOT, capture_output=True, text=True, check=False)
    if listing.returncode:
        pytest.skip('not a git checkout')
    return [ROOT / name for name in listing.stdout.split('\0') if name]


def test_the_version_is_the_same_everywhere():
    versions = {
        ElementTree.parse(ROOT / folder / 'package.xml').findtext('version')
        for folder in ('.', INTERFACES)}
    setup = subprocess.run(
        [sys.executable, 'setup.py', '--version'], cwd=ROOT, capture_output=True, text=True,
        check=True)
    assert versions == {friction_comp.__version__}
    assert setup.stdout.split()[-1] == friction_comp.__version__


def test_package_xml_names_what_the_modules_import():
    manifest = ElementTree.parse(ROOT / 'package.xml').getroot()
    declared = {e.text for e in manifest if e.tag in ('depend', 'exec_depend')}
    needed = set().union(*map(imported, MODULES + LAUNCH_FILES)) - {
        'friction_comp', INTERFACES, *OPTIONAL, *sys.stdlib_module_names}
    # Those of ROS have keys of their own.
    missing = {name for name in needed if not declared & {
        ROSDEP_KEYS.get(name, f'python3-{name}'), name}}
    assert missing == set()


def test_files_have_a_licence_a_readable_length_and_no_place_on_one_machine():
    places = '|'.join(['home', 'root', 'work', 'tmp', 'farm'])
    pattern = re.compile(rf'(?:^|[^\w./}}])/(?:{places})/[A-Za-z.]', re.MULTILINE)
    for path in tracked_files():
        if path.suffix in ('.png', '.mcap') or not path.is_file():
            continue
        text = path.read_text(encoding='utf-8', errors='replace')
        assert not pattern.search(text), path
        if path.suffix == '.py':
            assert 'SPDX-License-Identifier: Apache-2.0' in text[:200], path
            assert text.count('\n') <= 800, path


def test_without_a_known_name_the_usage_is_shown(capsys):
    assert entry.main([]) == 2
    assert entry.main(['nonsense']) == 2
    shown = capsys.readouterr()
    assert shown.out == ''
    assert "'nonsense'" in shown.err
    assert all(name in shown.err for name in NAMES)


@pytest.mark.parametrize(('ending', 'code', 'said'), [
    (lambda argv: None, 0, ''),
    (lambda argv: len(argv), 1, ''),
    (InputError('model.yaml:\n no coefficients'), 2, 'predict: model.yaml: no coefficients\n'),
    (KeyboardInterrupt(), 130, ''),
])
def test_exit_codes_of_tools(monkeypatch, capsys, ending, code, said):
    def main(argv):
        if isinstance(ending, BaseException):
            raise ending
        return ending(argv)

    monkeypatch.setattr(entry, 'tool', lambda name: main)
    assert entry.main(['predict', 'argument']) == code
    monkeypatch.setattr(sys, 'argv', ['predict', 'argument'])
    assert entry.predict() == code
    assert capsys.readouterr().err == 2 * said


@pytest.mark.parametrize(('system', 'compiler', 'reason'), [
    ('linux', 'c++', ''), ('linux', None, 'no C++ compiler'), ('darwin', 'c++', 'Linux')])
def test_without_what_nodes_need_pip_installs_the_tools_alone(
        monkeypatch, system, compiler, reason):
    monkeypatch.syspath_prepend(ROOT / 'build_tools')
    import interfaces as build_tools

    monkeypatch.delenv('ROS_DISTRO', raising=False)
    monkeypatch.setattr(sys, 'platform', system)
    monkeypatch.setattr(build_tools.platform, 'machine', lambda: 'x86_64')
    monkeypatch.setattr(build_tools.shutil, 'which', lambda *_, **__: compiler)
    assert reason in build_tools.why_left_out()
    # What is left is plain Python, for any machine.
    distribution = build_tools.WithInterfaces()
    assert distribution.has_ext_modules() == (not reason)
    assert bool(build_tools.requirements()) == (not reason)
    steps = build_tools.Build(distribution).get_sub_commands()
    assert ('build_interfaces' in steps) == (not reason)
    # Where ROS 2 is sourced, nodes are wanted: what is missing is an error of the build.
    monkeypatch.setenv('ROS_DISTRO', 'jazzy')
    assert build_tools.why_left_out() == ''


@pytest.fixture(scope='module')
def workspace(tmp_path_factory):
    """A folder in which a copy of the package was built with a plain `colcon build`."""
    beside = Path(sys.executable).parent / 'colcon'
    colcon = str(beside) if beside.exists() else shutil.which('colcon')
    if colcon is None:
        pytest.skip('colcon is not installed (requirements/test.txt)')
    folder = tmp_path_factory.mktemp('workspace')
    left_out = shutil.ignore_patterns('.*', 'build', 'install', 'log', '__pycache__', '*.egg-info')
    shutil.copytree(ROOT, folder / 'src' / 'friction_comp', ignore=left_out)
    # Compiling the interfaces takes a minute: those of this environment serve, unless they are old.
    compiled = ROOT / 'build' / INTERFACES
    if compiled.is_dir():
        shutil.copytree(compiled, folder / 'build' / 'friction_comp' / 'build' / INTERFACES)
    built = subprocess.run(
        [colcon, 'build'], cwd=folder, env=environment() | {'CFLAGS': '-O0', 'CXXFLAGS': '-O0'},
        capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    return folder


def environment():
    """The environment of these tests, without what would let the source tree be found."""
    kept = {key: value for key, value in os.environ.items() if key != 'PYTHONPATH'}
    if 'ROS_DISTRO' in os.environ and 'PYTHONPATH' in os.environ:
        kept['PYTHONPATH'] = os.pathsep.join(
            p for p in os.environ['PYTHONPATH'].split(os.pathsep) if Path(p).resolve() != ROOT)
    kept['PATH'] = os.pathsep.join([str(Path(sys.executable).parent), kept.get('PATH', '')])
    return kept


def sourced(workspace, command):
    """Run a shell command in the sourced workspace and return what it prints."""
    done = subprocess.run(
        ['bash', '-c', f'. install/setup.bash && {command}'], cwd=workspace, env=environment(),
        capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_colcon_installs_executables_files_and_the_action(workspace):
    install = workspace / 'install' / 'friction_comp'
    folder, share = install / 'lib' / 'friction_comp', install / 'share'
    assert {path.name for path in folder.iterdir()} == set(NAMES)
    assert '--model' in sourced(workspace, f'{folder / "predict"} --help')
    for name in ('friction_comp', INTERFACES):
        assert (share / 'ament_index' / 'resource_index' / 'packages' / name).is_file()
    for kind, ending in (('launch', '.launch.py'), ('config', '.yaml'), ('msg_docs', '.md')):
        here = {path.name for path in (ROOT / kind).glob('*' + ending)}
        assert here <= {path.name for path in (share / 'friction_comp' / kind).iterdir()}
    files = sourced(
        workspace, f'{sys.executable} -c "import friction_comp, {INTERFACES}.action as i;'
        ' g = i.IdentifyFriction.Goal(speeds=[0.5]); assert g.speeds[0] == 0.5;'
        f' import {INTERFACES}; print(friction_comp.__file__); print({INTERFACES}.__file__)"')
    assert all(install in Path(name).parents for name in files.split())


def test_every_public_name_is_what_it_says():
    for name in friction_comp.__all__:
        assert getattr(friction_comp, name).__name__ == name
    with pytest.raises(AttributeError, match='nonsense'):
        _ = friction_comp.nonsense
    with pytest.raises(ImportError):
        exec('from friction_comp import nonsense')


def test_import_help_and_mistakes_load_nothing_slow():
    """Nor does the import load NumPy: the command line sets the number of its threads first."""
    first, second = printed_by(f"""
import contextlib, io, sys
from friction_comp.__main__ import main
print(*sys.modules)
for name in {[*NAMES]}:
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown), contextlib.suppress(SystemExit):
        main([name, '--help'])
    assert shown.getvalue().startswith('usage: python3 -m friction_comp ' + name), name
    assert '``' not in shown.getvalue(), name
for name in {[*entry.TOOLS]}:
    with contextlib.redirect_stderr(shown), contextlib.suppress(SystemExit):
        main([name, '--no-such-argument'])
print(*sys.modules)
""").splitlines()
    assert not {'numpy', *SLOW} & set(first.split())
    assert not set(SLOW) & set(second.split())


def test_no_model_loads_code_or_modules_while_a_motor_is_driven():
    """What a first call loads would stop the process while the motor keeps its last current."""
    printed = printed_by("""
    import gc, sys
    from dataclasses import replace
    from numba.core.dispatcher import Dispatcher
    from friction_comp.control.model_trial import load_compiled_code, try_model
    load_compiled_code()

    def loaded():
        return {f'{one.__module__}.{one.__name__}{signature}' for one in gc.get_objects()
                if isinstance(one, Dispatcher) for signature in one.signatures} | set(sys.modules)

    before = loaded()
    import numpy as np
    from friction_comp.compensation.law import CompensationLaw
    from friction_comp.model.arm import Arm, Tree
    from friction_comp.model.effects import EFFECTS
    from friction_comp.model.friction_model import FrictionModel
    models = [FrictionModel.load(f'config/armin_configuration_{k}.yaml') for k in (1, 2, 3)]
    for name in ('continuous', 'paper', 'kinetic', 'none'):
        law = CompensationLaw(models, name)
        for k in range(1000):
            position = np.array([1e-3 * k, np.nan if k == 450 else 0.1, 0.3 * (k == 510)])
            law.update(1e-3 * k, position, None if k % 200 > 150 else np.ones(3),
                       np.array([k // 60 % 3 - 1.0, 0.0, 1.0]))
            if k == 500:
                law.retune('paper', 0.5, 1.0)
    effects = [kind({**dict.fromkeys(kind.constants, 2.0),
                     'coefficients': [0.01] * len(kind.units)})
               for kind in EFFECTS.values()]
    try_model(replace(models[0], effects=effects), 'feed_forward', 'all effects')
    links = Tree(('one', 'two'), ('revolute', 'prismatic'), np.array([-1, 0]), [np.eye(3)] * 2,
                 np.zeros((2, 3)), np.eye(3)[:2], np.ones((2, 10)), [0.0, -9.81, 0.0])
    arms = [replace(model, joint=name, arm=Arm(links)) for model, name in zip(models, links.joints)]
    law = CompensationLaw(arms)
    law.update(0.0, [0.1, 0.2], None, 1, temperature=[20.0, np.nan])
    print(len(before), *(loaded() - before))
    """).split()
    assert int(printed[0]) > 100
    assert printed[1:] == []


NODE = """
    import sys
    import rclpy
    from friction_comp.nodes.{name} import {kind}
    from friction_comp.ros import node_main
    rclpy.init(args=['x', '--ros-args', {arguments}])
    node = {kind}()
    print(*(name for name in sys.modules if name.startswith(
        ('matplotlib', *{modules}, *(f'friction_comp.{{room}}' for room in {rooms})))))
    sys.stdout.flush()
    sys.modules['os']._exit(0)
"""
LABORATORY = ('refinement', 'reports', 'evaluation', 'fleet', 'excitation', 'simulation', 'note',
              'demo', 'tools')
JOINT = ("'-p', 'joints:=[elbow]', '-p', "
         "'model_files:=[config/armin_configuration_1.yaml]'")


@pytest.mark.processes
@pytest.mark.parametrize(('name', 'arguments'), [
    ('compensator', JOINT), ('identification', JOINT), ('direction', "'-p', 'joints:=[elbow]'"),
    ('exercise', "'-p', 'joints:=[elbow]'")])
def test_a_node_at_work_has_imported_nothing_of_the_laboratory(name, arguments):
    """The compensator is active; identification has loaded what a goal needs."""
    pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')
    identifies = name == 'identification'
    # Filters of SciPy bring its statistics.
    modules = () if identifies else ('scipy.stats', 'friction_comp.identification')
    assert printed_by(NODE.format(
        name=name, kind=f'{name.capitalize()}Node', arguments=arguments, rooms=LABORATORY,
        modules=modules), ROS_AUTOMATIC_DISCOVERY_RANGE='OFF').split() == []
