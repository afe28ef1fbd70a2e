# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Names of the items of list columns, which a dataset keeps beside its tables.

LeRobot datasets have them in ``meta/info.json``, above the folders of their Parquet files.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
import json
from pathlib import Path
from typing import Any

_INFO = Path('meta/info.json')
# Folders above a table in which the dataset's may be: data/chunk-000/.
_ABOVE = 4


def item_names(path: Path) -> dict[str, list[str]]:
    """Return the names of the items of each list column of a table; empty where none are kept.

    Names that are missing, not all different, or no text, are none.
    """
    for folder in path.resolve().parents[:_ABOVE]:
        if (folder / _INFO).is_file():
            return _names_in(folder / _INFO)
    return {}


def with_items(column: str, count: int, path: Path) -> list[str]:
    """Return the names of the items of a table's list column: NAME[0] and so on without others."""
    names = item_names(path).get(column, [])
    return [f'{column}[{name}]' for name in (names if len(names) == count else range(count))]


@lru_cache(maxsize=16)
def _names_in(path: Path) -> dict[str, list[str]]:
    try:
        content = json.loads(path.read_text(encoding='utf-8'))
    except (OSError, ValueError):
        return {}
    features = content.get('features') if isinstance(content, Mapping) else None
    found = {column: _flat(feature.get('names')) for column, feature in features.items()
             if isinstance(feature, Mapping)} if isinstance(features, Mapping) else {}
    return {column: names for column, names in found.items()
            if names and all(names) and len(set(names)) == len(names)}


def _flat(names: Any) -> list[str]:
    """Return names from a list, or from the only list of an object or list, such as ``motors``."""
    if isinstance(names, Mapping):
        names = list(names.values())
    if isinstance(names, list) and len(names) == 1 and isinstance(names[0], list):
        return _flat(names[0])
    return list(names) if isinstance(names, list) and all(isinstance(one, str) for one in names) \
        else []
