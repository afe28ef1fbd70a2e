# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The files of a bag, mcap or sqlite3, and the messages in them, in the order of the files.

A file is read up to its end, or to the first part that is damaged or missing, and a note says so.
Libraries give records; they refuse a file whose end is missing, which the recorder of a robot that
lost its power leaves behind.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, suppress
import io
from mmap import ACCESS_READ, mmap
from pathlib import Path, PurePath
import re
import sqlite3
import struct
from urllib.parse import quote

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.stream_reader import get_chunk_data_stream
import zstandard

from friction_comp.errors import InputError, one_line
from friction_comp.files import check_input, check_unpacked, open_input, read_yaml, unpacked_file
from friction_comp.recordings import BAGS, METADATA

Message = tuple[str, str, int, bytes]
Wanted = Callable[[str, str], bool]

_ZSTD = b'\x28\xb5\x2f\xfd'
_MAGIC = b'\x89MCAP0\r\n'
# Beginning of a record, and of a message: channel, number, and times of receipt and sending, ns.
_RECORD, _MESSAGE = struct.Struct('<BQ'), struct.Struct('<HIqq')
# Largest chunk of messages and largest compressed message, bytes when unpacked.
_LARGEST_CHUNK, _LARGEST_MESSAGE = 500_000_000, 1_000_000


class Storage:
    """Reads the messages of a rosbag2 folder or a single file; raises InputError if unreadable."""

    def __init__(self, path: Path) -> None:
        self.path = path
        # Message type and number of messages of each topic, and notes on missing or damaged parts;
        # all are complete after `messages` has ended.
        self.kinds: dict[str, str] = {}
        self.counts = Counter[str]()
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
            before = self.counts.total()
            try:
                with unpacked_file(file) as plain:
                    yield from _READERS[plain.suffix](self, plain, wanted)
            # What is damaged may raise anything.
            except Exception as error:
                damage = 'damaged or not finished: ' + (
                    'a part of it is missing' if isinstance(error, (LookupError, struct.error))
                    else one_line(error))
                if count := self.counts.total() - before:
                    self.notes.append(f'{file.name}: {damage}: {count} messages before that were '
                                      'read')
                else:
                    failed.append(f'{file.name}: {damage}')
        if len(failed) == len(self.files):
            raise unreadable(self.path, '; '.join(failed))
        self.notes.extend(f'{reason}: this file is missing' for reason in failed)

    def declare(self, topic: str, kind: str, wanted: Wanted, encoding: str) -> bool:
        """Take note of a topic, and return whether its messages are wanted."""
        self.kinds.setdefault(topic, kind)
        if chosen := wanted(topic, kind):
            if encoding not in ('cdr', ''):
                raise ValueError(f'{topic} is not serialised as CDR')
        return chosen

    def _list_files(self) -> list[Path]:
        """Return the files listed in the metadata, or else those in the folder."""
        files = sorted((path for path in self.path.iterdir() if path.name.endswith(BAGS)),
                       key=_by_numbers)
        try:
            about = read_yaml(self.path / METADATA, references=True)['rosbag2_bagfile_information']
            # Only the names, in this folder: metadata must not point outside of it.
            listed = [self.path / PurePath(name).name for name in about['relative_file_paths']]
            self.custom = {key: value for key, value in (about.get('custom_data') or {}).items()
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


def _read_mcap(storage: Storage, file: Path, wanted: Wanted) -> Iterator[Message]:
    schemas: dict[int, str] = {}
    # Topic and type by channel, and whether its messages are wanted.
    channels: dict[int, tuple[str, str, bool]] = {}
    with open_input(file) as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as whole:
        if whole[:len(_MAGIC)] != _MAGIC:
            raise ValueError('not an mcap file')
        for kind, packed in _records(whole, len(_MAGIC)):
            if kind == Opcode.DATA_END:
                return
            for code, content in _records(_unpacked(packed)) if kind == Opcode.CHUNK else [
                    (kind, packed)]:
                if code == Opcode.MESSAGE:
                    number, _, receive, _ = _MESSAGE.unpack_from(content)
                    topic, type_name, chosen = channels[number]
                    storage.counts[topic] += 1
                    if chosen:
                        yield topic, type_name, receive, content[_MESSAGE.size:]
                elif code == Opcode.SCHEMA:
                    schema = records.Schema.read(_stream(content))
                    schemas[schema.id] = schema.name
                elif code == Opcode.CHANNEL:
                    own = records.Channel.read(_stream(content))
                    type_name = schemas.get(own.schema_id, '')
                    channels[own.id] = own.topic, type_name, storage.declare(
                        own.topic, type_name, wanted, own.message_encoding)


def _records(data: bytes | mmap, at: int = 0) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of the records of a file, or of a chunk in it."""
    while at < len(data):
        code, length = _RECORD.unpack_from(data, at)
        begin, at = at + _RECORD.size, at + _RECORD.size + length
        if at > len(data):
            raise LookupError
        yield code, data[begin:at]


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(content))


def _unpacked(content: bytes) -> bytes:
    """Return a chunk's records; an error if it unpacks to more than it says, or than any holds."""
    chunk = records.Chunk.read(_stream(content))
    size, packed = chunk.uncompressed_size, chunk.data
    check_unpacked('a chunk', size, len(packed))
    said = zstandard.frame_content_size(packed) if chunk.compression == 'zstd' else -1
    if size > _LARGEST_CHUNK or said not in (-1, size):
        raise ValueError(f'a chunk of {max(size, said)} bytes')
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    return stream.read(size)


def _read_sqlite(storage: Storage, file: Path, wanted: Wanted) -> Iterator[Message]:
    # Nothing is written beside it, unless it has a log that is not yet merged.
    logged = check_input(file).with_name(f'{file.name}-wal').exists()
    options = 'mode=ro' if logged else 'mode=ro&immutable=1'
    with closing(sqlite3.connect(f'file:{quote(str(file.absolute()))}?{options}', uri=True)
                 ) as database:
        # A view, or a virtual table, could yield rows without end.
        stored = dict(database.execute('SELECT name, sql FROM sqlite_master'))
        if not all(str(stored.get(name)).startswith('CREATE TABLE')
                   for name in ('topics', 'messages')):
            raise ValueError('not a database of rosbag2')
        topics = {key: (str(topic), str(kind), storage.declare(
            str(topic), str(kind), wanted, encoding)) for key, topic, kind, encoding in
            database.execute('SELECT id, name, type, serialization_format FROM topics ORDER BY id')}
        for key, time, payload in database.execute(
                'SELECT topic_id, timestamp, data FROM messages ORDER BY id'):
            topic, kind, chosen = topics[key]
            storage.counts[topic] += 1
            if chosen:
                yield topic, kind, int(time), bytes(payload)


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
