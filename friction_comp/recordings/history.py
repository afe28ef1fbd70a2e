# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Keeps the essence of a drive's recordings in a small file beside its model.

One principle: **averages are kept, no sums**. On averages a later refinement can try effects that
nobody thought of when they were recorded; sums of products know only the columns of their day, and
are larger.
"""

from __future__ import annotations

from collections.abc import Sequence
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
from friction_comp.recordings.reader import RecordingInfo
from friction_comp.samples import Samples

VERSION = 1
# Averages that are kept of one recording: a minute and more at 100 Hz, some 200 kB.
KEPT = 8000
_SIGNALS = ('time', 'position', 'current', 'velocity', 'load', 'temperature')
# An earlier stamp is simulated time, or none.
_FIRST_DATE = 1e9


@dataclass(frozen=True)
class Remembered:
    """What is kept of one recording.

    Parameters
    ----------
    name : str
        Of the file or folder.
    start : float
        Stamp of its first sample, s.
    day : str
        ISO date on which it was recorded, or was added where its stamps do not tell.
    samples : Samples
        At 100 Hz at most.
    """

    name: str
    start: float
    day: str
    samples: Samples


@dataclass
class History:
    """The recordings of a drive, and notes of what was done to it.

    Parameters
    ----------
    torque_per_current : float
        N·m/A at the joint, by which effort became current.
    recordings : list of Remembered
        In the order of their dates.
    notes : list of (str, str)
        ISO date and what was done that day.
    """

    torque_per_current: float
    recordings: list[Remembered] = field(default_factory=list)
    notes: list[tuple[str, str]] = field(default_factory=list)

    @staticmethod
    def path_of(model: str | Path) -> Path:
        """Return the path of a model file's history, in the same folder."""
        return Path(model).with_suffix('.history.npz')

    @classmethod
    def beside(cls, model: str | Path, drive: Drive) -> History:
        """Return a model file's history, an empty one where there is none.

        Raises
        ------
        InputError
            If the file is no history, or was made with another torque constant or gear ratio.
        """
        path, gain = cls.path_of(model), drive.torque_per_current
        if not path.exists():
            return cls(gain)
        history = cls._load(path)
        if not np.isclose(history.torque_per_current, gain, rtol=1e-6):
            raise InputError(
                f'{path}: was made with {history.torque_per_current:g} N·m/A at the joint, the '
                f'model has {gain:g}; delete it to begin anew')
        return history

    @classmethod
    def _load(cls, path: Path) -> History:
        try:
            with np.load(path, allow_pickle=False) as stored:
                about = json.loads(str(stored['about']))
                if about['version'] != VERSION:
                    raise InputError(f'{path}: is of version {about["version"]}, not {VERSION}: '
                                     'delete it to begin anew')
                history = cls(float(about['torque_per_current']),
                              notes=[(str(day), str(text)) for day, text in about['notes']])
                for index, entry in enumerate(about['recordings']):
                    signals: dict[str, Any] = {name: stored[f'{index}/{name}']
                                               for name in entry['signals']}
                    history.recordings.append(Remembered(
                        str(entry['name']), float(entry['start']), str(entry['day']),
                        Samples(joint=str(entry['joint']), **signals)))
        except (AttributeError, EOFError, KeyError, OSError, TypeError, ValueError,
                zipfile.BadZipFile) as error:
            raise InputError(f'{path}: is no history of a drive: {error}') from None
        return history

    def add(self, samples: Samples, info: RecordingInfo) -> bool:
        """Keep a recording; return False where it is kept already.

        Parameters
        ----------
        samples : Samples
        info : RecordingInfo
        """
        name, start = info.path.name, float(info.start)
        if any((name, start) == (one.name, one.start) for one in self.recordings):
            return False
        kept = condensed(samples, KEPT)
        dated = start > _FIRST_DATE
        day = (datetime.fromtimestamp(start).date() if dated else date.today()).isoformat()
        self.recordings.append(Remembered(name, start, day, kept.with_(
            recording=np.zeros(len(kept), dtype=int), arm=None)))
        self.recordings.sort(key=lambda one: (one.day, one.start))
        return True

    def with_new(self, recorded: Sequence[tuple[Samples, RecordingInfo]]) -> list[Samples]:
        """Keep new recordings; return what is kept of all."""
        for samples, info in recorded:
            self.add(samples, info)
        return self.samples()

    def note(self, text: str) -> None:
        """Add a note of what was done to the drive today."""
        self.notes = sorted([*self.notes, (date.today().isoformat(), text)])

    def samples(self) -> list[Samples]:
        """Return what is kept of each recording."""
        return [one.samples.with_(recording=np.full(len(one.samples), index))
                for index, one in enumerate(self.recordings)]

    def save(self, model: str | Path) -> Path:
        """Write the history beside a model file; return its path."""
        about: dict[str, Any] = {
            'version': VERSION, 'torque_per_current': self.torque_per_current,
            'notes': self.notes, 'recordings': []}
        arrays: dict[str, Any] = {}
        for index, one in enumerate(self.recordings):
            signals = [name for name in _SIGNALS if getattr(one.samples, name) is not None]
            about['recordings'].append({
                'name': one.name, 'start': one.start, 'day': one.day, 'signals': signals,
                'joint': one.samples.joint})
            arrays.update({f'{index}/{name}': getattr(one.samples, name) for name in signals})
        stream = io.BytesIO()
        np.savez_compressed(stream, about=np.array(json.dumps(about)), **arrays)
        path = self.path_of(model)
        write_atomically(path, stream.getvalue())
        return path
