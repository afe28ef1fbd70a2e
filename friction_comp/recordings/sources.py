# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Opens recordings of either kind: rosbag2 recordings and tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from friction_comp.columns import Layout
from friction_comp.recordings.scan import AnyPath, Progress, Scan, Scanner
from friction_comp.recordings.tables import is_table, TableScanner
from friction_comp.topics import TOPICS

# Messages within which all joints are named, even with several publishers on a topic.
_FIRST_MESSAGES = 200


def open_scanner(path: AnyPath, signals: Sequence[str] = tuple(TOPICS), joint: str | None = None,
                 layout: Layout | None = None, batch: int | None = None
                 ) -> Scanner | TableScanner:
    """Return the scanner that reads a recording in batches.

    Parameters
    ----------
    path : path-like
        One recording, as `find_recordings` returns it.
    signals : sequence of str
        Signals to read from a rosbag2 recording; from a table, all are read.
    joint : str, optional
        Keep only this joint's values.
    layout : Layout, optional
        Known columns and units of a table.
    batch : int, optional
        Messages or rows per batch.
    """
    path = Path(path)
    options = {} if batch is None else {'batch': batch}
    if path.is_file() and is_table(path):
        return TableScanner(path, layout, joint, *options.values())
    return Scanner(path, signals, joint, **options)


def scan_recording(path: AnyPath, signals: Sequence[str] = tuple(TOPICS),
                   progress: Progress | None = None, joint: str | None = None,
                   layout: Layout | None = None) -> Scan:
    """Read the signals of one recording.

    Parameters
    ----------
    path : path-like
        One recording, as `find_recordings` returns it.
    signals : sequence of str
        Signals to read.
    progress : callable, optional
        Called with the share 0..1 that has been read.
    joint : str, optional
        Keep only this joint's values.
    layout : Layout, optional
        Known columns and units of a table.

    Returns
    -------
    Scan

    Raises
    ------
    InputError
        If the recording cannot be read; the text gives the reason.
    """
    scanner = open_scanner(path, signals, joint, layout)
    for _ in scanner.batches():
        if progress:
            progress(scanner.progress)
    return scanner.finish()


def recorded_joints(path: AnyPath, layout: Layout | None = None) -> list[str]:
    """Return the joints in a recording's first joint states.

    Parameters
    ----------
    path : path-like
        One recording, as `find_recordings` returns it.
    layout : Layout, optional
        Known columns and units of a table.

    Returns
    -------
    list of str
        '' for a joint without a name.

    Raises
    ------
    InputError
        If the recording cannot be read.
    """
    scanner = open_scanner(path, ('joint_states',), layout=layout, batch=_FIRST_MESSAGES)
    for _ in scanner.batches():
        break
    for store in scanner.stores.values():
        store.flush()
    return list(dict.fromkeys(
        name for track in scanner.finish().of('joint_states') for name in track.names))
