# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Builds the nested interface package as a part of building friction_comp.

Interfaces can only come from an ament_cmake package, and colcon does not look for packages below
another one. So setup.py runs CMake on ``friction_comp_interfaces`` and takes over what it installs:
the Python module beside ``friction_comp``, all else (libraries, headers, share) as data files.
Tools for recordings need none of it: pip leaves it out where it cannot be built, and what it then
installs is plain Python.
"""

import hashlib
import os
from pathlib import Path
import platform
import shutil
import subprocess
import sys

from setuptools import Command, Distribution
from setuptools.command.build import build
from setuptools.command.develop import develop

ROOT = Path(__file__).resolve().parent.parent
NAME = 'friction_comp_interfaces'
SOURCE = ROOT / NAME
REQUIREMENTS = ROOT / 'requirements' / 'build.txt'
# Laid down beside an interface package that this file built, to tell it from one that a workspace
# provides of its own accord: the latter is used as it is, the former is built anew when it is old.
MARKER = Path('share', NAME, 'built_with_friction_comp')


def ros_is_sourced():
    """Tell whether a ROS 2 installation is sourced; then nothing of it may come from wheels."""
    return bool(os.environ.get('ROS_DISTRO'))


def prefixes():
    """List the install prefixes that the environment names, nearest first."""
    return [Path(p) for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]


def provided_elsewhere():
    """Tell whether a sourced workspace already provides the interface package."""
    index = Path('share', 'ament_index', 'resource_index', 'packages', NAME)
    return any((p / index).exists() and not (p / MARKER).exists() for p in prefixes())


def why_left_out():
    """Say why an ordinary build leaves the interfaces out, '' where it builds them."""
    if ros_is_sourced():
        return ''
    if sys.platform != 'linux' or platform.machine() != 'x86_64':
        return 'without a sourced ROS 2 they are built on Linux x86-64 only'
    if not any(map(shutil.which, (os.environ.get('CXX') or 'c++', 'g++', 'clang++'))):
        return 'there is no C++ compiler'
    return ''


def requirements():
    """List what an isolated build has to fetch: nothing where ROS 2 is sourced, or left out."""
    return [] if ros_is_sourced() or why_left_out() else listed(REQUIREMENTS)


def listed(path):
    """List the requirements in a file."""
    lines = (line.strip() for line in path.read_text(encoding='utf-8').splitlines())
    return [line for line in lines if line and not line.startswith('#')]


def fingerprint():
    """Hash all that the built tree depends on: sources, build requirements, Python, ROS 2."""
    digest = hashlib.sha256()
    for path in sorted(p for p in SOURCE.rglob('*') if p.is_file()) + [REQUIREMENTS]:
        digest.update(str(path.relative_to(ROOT)).encode() + b'\0' + path.read_bytes() + b'\0')
    digest.update(f'{sys.implementation.cache_tag} {os.environ.get("ROS_DISTRO")}'.encode())
    return digest.hexdigest()


def cmake_environment():
    """Return the environment for CMake and the interpreter its code generators run in."""
    environment = dict(os.environ)
    search = [str(Path(sys.executable).parent)]
    environment['PATH'] = os.pathsep.join(search + [environment.get('PATH', os.defpath)])
    # colcon's override of sys.prefix is for setup.py alone; CMake needs the true one.
    paths = environment.get('PYTHONPATH', '').split(os.pathsep)
    paths = [p for p in paths if p and Path(p).name != 'prefix_override']
    interpreter = sys.executable
    if ros_is_sourced():
        # The installation's generators import modules of the system, which neither a virtual
        # environment nor pip's isolated build lets through.
        interpreter = getattr(sys, '_base_executable', None) or sys.executable
        version = f'python{sys.version_info.major}.{sys.version_info.minor}'
        paths = [str(p / 'lib' / version / 'site-packages') for p in prefixes()]
    environment['PYTHONPATH'] = os.pathsep.join(paths)
    return environment, interpreter


def build_tree(folder):
    """Build the interface package in a folder, with a fingerprint, and return the install tree."""
    tree, stamp, wanted = folder / 'install', folder / 'fingerprint', fingerprint()
    if tree.is_dir() and stamp.is_file() and stamp.read_text(encoding='ascii') == wanted:
        return tree
    # Never onto an old build: its cache may name a build environment that is gone.
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    environment, interpreter = cmake_environment()
    cmake = shutil.which('cmake', path=environment['PATH'])
    if cmake is None:
        sys.exit(f'error: building {NAME} needs cmake, and there is none on PATH')
    generator = ['-G', 'Ninja'] if shutil.which('ninja', path=environment['PATH']) else []
    for command in (
        [cmake, '-S', SOURCE, '-B', folder / 'build', *generator, '-DBUILD_TESTING=OFF',
         f'-DCMAKE_INSTALL_PREFIX={tree}', f'-DPython3_EXECUTABLE={interpreter}'],
        [cmake, '--build', folder / 'build', '--parallel', str(os.cpu_count() or 1)],
        [cmake, '--install', folder / 'build'],
    ):
        try:
            subprocess.run([str(part) for part in command], env=environment, check=True)
        except (OSError, subprocess.CalledProcessError) as error:
            sys.exit(f'error: building {NAME} failed: {error}')
    (tree / MARKER).touch()
    stamp.write_text(wanted, encoding='ascii')
    return tree


class BuildInterfaces(Command):
    """``setup.py build_interfaces``: build the package and hand it to the other commands."""

    description = f'build the nested package {NAME}'
    user_options = [('as-data', None, 'hand over the Python module as data files too')]
    boolean_options = ['as-data']

    def initialize_options(self):
        """Set the options to their defaults."""
        self.as_data = False
        self.build_base = None
        self.build_lib = None

    def finalize_options(self):
        """Take over the folders of the build command."""
        self.set_undefined_options(
            'build', ('build_base', 'build_base'), ('build_lib', 'build_lib'))

    def run(self):
        """Build, then place the module in build_lib and the rest in data_files."""
        if provided_elsewhere():
            return
        tree = build_tree(Path(self.build_base).resolve() / NAME)
        module = next(tree.glob(f'**/{NAME}/action/__init__.py')).parent.parent
        files = {}
        for path in sorted(p for p in tree.rglob('*') if p.is_file()):
            if '__pycache__' in path.parts or '.egg-info' in str(path):
                continue
            if module in path.parents and not self.as_data:
                target = Path(self.build_lib, NAME, path.relative_to(module))
                target.parent.mkdir(parents=True, exist_ok=True)
                self.copy_file(str(path), str(target))
            else:
                folder = str(path.parent.relative_to(tree))
                files.setdefault(folder, []).append(str(path))
        # In place: install_data may hold the list already.
        self.distribution.data_files.extend(files.items())


class Build(build):
    """The ordinary build, then the interfaces where they can be built."""

    def has_interfaces(self):
        """Tell whether to build them, and say why not."""
        reason = why_left_out()
        if reason:
            print(f'{NAME} is left out, and with it the nodes: {reason}', file=sys.stderr)
        return not reason

    sub_commands = [*build.sub_commands, ('build_interfaces', has_interfaces)]


class Develop(develop):
    """What ``colcon build --symlink-install`` runs; it has no build step for the interfaces."""

    def run(self):
        """Build the interfaces, all of them as data files, then develop as ever."""
        if not self.uninstall:
            self.get_finalized_command('build_interfaces').as_data = True
            self.run_command('build_interfaces')
        super().run()


class WithInterfaces(Distribution):
    """A distribution that holds compiled code although it lists no extension module."""

    def has_ext_modules(self):
        """Tell that wheels of it fit one Python and one platform."""
        return not (provided_elsewhere() or why_left_out())
