# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""YAML as files of ROS and of this package hold it: the plain values of YAML 1.2, and no others."""

from __future__ import annotations

import re
from typing import Any

import yaml

from friction_comp.errors import InputError, one_line

# By libyaml, where PyYAML has it, in a tenth of the time.
_Loader: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


class _PlainLoader(_Loader):  # type: ignore[misc] # one of two classes
    """Reads the plain values of YAML 1.2, and rejects duplicate keys.

    PyYAML's own loader (YAML 1.1) reads 3:00 as 180, 3_000 as 3000, 010 as 8 and 'no' as false, and
    silently keeps the last of two equal keys.
    """

    yaml_implicit_resolvers: dict[Any, Any] = {}

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """Return a mapping; raises YAMLError if a key occurs twice."""
        seen = set()
        for key, _ in node.value:
            word = key.value if isinstance(key, yaml.ScalarNode) else None
            if word in seen:
                raise yaml.YAMLError(f'line {key.start_mark.line + 1}: {word!r} occurs twice')
            seen.add(word)
        return super().construct_mapping(node, deep)


class QuotingDumper(yaml.SafeDumper):
    """Writes no references, and quotes what any version of YAML reads as a number, such as 3:00."""

    def ignore_aliases(self, data: Any) -> bool:
        """Return True."""
        return True


def _whole_number(loader: Any, node: Any) -> int:
    return int(loader.construct_scalar(node))


def _number(loader: Any, node: Any) -> float:
    text = loader.construct_scalar(node).lower()
    return float(text.replace('.inf', 'inf').replace('.nan', 'nan'))


# The core schema of YAML 1.2.
for _tag, _pattern, _first in (
        ('bool', r'^(?:true|True|TRUE|false|False|FALSE)$', 'tTfF'),
        ('int', r'^[-+]?[0-9]+$', '-+0123456789'),
        ('float', r'^(?:[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?'
                  r'|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$', '-+0123456789.'),
        ('null', r'^(?:~|null|Null|NULL|)$', ['~', 'n', 'N', ''])):
    for _either in (_PlainLoader, QuotingDumper):
        _either.add_implicit_resolver(
            f'tag:yaml.org,2002:{_tag}', re.compile(_pattern), list(_first))
_PlainLoader.add_constructor('tag:yaml.org,2002:int', _whole_number)
_PlainLoader.add_constructor('tag:yaml.org,2002:float', _number)


def parse_yaml(text: str, where: object, references: bool = False) -> Any:
    """Return the plain values of a YAML document; raises InputError if it is not valid.

    What is nested deeply is refused, and so are references, a few of which fill the memory of
    whoever writes them out; but rosbag2's metadata have some.
    """
    try:
        depth = 0
        for count, event in enumerate(yaml.parse(text, Loader=_Loader)):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent) and not references:
                raise yaml.YAMLError('references (*) are not allowed')
            if depth > 100 or count > 4_000_000:
                raise yaml.YAMLError('it holds too much, or is nested too deeply')
        return yaml.load(text, Loader=_PlainLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputError(f'{where}: not a YAML document: {one_line(error)}') from None
