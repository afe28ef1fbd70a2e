# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds names of parameters, remappings and launch arguments that nothing would read.

ROS and `launch` pass over them, so that a misspelt limit would leave the default in place.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
import re
import sys
from typing import Any

from friction_comp.errors import InputError
from friction_comp.files import read_yaml
from friction_comp.package_files import package_file
from friction_comp.topics import TOPICS


def _like(name: str, known: Iterable[str], cutoff: float = 0.6) -> str:
    """Return the name that is most alike, '' if none is."""
    return next(iter(get_close_matches(name, list(known), 1, cutoff)), '')


def unknown_parameters(node: Any) -> list[str]:
    """Return what to say of each parameter that a node was given and does not have."""
    # Also holds what a file says of all nodes.
    given = getattr(node, '_parameter_overrides', {})
    known = list(node.get_parameters_by_prefix(''))
    return [f'parameter {name} does not exist, and has no effect'
            + (f': is it {like}?' if (like := _like(name, known)) else '')
            for name in sorted(given)
            if name not in known and not name.startswith('qos_overrides.')]


def unknown_remappings(node: Any, argv: Sequence[str]) -> list[str]:
    """Return what to say of each remapped name that the node has not, but one like it.

    Others may be meant for other nodes that are started with the same arguments.
    """
    used = {entity.topic_name for entity in (*node.publishers, *node.subscriptions)}
    used |= {entity.srv_name for entity in (*node.services, *node.clients)}
    used |= {node.resolve_service_name(entity._action_name) for entity in node.waitables
             if hasattr(entity, '_action_name')}
    # Topics of the package may be opened later.
    known = {*TOPICS, *map(_last_part, used)}
    return [f'remapping {name} has no effect: is it {like}?' for name in _remapped(node, argv)
            if (like := _like(_last_part(name), known)) and not (
                _last_part(name) in TOPICS or node.resolve_topic_name(name) in used
                or node.resolve_service_name(name) in used)]


def _last_part(name: str) -> str:
    return name.rsplit('/', 1)[-1]


def _remapped(node: Any, argv: Sequence[str]) -> Iterator[str]:
    """Yield the names in the remapping rules of a node's arguments."""
    ros = False
    for argument, rule in zip(argv, [*argv[1:], '']):
        ros = argument == '--ros-args' or (ros and argument != '--')
        match = re.fullmatch(r'(?:([^:/]+):)?(?:ros(?:topic|service)://)?([^:]+):=.*', rule)
        if (ros and argument in ('-r', '--remap') and match and match[1] in (None, node.get_name())
                and not match[2].startswith('__')):
            yield match[2]


def check_arguments(file: str, given: Iterable[str], declared: Iterable[str]) -> None:
    """Raise InputError for an argument that a launch file does not have, but a node or a like name.

    `given` are the command line's, such as ``law:=none``; `declared` the names that the file has.
    Where another launch file includes this one, they are the other's, and none is refused. Other
    names are left alone: some are launch's own.
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
        if like := _like(name, names, cutoff=0.8):
            raise InputError(f'this launch file has no argument {name!r}; is it {like!r}?')
