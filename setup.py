# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Installs friction_comp for pip and colcon; the nested interface package comes with it."""

from pathlib import Path
import re
import sys

from setuptools import find_packages, setup

PACKAGE = 'friction_comp'
# With `colcon build --symlink-install` this file is run through a symbolic link.
ROOT = Path(__file__).resolve().parent
sys.path.insert(0, str(ROOT / 'build_tools'))

import interfaces  # noqa: E402 - stands in the folder just added

NAMES = (
    'plant', 'identification', 'compensator', 'exercise', 'direction', 'recorder', 'refinement',
    'demo', 'reproduce', 'evaluate', 'refine', 'predict', 'convert', 'export', 'excite', 'play',
    'teach', 'doctor',
)
# pip puts scripts into the environment's bin/, where such plain names would be in the way; colcon
# puts them into lib/friction_comp/, where `ros2 run` looks for them (setup.cfg).
FOR_PIP = bool({'bdist_wheel', 'dist_info', 'editable_wheel'} & set(sys.argv))
SCRIPTS = (
    [f'{PACKAGE} = {PACKAGE}.__main__:main'] if FOR_PIP
    else [f'{name} = {PACKAGE}.__main__:{name}' for name in NAMES]
)


def version():
    """Read the version from the package without importing it."""
    text = (ROOT / PACKAGE / '__init__.py').read_text(encoding='utf-8')
    return re.search(r"^__version__ = '(.+)'$", text, re.MULTILINE).group(1)


def shared(folder, *patterns):
    """List a folder's files that belong in share/friction_comp/, in the form of data_files."""
    files = sorted(str(p.relative_to(ROOT)) for q in patterns for p in (ROOT / folder).glob(q))
    return [(f'share/{PACKAGE}/{folder}', files)] if files else []


def executables():
    """Write what `ros2 run` looks for in lib/friction_comp/, where pip makes no scripts.

    Each finds the Python of the environment that it lies in, wherever that is.
    """
    if not FOR_PIP:
        return []
    folder = ROOT / 'build' / 'executables'
    folder.mkdir(parents=True, exist_ok=True)
    for name in NAMES:
        path = folder / name
        path.write_text(
            f'#!/bin/sh\nexec "$(dirname "$0")/../../bin/python3" -m {PACKAGE} {name} "$@"\n',
            encoding='utf-8')
        path.chmod(0o755)
    return [(f'lib/{PACKAGE}', [str((folder / name).relative_to(ROOT)) for name in NAMES])]


setup(
    name=PACKAGE,
    version=version(),
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={PACKAGE: ['py.typed', '**/*.css']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        *shared('launch', '*.launch.py'),
        *shared('config', '*.yaml', '*.xml'),
        *shared('config/exercises', '*.yaml'),
        *shared('config/arms', '*.xml', '*.urdf'),
        *shared('config/layouts', '*.json', '*.xml'),
        *shared('msg_docs', '*.md'),
        *executables(),
    ],
    python_requires='>=3.10',
    # ROS 2 itself is not listed: it is sourced, or its wheels are in requirements/ros.txt.
    install_requires=interfaces.listed(ROOT / 'requirements' / 'run.txt'),
    # colcon runs the tests with pytest where it finds it asked for here.
    # Pinocchio reads URDF files for `refine --urdf`, pyarrow reads Parquet
    # files, h5py HDF5 files, Dask's distributed spreads `refine --each` over machines.
    extras_require={'parquet': ['pyarrow>=12'], 'hdf5': ['h5py>=3.8'],
                    'arm': ['pin>=2.7'], 'mujoco': ['mujoco>=3.1'],
                    'fleet': ['distributed>=2023.5'],
                    'test': ['pytest']},
    zip_safe=False,
    author='The friction_comp authors',
    maintainer='The friction_comp authors',
    maintainer_email='friction_comp@example.com',
    description='Identifies, explains and compensates the friction of geared robot drives.',
    license='Apache-2.0',
    entry_points={'console_scripts': SCRIPTS},
    cmdclass={
        'build': interfaces.Build,
        'build_interfaces': interfaces.BuildInterfaces,
        'develop': interfaces.Develop,
    },
    distclass=interfaces.WithInterfaces,
)
