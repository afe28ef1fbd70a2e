# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Raw contents of a recording as arrays, whether it was read from messages or from a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from friction_comp.recordings.activity import Activity


@dataclass
class Track:
    """One topic's messages in the order of the file."""

    topic: str
    signal: str
    receive: np.ndarray  # (N,) of int64: ns
    stamp: np.ndarray  # (N,) of int64: ns, 0 throughout where the message has none
    order: np.ndarray  # (N,) of int64: index of each message among all that were read
    names: list[str]  # all joints or frames in the messages
    # JointState: for each joint an array (N, 3) of position, velocity and effort, NaN where a
    # message has none. Wrench and temperature: for each frame an array (N, 1). Arrays: the key ''
    # and an array (N, J); for commands in N·m the key `TORQUE_UNIT`, with NaN for messages of the
    # other unit. With a selected joint, only the values that may be its own.
    values: dict[str, np.ndarray]

    def __len__(self) -> int:
        return len(self.receive)

    def take(self, index: slice) -> Track:
        """Return the selected messages."""
        return Track(self.topic, self.signal, self.receive[index], self.stamp[index],
                     self.order[index], self.names,
                     {key: value[index] for key, value in self.values.items()})

    @staticmethod
    def concatenate(parts: Sequence[Track]) -> Track:
        """Join parts of one topic; their `values` are emptied, to need no memory for both."""
        first = parts[0]
        if len(parts) == 1:
            return first
        starts = np.cumsum([0, *map(len, parts)])
        values = {}
        for key in dict.fromkeys(key for part in parts for key in part.values):
            width = max(part.values[key].shape[1] for part in parts if key in part.values)
            values[key] = np.full((starts[-1], width), np.nan)
            for start, part in zip(starts, parts):
                if key in part.values:
                    own = part.values.pop(key)
                    values[key][start:start + len(own), :own.shape[1]] = own
        return Track(
            first.topic, first.signal, np.concatenate([part.receive for part in parts]),
            np.concatenate([part.stamp for part in parts]),
            np.concatenate([part.order for part in parts]),
            list(dict.fromkeys(name for part in parts for name in part.names)), values)


@dataclass
class Scan:
    """Raw contents of one recording, or of a stretch of it.

    Notes, activity and the count of messages by topic are those of all that has been read so far.
    """

    path: Path
    tracks: list[Track]
    topics: dict[str, tuple[str, int]]     # topic to message type and number of messages
    notes: list[str]                       # on what is missing or damaged
    custom: dict[str, str] = field(default_factory=dict)    # of rosbag2's metadata
    activity: list[Activity] = field(default_factory=list)
    effort_is_current: bool = False        # in A already, as tables may declare

    def of(self, signal: str) -> list[Track]:
        """Return the tracks of a signal; an exact topic name takes precedence over its ending."""
        tracks = [track for track in self.tracks if track.signal == signal]
        exact = [t for t in tracks if t.topic.rsplit('/', 1)[-1] == signal]
        return exact or tracks

    @property
    def joints(self) -> list[str]:
        """Names of all joints in the joint states."""
        return list(dict.fromkeys(n for track in self.of('joint_states') for n in track.names))

    @property
    def model(self) -> str | None:
        """Active model file, if recorded."""
        for key in ('model_file', 'model_files', 'model'):
            if self.custom.get(key):
                return self.custom[key]
        named = [activity.model for activity in self.activity if activity.model]
        return named[-1] if named else None
