# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the files that come with the package: configurations, launch files, message pages."""

from __future__ import annotations

import os
from pathlib import Path
import sys

from friction_comp.errors import InputError


def package_file(*parts):
    """Return the path of a file or folder that comes with the package.

    Looks into the source tree when the package runs from one, then into every sourced workspace,
    then into the Python environment.

    Parameters
    ----------
    *parts : str
        The path below ``share/friction_comp``, such as ``'config', 'armin_configuration_1.yaml'``.

    Returns
    -------
    pathlib.Path
        The path, which exists.

    Raises
    ------
    InputError
        When there is no such file.
    """
    root = Path(__file__).resolve().parent.parent
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    folders = [root] if (root / 'package.xml').is_file() else []
    folders += [Path(p, 'share', 'friction_comp') for p in prefixes if p]
    for folder in folders:
        path = folder.joinpath(*parts)
        if path.exists():
            return path
    raise InputError(f'friction_comp comes with no file {"/".join(parts)}')
