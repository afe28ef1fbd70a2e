# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""YAML of rosbag2's metadata, by libyaml where PyYAML has it: in a tenth of the time."""

from __future__ import annotations

from typing import Any

import yaml

_LOADER: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
_DUMPER: Any = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)


def load_yaml(text: str) -> Any:
    """Return the plain values of a YAML document; raises yaml.YAMLError."""
    return yaml.load(text, Loader=_LOADER)


def dump_yaml(document: Any) -> str:
    """Return plain values as a YAML document."""
    return str(yaml.dump(document, Dumper=_DUMPER, sort_keys=False, allow_unicode=True))
