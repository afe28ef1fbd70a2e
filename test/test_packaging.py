# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The package under pip, colcon and `ros2 run`, and the rules for its files."""

import ast
import functools
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from types import ModuleType
from xml.etree import ElementTree

from helpers import ROOT
import pytest
import yaml

import friction_comp
from friction_comp import __main__ as entry
from friction_comp.errors import InputError
from friction_comp.package_files import add_environment_to_ament_path, package_file
from friction_comp.ros.parameters import check_arguments

NAMES = {**entry.NODES, **entry.TOOLS}
MODULES = sorted((ROOT / 'friction_comp').rglob('*.py'))
LAUNCH_FILES = sorted((ROOT / 'launch').glob('*.launch.py'))
INTERFACES = 'friction_comp_interfaces'
# What rosdep calls the packages from which other modules come.
ROSDEP_KEYS = {
    'ament_index_python': 'ament_index_python',
    'cycler': 'python3-matplotlib',  # comes with it
    'markdown_it': 'python3-rich',  # comes with it
    'matplotlib': 'python3-matplotlib',
    'mcap': 'mcap-ros2-support',  # comes with it
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'rich': 'python3-rich',
    'rosbags': 'python3-rosbags-pip',
    'scipy': 'python3-scipy',
    'threadpoolctl': 'python3-threadpoolctl',
    'yaml': 'python3-yaml',
    'zstandard': 'mcap-ros2-support',  # comes with mcap
}


@functools.cache
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


@pytest.fixture
def build_tools(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / 'build_tools')
    import interfaces

    return interfaces


def test_the_version_is_the_same_everywhere():
    versions = {
        ElementTree.parse(ROOT / folder / 'package.xml').findtext('version')
        for folder in ('.', INTERFACES)}
    setup = subprocess.run(
        [sys.executable, 'setup.py', '--version'], cwd=ROOT, capture_output=True, text=True,
        check=True)
    assert versions == {friction_comp.__version__}
    assert setup.stdout.split()[-1] == friction_comp.__version__


@pytest.mark.parametrize('folder', ['.', INTERFACES])
def test_package_xml_is_valid(folder):
    package = pytest.importorskip('catkin_pkg.package')
    manifest = package.parse_package(str(ROOT / folder))
    problems = []
    manifest.validate(problems)
    assert not problems
    assert manifest.package_format == 3
    assert manifest.licenses == ['Apache-2.0']


def test_package_xml_names_what_the_modules_import():
    manifest = ElementTree.parse(ROOT / 'package.xml').getroot()
    declared = {e.text for e in manifest if e.tag in ('depend', 'exec_depend')}
    needed = set()
    for path in MODULES + LAUNCH_FILES:
        for name in imported(path) - set(sys.stdlib_module_names):
            # Optional ones are extras for pip, dependencies of the tests for rosdep.
            if name not in ('friction_comp', INTERFACES, 'pinocchio', 'pyarrow', 'h5py',
                             'mujoco', 'distributed'):
                needed.add(ROSDEP_KEYS.get(name, name))
    assert needed - declared == set()


def test_python_files_have_a_licence_and_a_readable_length():
    for path in tracked_files():
        if path.suffix == '.py' and path.exists():
            lines = path.read_text(encoding='utf-8').splitlines()
            assert 'SPDX-License-Identifier: Apache-2.0' in '\n'.join(lines[:3]), path
            assert len(lines) <= 800, path


def test_no_file_names_a_place_on_one_machine():
    places = '|'.join(['home', 'root', 'work', 'tmp', 'farm'])
    pattern = re.compile(rf'(?:^|[^\w./}}])/(?:{places})/[A-Za-z.]', re.MULTILINE)
    found = {
        str(path.relative_to(ROOT)): pattern.findall(text)
        for path in tracked_files() if path.suffix not in ('.png', '.mcap') and path.is_file()
        if pattern.search(text := path.read_text(encoding='utf-8', errors='replace'))}
    assert found == {}


def test_without_a_known_name_the_usage_is_shown(capsys):
    assert entry.main([]) == 2
    assert entry.main(['nonsense']) == 2
    shown = capsys.readouterr()
    assert shown.out == ''
    assert "'nonsense'" in shown.err
    assert all(name in shown.err for name in NAMES)


