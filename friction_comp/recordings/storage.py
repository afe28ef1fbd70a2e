# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The files of a bag, mcap or sqlite3, and the messages in them, in the order of the files.

A file is read up to its end, or to the first part that is damaged or missing, and a note says so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, suppress
from os import PathLike
from pathlib import Path, PurePath
import re
import sqlite3
from typing import Any
from urllib.parse import quote

from mcap import records
from mcap.stream_reader import breakup_chunk, StreamReader
import zstandard

from friction_comp.errors import InputError, one_line
from friction_comp.files import check_input, check_unpacked, open_input, read_yaml, unpacked_file

AnyPath = str | PathLike[str]
Message = tuple[str, str, int, bytes]
Wanted = Callable[[str, str], bool]

SUFFIXES = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd')
METADATA = 'metadata.yaml'
_ZSTD = b'\x28\xb5\x2f\xfd'
_MAGIC = b'\x89MCAP0\r\n'
# Largest chunk of messages and largest compressed message, bytes when unpacked.
_LARGEST_CHUNK, _LARGEST_MESSAGE = 500_000_000, 1_000_000


def is_storage(path: Path) -> bool:
    """Return whether a file contains messages, judging by its name."""
    return path.name.endswith(SUFFIXES)


class Storage:
    """Reads the messages of a rosbag2 folder or a single file; raises InputError if unreadable."""

    def __init__(self, path: Path) -> None:
        self.path = path
        # Topic to (message type, number of messages), and notes on missing or damaged parts; both
        # are complete after `messages` has ended.
        self.topics: dict[str, tuple[str, int]] = {}
        self.notes: list[str] = []
        self.custom: dict[str, str] = {}    # custom_data of the metadata
        self.files = [path] if path.is_file() else self._list_files()

    def messages(self, wanted: Wanted) -> Generator[Message, None, None]:
        """Yield (topic, type, receive time in ns, payload) of the messages of all files.

        Only messages for which `wanted(topic, type)` is true are yielded; all are counted. Raises
        InputError if there are none at all before the first damage, or those wanted are not CDR.
        """
        failed = []
        for file in self.files:
            count = Counter(dict.fromkeys(self.topics, 0))
            try:
                with unpacked_file(file) as plain:
                    yield from _READERS[plain.suffix](self, plain, wanted, count)
            except InputError as error:
                raise unreadable(self.path, str(error)) from None
            # What is damaged may raise anything.
            except Exception as error:
                damage = 'damaged or not finished: ' + (
                    'a part of it is missing' if isinstance(error, LookupError)
                    else one_line(error))
                if sum(count.values()):
                    self.notes.append(f'{file.name}: {damage}: {sum(count.values())} messages '
                                      'before that were read')
                else:
                    failed.append(f'{file.name}: {damage}')
            for topic, messages in count.items():
                kind, before = self.topics[topic]
                self.topics[topic] = kind, before + messages
        if len(failed) == len(self.files):
            raise unreadable(self.path, '; '.join(failed))
        self.notes.extend(f'{reason}: this file is missing' for reason in failed)

    def declare(self, topic: str, kind: str, wanted: Wanted, encoding: str = 'cdr') -> bool:
        """Take note of a topic, and return whether its messages are wanted."""
        self.topics.setdefault(topic, (kind, 0))
        if not wanted(topic, kind):
            return False
        if encoding not in ('cdr', ''):
            raise InputError(f'{topic} is not serialised as CDR')
        return True

    def _list_files(self) -> list[Path]:
        """Return the files listed in the metadata, or else those in the folder."""
        files = sorted(filter(is_storage, self.path.iterdir()), key=_by_numbers)
        try:
            about = read_yaml(self.path / METADATA, references=True)['rosbag2_bagfile_information']
            # Only the names, in this folder: metadata must not point outside of it.
            listed = [self.path / PurePath(name).name for name in about['relative_file_paths']]
            custom = about.get('custom_data')
            self.custom = {key: value for key, value in (custom or {}).items()
                           if isinstance(key, str) and isinstance(value, str)}
        except Exception as error:
            if not files:
                raise unreadable(self.path, f'{METADATA}: {one_line(error)}') from None
            self.notes.append(f'{METADATA} is damaged: files are read in the order of their names')
            return files
        found = [path for path in listed if path.is_file()]
        missing = ', '.join(path.name for path in listed if path not in found)
        if not found:
            raise unreadable(self.path, f'{METADATA} lists {missing or "a file"}, which is not '
                             'here')
        if missing:
            self.notes.append(f'{len(listed) - len(found)} of its {len(listed)} files are missing: '
                              f'{missing}')
        return found


