# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds misspelt remappings, which ROS ignores."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
import re
from typing import Any

from friction_comp.topics import TOPICS


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
    said = []
    for name in _remapped(node, argv):
        has_effect = (_last_part(name) in TOPICS or node.resolve_topic_name(name) in used
                      or node.resolve_service_name(name) in used)
        alike = get_close_matches(_last_part(name), known, 1)
        if alike and not has_effect:
            said.append(f'remapping {name} has no effect: is it {alike[0]}?')
    return said


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
