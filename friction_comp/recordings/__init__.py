# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads and writes recordings: rosbag2 folders, mcap files and tables.

Names are imported when they are first used: a plan in a table needs no library for bags.
"""

from __future__ import annotations

import importlib
from typing import Any

BAGS, METADATA = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd'), 'metadata.yaml'
"""Suffixes of the files of bags, and the name of the one that describes a folder."""
_HOMES = {
    'scan': ['Activity'],
    'reader': ['find_recording', 'find_recordings', 'read_arm', 'read_joints', 'read_recording',
               'read_recording_with_info', 'recorded_joints'],
    'writer': ['RecordingWriter', 'write_samples']}


def __getattr__(name: str) -> Any:
    """Import a name when it is first used (PEP 562)."""
    for home, names in _HOMES.items():
        if name in names:
            return getattr(importlib.import_module(f'{__name__}.{home}'), name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