def test_help_and_version(capsys):
    assert entry.main(['--help']) == 0
    assert entry.main(['--version']) == 0
    assert capsys.readouterr().out.split()[-1] == friction_comp.__version__


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

    module = ModuleType('friction_comp.tools.predict')
    module.main = main
    monkeypatch.setitem(sys.modules, module.__name__, module)
    assert entry.main(['predict', 'argument']) == code
    monkeypatch.setattr(sys, 'argv', ['predict', 'argument'])
    assert entry.predict() == code
    assert capsys.readouterr().err == 2 * said


def test_an_environment_with_ros_wheels_names_itself(monkeypatch, tmp_path):
    (tmp_path / 'share' / 'ament_index').mkdir(parents=True)
    monkeypatch.setattr(sys, 'prefix', str(tmp_path))
    monkeypatch.setenv('AMENT_PREFIX_PATH', 'workspace')
    for _ in range(2):
        add_environment_to_ament_path()
        assert os.environ['AMENT_PREFIX_PATH'].split(os.pathsep) == ['workspace', str(tmp_path)]


def test_share_path_finds_what_comes_with_the_package():
    assert package_file('package.xml').is_file()
    with pytest.raises(InputError, match=r'no file config/nonsense\.yaml'):
        package_file('config', 'nonsense.yaml')


@pytest.mark.parametrize(('argument', 'words'), [
    ('breakaway_gain:=0.3', 'is a parameter of a node'), ('laws:=none', "is it 'law'"),
    ('law:=none', ''), ('sigterm_timeout:=60', '')])
def test_what_a_launch_file_would_pass_over_is_refused(monkeypatch, argument, words):
    given, declared = [argument], ['law', 'joints', 'parameters']
    monkeypatch.setattr(sys, 'argv', ['ros2', 'launch', 'friction_comp', 'our.launch.py', argument])
    if words:
        with pytest.raises(InputError, match=words):
            check_arguments('/launch/our.launch.py', given, declared)
    else:
        check_arguments('/launch/our.launch.py', given, declared)
    # Of a file that includes ours.
    monkeypatch.setattr(sys, 'argv', ['ros2', 'launch', 'their.launch.py', argument])
    check_arguments('/launch/our.launch.py', given, declared)


@pytest.mark.parametrize('path', LAUNCH_FILES, ids=lambda path: path.name)
def test_launch_files_start_executables_that_exist(path):
    tree = ast.parse(path.read_text(encoding='utf-8'))
    assert 'generate_launch_description' in {n.name for n in tree.body if hasattr(n, 'name')}
    started = {
        keyword.value.value for node in ast.walk(tree) if isinstance(node, ast.Call)
        for keyword in node.keywords
        if keyword.arg == 'executable' and isinstance(keyword.value, ast.Constant)}
    assert started
    assert started <= set(entry.NODES)


def test_the_interfaces_of_a_sourced_workspace_are_used(build_tools, monkeypatch, tmp_path):
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    assert not build_tools.provided_elsewhere()
    index = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'packages'
    index.mkdir(parents=True)
    (index / INTERFACES).touch()
    assert build_tools.provided_elsewhere()
    # Those that an earlier build of this very package left are not a workspace's own.
    marker = tmp_path / build_tools.MARKER
    marker.parent.mkdir(parents=True)
    marker.touch()
    assert not build_tools.provided_elsewhere()


def test_nothing_of_ros_is_fetched_where_it_is_sourced(build_tools, monkeypatch):
    monkeypatch.delenv('ROS_DISTRO', raising=False)
    apart = build_tools.fingerprint()
    assert any(name.startswith('ros-jazzy-') for name in build_tools.requirements())
    monkeypatch.setenv('ROS_DISTRO', 'jazzy')
    assert build_tools.requirements() == []
    assert build_tools.fingerprint() != apart


@pytest.mark.parametrize(('system', 'machine', 'compiler', 'reason'), [
    ('linux', 'x86_64', '/usr/bin/c++', ''), ('linux', 'x86_64', None, 'compiler'),
    ('linux', 'aarch64', '/usr/bin/c++', 'Linux x86-64'), ('darwin', 'arm64', 'c++', 'Linux'),
    ('win32', 'AMD64', 'c++', 'Linux')])