def _read_mcap(storage: Storage, file: Path, wanted: Wanted, count: Counter[str]
               ) -> Iterator[Message]:
    schemas: dict[int, str] = {}
    # Topic and type by channel, and whether its messages are wanted.
    channels: dict[int, tuple[str, str, bool]] = {}
    for record in _mcap_records(file):
        if isinstance(record, records.Message):
            topic, kind, chosen = channels[record.channel_id]
            count[topic] += 1
            if chosen:
                yield topic, kind, record.log_time, record.data
        elif isinstance(record, records.Schema):
            schemas[record.id] = record.name
        elif isinstance(record, records.Channel):
            topic, kind = record.topic, schemas.get(record.schema_id, '')
            channels[record.id] = topic, kind, storage.declare(
                topic, kind, wanted, record.message_encoding)


def _mcap_records(file: Path) -> Iterator[Any]:
    """Yield the records before an mcap file's index, those in chunks, too."""
    size = file.stat().st_size
    with open_input(file) as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise ValueError('not an mcap file' if size else 'empty')
        stream.seek(0)
        for record in StreamReader(stream, emit_chunks=True, validate_crcs=True,
                                   record_size_limit=size).records:
            if isinstance(record, records.DataEnd):
                return
            if isinstance(record, records.Chunk):
                _check_chunk(record)
                yield from breakup_chunk(record, validate_crc=True)
            else:
                yield record


def _check_chunk(chunk: records.Chunk) -> None:
    """Raise an error for a chunk that unpacks to more than it says, or than a recording holds."""
    size, packed = chunk.uncompressed_size, len(chunk.data)
    try:
        check_unpacked('a chunk', size, packed)
    except InputError as error:
        raise ValueError(error) from None   # what stands before it is read
    if size > _LARGEST_CHUNK:
        raise ValueError(f'a chunk of {size} bytes, more than {_LARGEST_CHUNK}')
    held = -1 if chunk.compression else packed
    if chunk.compression == 'zstd':
        held = zstandard.frame_content_size(chunk.data)
    if held not in (-1, size):
        raise ValueError('a chunk is not as large as it says')


def _read_sqlite(storage: Storage, file: Path, wanted: Wanted, count: Counter[str]
                 ) -> Iterator[Message]:
    with closing(_connect(file)) as database:
        # A view, or a virtual table, could yield rows without end.
        stored = dict(database.execute('SELECT name, sql FROM sqlite_master'))
        if not all(str(stored.get(name)).startswith('CREATE TABLE')
                   for name in ('topics', 'messages')):
            raise ValueError('not a database of rosbag2')
        topics = {key: (str(topic), str(kind)) for key, topic, kind in
                  database.execute('SELECT id, name, type FROM topics ORDER BY id')}
        chosen = {key for key, topic, encoding in database.execute(
            'SELECT id, name, serialization_format FROM topics')
            if storage.declare(*topics[key], wanted, encoding)}
        for key, time, payload in database.execute(
                'SELECT topic_id, timestamp, data FROM messages ORDER BY id'):
            count[topics[key][0]] += 1
            if key in chosen:
                yield *topics[key], int(time), bytes(payload)


def _connect(file: Path) -> sqlite3.Connection:
    """Open a database without writing beside it, unless it has a log that is not yet merged."""
    logged = check_input(file).with_name(f'{file.name}-wal').exists()
    options = 'mode=ro' if logged else 'mode=ro&immutable=1'
    return sqlite3.connect(f'file:{quote(str(file.absolute()))}?{options}', uri=True)


_READERS = {'.mcap': _read_mcap, '.db3': _read_sqlite}


def unreadable(path: Path, reason: str) -> InputError:
    """Return the error for an unreadable recording."""
    return InputError(f'{path}: not a readable recording: {reason}')


def unpack(payload: bytes) -> bytes:
    """Return a message, decompressed if rosbag2 compressed it and it is not damaged."""
    if payload[:4] == _ZSTD:
        with suppress(zstandard.ZstdError):
            return zstandard.ZstdDecompressor().stream_reader(payload).read(_LARGEST_MESSAGE)
    return payload


def _by_numbers(path: Path) -> list[str | int]:
    """Return a key that sorts names by their numbers, 2 before 10."""
    return [int(part) if part.isdigit() else part for part in re.split(r'(\d+)', path.name)]
