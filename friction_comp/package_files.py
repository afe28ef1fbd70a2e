# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds what comes with the package, and lets ROS 2 find what came with the environment."""

from __future__ import annotations

import os
from pathlib import Path
import sys

from friction_comp.errors import InputError


def package_file(*parts: str) -> Path:
    """Return the path of a file or folder that comes with the package.

    Looks into the source tree when the package runs from one, then into every sourced workspace,
    then into the Python environment, for a path below ``share/friction_comp``, such as ``'config',
    'armin_configuration_1.yaml'``. Raises InputError when there is no such file.
    """
    root = Path(__file__).resolve().parent.parent
    folders = [root] if (root / 'package.xml').is_file() else []
    folders += [Path(p, 'share', 'friction_comp') for p in (*_sourced(), sys.prefix)]
    for folder in folders:
        path = folder.joinpath(*parts)
        if path.exists():
            return path
    raise InputError(f'friction_comp comes with no file {"/".join(parts)}')


def middlewares() -> list[str]:
    """Return the names of the middlewares that ROS 2 finds on this machine."""
    installed = {path.name for prefix in (*_sourced(), sys.prefix) for path in Path(
        prefix, 'share', 'ament_index', 'resource_index', 'rmw_typesupport').glob('rmw_*')}
    # Variables that select another implementation at run time.
    return sorted(installed - {'rmw_implementation'})


def name_this_environment() -> None:
    """Let ROS 2 find what is installed in this Python environment.

    A sourced workspace names itself in AMENT_PREFIX_PATH; a virtual environment that holds ROS 2
    wheels does not. It comes last, so that sourced workspaces keep their precedence. Whoever
    starts a node calls this before ROS 2 is imported.
    """
    if not Path(sys.prefix, 'share', 'ament_index').is_dir():
        return
    if sys.prefix not in _sourced():
        os.environ['AMENT_PREFIX_PATH'] = os.pathsep.join([*_sourced(), sys.prefix])


def _sourced() -> list[str]:
    """Return the prefixes of the sourced workspaces."""
    return [p for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
