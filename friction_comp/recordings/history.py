# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Stores averages of a drive's recordings in a small file beside its model.

A later refinement can fit new effects to averages of signals; sums of products, which are larger,
contain only the columns known when they were computed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import date, datetime
import io
import json
from pathlib import Path
from typing import Any
import zipfile

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.files import write_atomically
from friction_comp.recordings.condense import condensed
from friction_comp.recordings.joint_samples import RecordingInfo
from friction_comp.samples import Samples

VERSION = 1
# Averages kept per recording: more than a minute at 100 Hz, about 200 kB.
KEPT = 8000
_SIGNALS = ('time', 'position', 'current', 'velocity', 'load', 'temperature')
# Stamps before this time (in 2001), s, are simulated or missing.
_FIRST_DATE = 1e9


@dataclass(frozen=True)
class RecordedAverages:
    """Averages of one recording, at most at 100 Hz."""

    name: str       # of the file or folder
    start: float    # stamp of its first sample, s
    day: str        # ISO date of the recording, or of its addition if stamps have no date
    samples: Samples


@dataclass
class History:
    """Averages of a drive's recordings, and notes on the drive."""

    torque_per_current: float  # N·m/A at the joint, used to convert effort to current
    recordings: list[RecordedAverages] = field(default_factory=list)  # in the order of their dates
    notes: list[tuple[str, str]] = field(default_factory=list)  # ISO date and text

    @staticmethod
    def path_of(model: str | Path) -> Path:
        """Return the path of a model file's history, in the same folder."""
        return Path(model).with_suffix('.history.npz')

    @classmethod
    def beside(cls, model: str | Path, drive: Drive, joint: str = '') -> History:
        """Return a model file's history, an empty one where there is none.

        Raises InputError if it is invalid, or of another joint or drive.
        """
        path, gain = cls.path_of(model), drive.torque_per_current
        if not path.exists():
            return cls(gain)
        history = cls._load(path)
        if not np.isclose(history.torque_per_current, gain, rtol=1e-6):
            raise InputError(
                f'{path}: was made with {history.torque_per_current:g} N·m/A at the joint, the '
                f'model has {gain:g}; delete it to start over')
        kept = next((one.samples.joint for one in history.recordings if one.samples.joint), '')
        if joint and kept and kept != joint:
            raise InputError(f'{path}: is of joint {kept!r}, not {joint!r}')
        return history

    @classmethod
    def _load(cls, path: Path) -> History:
        try:
            with np.load(path, allow_pickle=False) as stored:
                document = json.loads(str(stored['about']))
                if document['version'] != VERSION:
                    raise InputError(f'{path}: is of version {document["version"]}, not {VERSION}: '
                                     'delete it to start over')
                history = cls(float(document['torque_per_current']),
                              notes=[(str(day), str(text)) for day, text in document['notes']])
                for index, entry in enumerate(document['recordings']):
                    signals: dict[str, Any] = {
                        name: stored[key] for name in _SIGNALS
                        if (key := f'{index}/{name}') in stored}
                    history.recordings.append(RecordedAverages(
                        str(entry['name']), float(entry['start']), str(entry['day']),
                        Samples(joint=str(entry['joint']), **signals)))
        except (AttributeError, EOFError, KeyError, OSError, TypeError, ValueError,
                zipfile.BadZipFile) as error:
            raise InputError(f'{path}: not the history of a drive: {error}') from None
        return history

    def add(self, samples: Samples, info: RecordingInfo) -> bool:
        """Add a recording; if it is already there, return False and note that in its info."""
        name, start = info.path.name, float(info.start)
        kept, has_date = condensed(samples, KEPT), start > _FIRST_DATE
        # Tables without dates often begin at zero and have the same name: then the content tells.
        if any((name, start) == (recording.name, recording.start)
               and (has_date or _equal(kept, recording.samples)) for recording in self.recordings):
            info.notes.append('already in the history: not added again')
            return False
        day = (datetime.fromtimestamp(start).date() if has_date else date.today()).isoformat()
        self.recordings.append(RecordedAverages(name, start, day, kept.with_(
            recording=np.zeros(len(kept), dtype=int), arm=None)))
        self.recordings.sort(key=lambda recording: (recording.day, recording.start))
        return True

    def note(self, text: str) -> None:
        """Add a note with today's date."""
        self.notes = sorted([*self.notes, (date.today().isoformat(), text)])

    def samples(self) -> list[Samples]:
        """Return the averages of each recording."""
        return [recording.samples.with_(recording=np.full(len(recording.samples), index))
                for index, recording in enumerate(self.recordings)]

    def save(self, model: str | Path) -> Path:
        """Write the history beside a model file; return its path."""
        document: dict[str, Any] = {
            'version': VERSION, 'torque_per_current': self.torque_per_current,
            'notes': self.notes, 'recordings': []}
        arrays: dict[str, Any] = {}
        for index, recording in enumerate(self.recordings):
            document['recordings'].append({
                'name': recording.name, 'start': recording.start, 'day': recording.day,
                'joint': recording.samples.joint})
            arrays.update({f'{index}/{name}': values for name in _SIGNALS
                           if (values := getattr(recording.samples, name)) is not None})
        stream = io.BytesIO()
        np.savez_compressed(stream, about=np.array(json.dumps(document)), **arrays)
        path = self.path_of(model)
        write_atomically(path, stream.getvalue())
        return path


def _equal(one: Samples, other: Samples) -> bool:
    """Return whether the signals that every recording has are the same."""
    return len(one) == len(other) and all(
        np.allclose(getattr(one, name), getattr(other, name), rtol=1e-6, atol=1e-9)
        for name in ('time', 'position', 'current'))
