# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Lists the files of a recording by ROS and reads their messages in order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from functools import partial
import os
from os import PathLike
from pathlib import Path, PurePath
import re
import shutil
import sqlite3
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

import zstandard

from friction_comp.errors import InputError, one_line
from friction_comp.files import read_yaml
from friction_comp.recordings.mcap_file import DamagedError, McapFile, Message, MessageFile, Wanted

AnyPath = str | PathLike[str]

SUFFIXES = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd', '.bag')
METADATA = 'metadata.yaml'
_ZSTD = b'\x28\xb5\x2f\xfd'


def is_storage(path: Path) -> bool:
    """Return whether a file contains messages, judging by its name."""
    return path.name.endswith(SUFFIXES)


def is_split_recording(folder: Path) -> bool:
    """Return whether a folder without metadata contains files that rosbag2 named after it."""
    pattern = re.compile(re.escape(folder.name) + r'_\d+\.(mcap|db3)(\.zstd)?')
    files = [path.name for path in folder.iterdir() if is_storage(path)]
    return bool(files) and all(pattern.fullmatch(name) for name in files)


class Storage:
    """Reads the messages of a rosbag2 folder or a single file; raises InputError if unreadable."""

    def __init__(self, path: Path) -> None:
        self.path = path
        # Topic to (message type, number of messages), and notes on missing or damaged parts; both
        # are complete after `messages` has ended.
        self.topics: dict[str, tuple[str, int]] = {}
        self.notes: list[str] = []
        self.custom: dict[str, str] = {}    # custom_data of the metadata
        self.progress = 0.0                 # share of the recording that has been read
        self.files = [path] if path.is_file() else self._list_files()

    def messages(self, wanted: Wanted) -> Iterator[Message]:
        """Yield the messages of all files in their order, as `McapFile.messages` does.

        Raises InputError if none of the files can be read, or wanted messages are not CDR.
        """
        failed: list[tuple[str, str]] = []
        for index, file in enumerate(self.files):
            try:
                with TemporaryDirectory() as folder, closing(_open(file, Path(folder))) as opened:
                    for message in opened.messages(partial(self._is_wanted, wanted, opened)):
                        self.progress = (index + opened.progress) / len(self.files)
                        yield message
                    self._add_contents(file, opened)
            except (DamagedError, OSError) as error:
                failed.append((file.name, getattr(error, 'strerror', None) or str(error)))
        reasons = [f'{name}: {reason}' for name, reason in failed]
        if len(failed) == len(self.files):
            raise unreadable(self.path, '; '.join(reasons) if len(failed) > 1 else failed[0][1])
        self.notes.extend(f'{reason}: this file is missing' for reason in reasons)

    def _is_wanted(self, wanted: Wanted, opened: MessageFile, topic: str, kind: str) -> bool:
        if wanted(topic, kind):
            if opened.encodings.get(topic) not in ('cdr', '', None):
                raise InputError(f'{self.path}: {topic} is not serialised as CDR')
            return True
        return False

    def _add_contents(self, file: Path, opened: MessageFile) -> None:
        several = len(self.files) > 1
        self.notes.extend(f'{file.name}: {note}' if several else note for note in opened.notes)
        for topic, (kind, count) in opened.topics.items():
            self.topics[topic] = kind, self.topics.get(topic, (kind, 0))[1] + count
        self.custom = {**opened.custom, **self.custom}

    def _list_files(self) -> list[Path]:
        """Return the files listed in the metadata, or else those in the folder."""
        files = sorted((path for path in self.path.iterdir() if is_storage(path)),
                       key=lambda path: natural_key(path.name))
        if not (self.path / METADATA).is_file():
            self.notes.append(f'{METADATA} is missing: files are read in the order of their names')
            return files
        try:
            listed = self._read_metadata()
        except InputError:
            if not files:
                raise
            self.notes.append(f'{METADATA} is damaged: files are read in the order of their names')
            return files
        missing = [path.name for path in listed if not path.is_file()]
        if missing and len(missing) == len(listed):
            raise unreadable(self.path, f'{METADATA} lists {", ".join(missing)}, which is not here')
        if missing:
            self.notes.append(f'{len(missing)} of its {len(listed)} files are missing: '
                              f'{", ".join(missing)}')
        return [path for path in listed if path.is_file()]

    def _read_metadata(self) -> list[Path]:
        try:
            information: Any = read_yaml(
                self.path / METADATA, long=True)['rosbag2_bagfile_information']
            # Only the names, in this folder: metadata must not point outside of it.
            files = [self.path / PurePath(name).name for name in information['relative_file_paths']]
            custom = information.get('custom_data') or {}
            self.custom = {str(key): str(value) for key, value in custom.items()}
        except OSError as error:
            raise unreadable(self.path, f'{METADATA}: {error.strerror or error}') from None
        except Exception as error:
            raise unreadable(self.path, f'{METADATA}: {one_line(error)}') from None
        if not files:
            raise unreadable(self.path, f'{METADATA} lists no file')
        return files


