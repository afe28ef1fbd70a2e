# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads HDF5 files as tables, as are MATLAB's of version 7.3: every dataset of numbers is columns.

A column is named by the path of its dataset, as in ``observations.qpos_1``. Groups called as
episodes are, such as ``demo_0`` and ``demo_1``, are rows one after the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
import re
from typing import Any

import numpy as np

from friction_comp.errors import InputError
from friction_comp.files import library_for
from friction_comp.recordings.row_groups import EPISODE, is_episode
from friction_comp.recordings.storage import natural_key
from friction_comp.recordings.table_base import Columns, Table

# More than this are the points of a picture, no joints.
_MOST_COLUMNS = 64
# Fewest values of states: a pair beside a number is something else.
_FEWEST_STATES = 10
_SIGNATURE = b'\x89HDF\r\n\x1a\n'
_Place = tuple[str, int | None]     # a dataset, and which of its columns; None if it is one


def is_hdf5(path: Path) -> bool:
    """Return whether a file is to be read as HDF5, by its name or, of MATLAB's, its beginning."""
    name = path.name.lower()
    if not name.endswith('.mat'):
        return name.endswith(('.h5', '.hdf5'))
    with path.open('rb') as file:
        return _SIGNATURE in file.read(1024)


def one_length(sizes: dict[str, int], table: Table) -> int:
    """Return the length of a table's columns with these; raises InputError if they have several.

    States have a value more than inputs, that after the last: it is left out, with a note.
    """
    path, size = table.path, max(sizes.values(), default=0)
    if set(sizes.values()) == {size, size - 1} and size > _FEWEST_STATES:
        longer = [name for name, count in sizes.items() if count == size]
        table.notes[:] = [
            longer[0] + f' and {len(longer) - 1} more' * (len(longer) > 1)
            + ': one value more than the rest, as states beside inputs; the last is left out']
        return size - 1
    if set(sizes.values()) - {size}:
        raise InputError(
            f'{path}: its arrays differ in length: ' + ', '.join(
                f'{name} {count}' for name, count in sizes.items())
            + '; name those of one clock with --columns time=NAME,position=NAME,effort=NAME')
    return size


def fault_of_objects(names: Sequence[str]) -> str:
    """Return why objects of MATLAB, such as a timeseries or a Dataset of Simulink, are no table."""
    return (f'{names[0]!r} is an object of MATLAB, which only MATLAB reads: save it as a table, '
            f'for instance writetimetable(extractTimetable({names[0]}), "log.csv")')


class Hdf5(Table):
    """An HDF5 file; only what is asked for is read."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._file = library_for(
            path, 'h5py', 'hdf5', 'HDF5 files, and MATLAB files of version 7.3,').File(path, 'r')
        self._episodes: dict[str, dict[str, _Place]] = {}
        self._objects: list[str] = []
        self._file.visititems(self._add)
        if not self._episodes:
            raise InputError(f'{path}: ' + (fault_of_objects(self._objects) if self._objects
                                            else 'holds no table of numbers'))
        if len(self._episodes) > 1:
            # Beside episodes only numbers are of use, which hold for all of them.
            for name, place in self._episodes.pop('', {}).items():
                if self._file[place[0]].size == 1:
                    for columns in self._episodes.values():
                        columns.setdefault(name, place)
        first, *others = self._episodes.values()
        self.names = [name for name in first if all(name in other for other in others)]
        self.names += [EPISODE] if others else []

    def _add(self, name: str, item: Any) -> None:
        """Add the columns of one of the file's items, if it is a dataset that has some."""
        # The items of MATLAB's #refs# are no signals.
        if getattr(item, 'dtype', None) is None or item.dtype.kind not in 'biuf' or (
                item.ndim > 2 or not item.size or '#' in name):
            return
        if 'MATLAB_object_decode' in item.attrs:
            self._objects.append(name)
            return
        parts = name.split('/')
        own = [part for part in parts if re.search(r'\d', part) and is_episode(part)]
        label = '.'.join(part for part in parts if part not in own)
        columns = self._episodes.setdefault('/'.join(own), {})
        if item.ndim < 2 or 1 in item.shape:
            columns[label] = name, None
        elif min(item.shape) <= _MOST_COLUMNS:
            columns.update({f'{label}_{k + 1}': (name, k) for k in range(min(item.shape))})

    def blocks(self, wanted: Sequence[str], rows: int) -> Iterator[tuple[Columns, float]]:
        waiting: list[Columns] = []
        for number, episode in enumerate(sorted(self._episodes, key=natural_key)):
            size = self._rows(self._episodes[episode], wanted)
            for first in range(0, size, rows):
                last = min(first + rows, size)
                waiting.append(self._values(number, self._episodes[episode], wanted, first, last))
                if sum(len(part[wanted[0]]) for part in waiting) >= rows:
                    yield self._joined(waiting), (number + last / size) / len(self._episodes)
                    waiting = []
        if waiting:
            yield self._joined(waiting), 1.0

    def _joined(self, parts: list[Columns]) -> Columns:
        return {name: self.numbers(np.concatenate([part[name] for part in parts]), name)
                for name in parts[0]}

    def _rows(self, places: dict[str, _Place], wanted: Sequence[str]) -> int:
        # If only the episode's number is wanted, the other columns tell how many rows it has.
        sizes = self.sizes(wanted if {*wanted} & {*places} else self.names, places)
        return one_length({name: size for name, size in sizes.items() if size > 1},
                          self) or max(sizes.values(), default=0)

    def sizes(self, names: Sequence[str], places: dict[str, _Place] | None = None
              ) -> dict[str, int]:
        """Return how many values columns have in an episode, the first by default."""
        places = places or next(iter(self._episodes.values()))
        return {name: max(self._file[places[name][0]].shape, default=1)
                for name in names if name in places}

    def _values(self, episode: int, places: dict[str, _Place], wanted: Sequence[str], first: int,
                last: int) -> Columns:
        """Return some rows of an episode's columns; one without a place is the episode's number."""
        read: dict[str, np.ndarray] = {}
        values = {}
        for name in wanted:
            dataset, column = places.get(name, ('', None))
            if dataset and dataset not in read:
                read[dataset] = _slice(self._file[dataset], first, last)
            part = read[dataset] if dataset else np.array([episode])
            part = part if column is None else part[:, column]
            values[name] = np.broadcast_to(part, last - first) if part.size == 1 else part
        return values


def _slice(dataset: Any, first: int, last: int) -> np.ndarray:
    """Return rows of a dataset, whose times are along its longer side; a number as it is."""
    if dataset.size == 1:
        return np.asarray(dataset[()]).reshape(1)
    along = int(np.argmax(dataset.shape))
    part = dataset[first:last] if along == 0 else dataset[:, first:last].T
    return np.asarray(part.reshape(-1) if 1 in dataset.shape else part)