def test_without_what_nodes_need_pip_installs_the_tools_alone(
        build_tools, monkeypatch, system, machine, compiler, reason):
    monkeypatch.delenv('ROS_DISTRO', raising=False)
    monkeypatch.setattr(sys, 'platform', system)
    monkeypatch.setattr(build_tools.platform, 'machine', lambda: machine)
    monkeypatch.setattr(build_tools.shutil, 'which', lambda *_, **__: compiler)
    left_out = build_tools.why_left_out()
    assert reason in left_out
    assert bool(left_out) == bool(reason)
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


@pytest.mark.parametrize('way', ['plain', 'link', 'second path'])
def test_another_package_of_the_workspace_can_have_the_action(tmp_path, way):
    """colcon then builds the action first, and so friction_comp finds that it is there."""
    colcon = shutil.which('colcon', path=environment()['PATH'])
    if colcon is None:
        pytest.skip('colcon is not installed (requirements/test.txt)')
    ours, other = tmp_path / 'src' / 'friction_comp', tmp_path / 'src' / 'a_first_package'
    shutil.copytree(ROOT / INTERFACES, ours / INTERFACES)
    for name in ('package.xml', 'colcon.pkg', 'setup.py', 'setup.cfg'):
        shutil.copy(ROOT / name, ours)
    other.mkdir()
    (other / 'package.xml').write_text(
        '<package format="3"><name>a_first_package</name><version>0.0.1</version>'
        '<description>x</description><maintainer email="a@example.com">a</maintainer>'
        f'<license>Apache-2.0</license><depend>{INTERFACES}</depend></package>')
    paths = ['src']
    if way == 'link':
        (tmp_path / 'src' / INTERFACES).symlink_to(ours / INTERFACES)
    elif way == 'second path':
        paths.append(str(ours / INTERFACES))
    listed = subprocess.run(
        [colcon, 'list', '--topological-order', '--names-only', '--base-paths', *paths],
        cwd=tmp_path, env=environment(), capture_output=True, text=True, check=True)
    names = listed.stdout.split()
    if way == 'plain':
        assert sorted(names) == ['a_first_package', 'friction_comp']
    else:
        assert names[0] == INTERFACES
        assert len(names) == 3


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
def test_colcon_installs_every_executable(workspace):
    folder = workspace / 'install' / 'friction_comp' / 'lib' / 'friction_comp'
    assert {path.name for path in folder.iterdir()} == set(NAMES)
    assert all(os.access(path, os.X_OK) for path in folder.iterdir())
    help_text = sourced(workspace, f'{folder / "predict"} --help')
    assert '--model' in help_text
    assert '--output' in help_text


@pytest.mark.slow
def test_colcon_installs_the_shared_files(workspace):
    share = workspace / 'install' / 'friction_comp' / 'share'
    index = share / 'ament_index' / 'resource_index'
    for name in ('friction_comp', INTERFACES):
        assert (index / 'packages' / name).is_file()
        assert (share / name / 'package.xml').is_file()
    assert (index / 'rosidl_interfaces' / INTERFACES).is_file()
    for folder, ending in (('launch', '.launch.py'), ('config', '.yaml'), ('msg_docs', '.md')):
        here = {path.name for path in (ROOT / folder).glob('*' + ending)}
        assert here
        there = {path.name for path in (share / 'friction_comp' / folder).iterdir()}
        assert here <= there


@pytest.mark.slow
def test_the_action_comes_from_the_install_space(workspace):
    files = sourced(
        workspace,
        f'{sys.executable} -c "import friction_comp, {INTERFACES}.action as i;'
        ' g = i.IdentifyFriction.Goal(speeds=[0.5]); assert g.speeds[0] == 0.5;'
        f' import {INTERFACES}; print(friction_comp.__file__); print({INTERFACES}.__file__)"')
    install = workspace / 'install' / 'friction_comp'
    assert len(files.split()) == 2
    assert all(install in Path(name).parents for name in files.split())


def test_the_same_ruff_runs_before_a_commit_and_in_make_lint():
    hooks = yaml.safe_load((ROOT / '.pre-commit-config.yaml').read_text(encoding='utf-8'))
    ruff = next(repo for repo in hooks['repos'] if 'ruff' in repo['repo'])
    requirements = (ROOT / 'requirements' / 'test.txt').read_text(encoding='utf-8')
    assert f"ruff=={ruff['rev'].removeprefix('v')}" in requirements.splitlines()