def unreadable(path: Path, reason: str) -> InputError:
    """Return the error for an unreadable recording."""
    return InputError(f'{path}: not a readable recording: {reason}')


@contextmanager
def unreadable_on_error(path: Path) -> Iterator[None]:
    """Turn any error but InputError, as libraries raise for corrupt files, into `unreadable`."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        raise unreadable(path, getattr(error, 'strerror', None) or one_line(error)) from None


def unpack(payload: bytes) -> bytes:
    """Return a message, decompressed if rosbag2 compressed it and it is not damaged."""
    if payload[:4] == _ZSTD:
        with suppress(zstandard.ZstdError):
            return zstandard.ZstdDecompressor().decompressobj().decompress(payload)
    return payload


def natural_key(name: str) -> list[str | int]:
    """Return a key that sorts names by their numbers, 2 before 10."""
    return [int(part) if part.isdigit() else part for part in re.split(r'(\d+)', name)]


def _open(file: Path, folder: Path) -> MessageFile:
    if file.suffix == '.zstd':
        plain = folder / file.stem
        with file.open('rb') as packed, plain.open('wb') as stream:
            try:
                with zstandard.ZstdDecompressor().stream_reader(
                        packed, read_across_frames=True) as source:
                    shutil.copyfileobj(source, stream)
            except zstandard.ZstdError as error:
                if not stream.tell():
                    raise DamagedError(f'not compressed with zstd: {error}') from None
        file = plain
    if file.suffix == '.bag':
        # The types of rosbags take a second to import.
        from friction_comp.recordings.ros1_bag import Ros1Bag

        return Ros1Bag(file)
    return McapFile(file) if file.suffix == '.mcap' else SqliteFile(file, folder)


def _database_uri(path: Path, folder: Path) -> str:
    """Return how to open a database without writing beside it; `folder` is for a copy, if needed.

    A database with a write-ahead log (rosbag2's preset ``resilient``) else needs a writable folder.
    """
    log, options = path.with_name(f'{path.name}-wal'), 'mode=ro'
    if not log.exists():
        with path.open('rb') as file:
            if file.read(20)[18:] == b'\x02\x02':
                options = 'mode=ro&immutable=1'     # all is in the file, and nobody writes
    elif not os.access(path.parent, os.W_OK):
        for part in (path, log):
            shutil.copyfile(part, folder / part.name)
        path = folder / path.name
    return f'file:{quote(str(path))}?{options}'


class SqliteFile(MessageFile):
    """One .db3 file; raises DamagedError if it is not a database with rosbag2's tables."""

    def __init__(self, path: Path, folder: Path) -> None:
        super().__init__()
        self._database = sqlite3.connect(_database_uri(path, folder), uri=True)
        try:
            rows = self._database.execute(
                'SELECT id, name, type, serialization_format FROM topics ORDER BY id').fetchall()
            self._last = self._database.execute('SELECT max(id) FROM messages').fetchone()[0] or 1
        except sqlite3.Error as error:
            self._database.close()
            raise DamagedError(f'not a rosbag2 database: {error}') from None
        self._by_id = {row[0]: (str(row[1]), str(row[2])) for row in rows}
        self.topics = {str(row[1]): (str(row[2]), 0) for row in rows}
        self.encodings = {str(row[1]): str(row[3]) for row in rows}

    def close(self) -> None:
        self._database.close()

    def messages(self, wanted: Wanted) -> Iterator[Message]:
        topic_ids = [k for k, topic_and_type in self._by_id.items() if wanted(*topic_and_type)]
        recovered = 0
        try:
            for row, topic, time, payload in self._database.execute(
                    'SELECT id, topic_id, timestamp, data FROM messages WHERE topic_id IN '
                    f'({",".join("?" * len(topic_ids))}) ORDER BY id', topic_ids):
                recovered += 1
                self.progress = row / self._last
                yield *self._by_id[topic], int(time), bytes(payload)
            for topic, count in self._database.execute(
                    'SELECT topic_id, count(*) FROM messages GROUP BY topic_id'):
                if topic in self._by_id:
                    self.count(self._by_id[topic][0], int(count))
        except (sqlite3.Error, TypeError) as error:
            if not recovered:
                raise DamagedError(f'the database is damaged: {error}') from None
            self.notes.append(f'the database is damaged ({error}): {recovered} messages recovered')
        self.progress = 1.0
