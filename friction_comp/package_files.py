# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds files of the package, and makes the Python environment known to ROS 2."""

from __future__ import annotations

import os
from pathlib import Path
import sys

from friction_comp.errors import InputError


def package_file(*parts: str) -> Path:
    """Return the path of a file or folder of the package; raises InputError if it is missing.

    `parts` is its path below ``share/friction_comp``. It is searched in the source tree, if the
    package runs from one, in all sourced workspaces and in the Python environment.
    """
    root = Path(__file__).resolve().parent.parent
    folders = [root] if (root / 'package.xml').is_file() else []
    folders += [Path(p, 'share', 'friction_comp') for p in (*_ament_prefixes(), sys.prefix)]
    for folder in folders:
        path = folder.joinpath(*parts)
        if path.exists():
            return path
    raise InputError(f'friction_comp has no file {"/".join(parts)}')


def middlewares() -> list[str]:
    """Return the names of the middlewares that ROS 2 finds on this machine."""
    installed = {path.name for prefix in (*_ament_prefixes(), sys.prefix) for path in Path(
        prefix, 'share', 'ament_index', 'resource_index', 'rmw_typesupport').glob('rmw_*')}
    # This one only selects another at run time.
    return sorted(installed - {'rmw_implementation'})


def add_environment_to_ament_path() -> None:
    """Add this Python environment to AMENT_PREFIX_PATH, before ROS 2 is imported.

    Activating a virtual environment with ROS 2 wheels does not. Sourced workspaces take precedence.
    """
    if not Path(sys.prefix, 'share', 'ament_index').is_dir():
        return
    if sys.prefix not in _ament_prefixes():
        os.environ['AMENT_PREFIX_PATH'] = os.pathsep.join([*_ament_prefixes(), sys.prefix])


def _ament_prefixes() -> list[str]:
    return [p for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
