# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Refuses arguments of launch files that nothing would read, as of a gain that is not one of them.

`launch` passes over arguments that a file does not declare, and a node would start with the default
of what somebody has just set. Other names than those of parameters, or like an argument, are left
alone: some are launch's own.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
import sys

from friction_comp.errors import InputError
from friction_comp.files import read_yaml
from friction_comp.package_files import package_file


def check_arguments(file: str, given: Iterable[str], declared: Iterable[str]) -> None:
    """Raise InputError for an argument that a launch file does not have, but a node or a like name.

    `given` are the command line's, such as ``law:=none``; `declared` the names that the file has.
    Where another launch file includes this one, they are the other's, and none is refused.
    """
    if Path(file).name not in {Path(word).name for word in sys.argv}:
        return
    names = list(declared)
    nodes = read_yaml(package_file('config', 'parameters.yaml')).values()
    parameters = {name for node in nodes for name in node['ros__parameters']}
    for name in {argument.partition(':=')[0]: None for argument in given}:
        if name in names:
            continue
        if name in parameters:
            raise InputError(f'{name} is a parameter of a node and no argument of this launch '
                             'file: set it in a copy of config/parameters.yaml, and give that with '
                             'parameters:=FILE')
        like = get_close_matches(name, names, n=1, cutoff=0.8)
        if like:
            raise InputError(f'this launch file has no argument {name!r}; is it {like[0]!r}?')
