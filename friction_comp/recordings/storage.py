# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The files of a bag: mcap, sqlite3 or ROS 1, and the messages in them, in the order of the files.

A file is read up to its end, or to the first part that is damaged or missing, and a note says so.
"""

from __future__ import annotations

from bz2 import BZ2Decompressor
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager, suppress
from io import BytesIO
from os import PathLike
from pathlib import Path, PurePath
import re
import sqlite3
import struct
from typing import Any, BinaryIO
from urllib.parse import quote
import zlib

from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata, Schema
import zstandard

from friction_comp.errors import InputError, one_line
from friction_comp.files import check_unpacked, open_input, read_yaml, unpacked_file
from friction_comp.plain_yaml import parse_yaml

AnyPath = str | PathLike[str]
Message = tuple[str, str, int, bytes]
Wanted = Callable[[str, str], bool]

SUFFIXES = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd', '.bag')
METADATA = 'metadata.yaml'
_ZSTD = b'\x28\xb5\x2f\xfd'
_MAGIC = b'\x89MCAP0\r\n'
_RECORD, _MESSAGE = struct.Struct('<BQ'), struct.Struct('<HIQQ')
# Largest chunk of messages and largest compressed message, bytes when unpacked.
_LARGEST_CHUNK, _LARGEST_MESSAGE = 500_000_000, 1_000_000


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
        self._index = 0                     # of the file that is read

    def messages(self, wanted: Wanted) -> Generator[Message, None, None]:
        """Yield (topic, type, receive time in ns, payload) of the messages of all files.

        Only messages for which `wanted(topic, type)` is true are yielded; all are counted. Raises
        InputError if there are none at all before the first damage, or those wanted are not CDR.
        """
        failed = []
        for index, file in enumerate(self.files):
            self._index = index
            count = Counter(dict.fromkeys(self.topics, 0))
            try:
                with unpacked_file(file) as plain:
                    yield from _READERS[plain.suffix](self, plain, wanted, count)
                self.reached(1.0)
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

    def reached(self, share: float) -> None:
        """Take note of how much of the current file has been read, 0..1."""
        self.progress = (self._index + share) / len(self.files)

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
        files = sorted((path for path in self.path.iterdir() if is_storage(path)),
                       key=lambda path: natural_key(path.name))
        listed = []
        try:
            about = read_yaml(self.path / METADATA, references=True)['rosbag2_bagfile_information']
            # Only the names, in this folder: metadata must not point outside of it.
            listed = [self.path / PurePath(name).name for name in about['relative_file_paths']]
            self.add_custom(about)
        except Exception as error:
            why = 'damaged' if (self.path / METADATA).exists() else 'missing'
            if not files:
                raise unreadable(self.path, f'{METADATA}: {one_line(error)}') from None
            self.notes.append(f'{METADATA} is {why}: files are read in the order of their names')
        missing = [path.name for path in listed if not path.is_file()]
        found = [path for path in listed if path.is_file()]
        if missing and not found:
            raise unreadable(self.path, f'{METADATA} lists {", ".join(missing)}, which is not here')
        if missing:
            self.notes.append(f'{len(missing)} of its {len(listed)} files are missing: '
                              f'{", ".join(missing)}')
        if not found and not files:
            raise unreadable(self.path, f'{METADATA} lists no file')
        return found or files

    def add_custom(self, metadata: Any) -> None:
        """Take over the texts in custom_data of rosbag2's metadata."""
        custom = metadata.get('custom_data') if isinstance(metadata, dict) else None
        if isinstance(custom, dict):
            self.custom = {**{key: value for key, value in custom.items()
                              if isinstance(key, str) and isinstance(value, str)}, **self.custom}


def _read_mcap(storage: Storage, file: Path, wanted: Wanted, count: Counter[str]
               ) -> Iterator[Message]:
    schemas: dict[int, str] = {}
    # Topic and type by channel, and those of the channels that are wanted.
    channels: dict[int, tuple[str, str]] = {}
    chosen: dict[int, tuple[str, str]] = {}
    with open_input(file) as stream:
        for opcode, content in _mcap_records(storage, stream, file.stat().st_size):
            if opcode == Opcode.MESSAGE:
                channel, _, time, _ = _MESSAGE.unpack_from(content)
                count[channels[channel][0]] += 1
                if channel in chosen:
                    yield *chosen[channel], time, content[_MESSAGE.size:]
                continue
            record = ReadDataStream(BytesIO(content))
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(record)
                schemas[schema.id] = schema.name
            elif opcode == Opcode.CHANNEL:
                said = Channel.read(record)
                channels[said.id] = said.topic, schemas.get(said.schema_id, '')
                if storage.declare(*channels[said.id], wanted, said.message_encoding):
                    chosen[said.id] = channels[said.id]
            elif opcode == Opcode.METADATA:
                about = Metadata.read(record)
                if about.name == 'rosbag2':
                    # Damaged metadata cost nothing that was measured.
                    with suppress(InputError):
                        storage.add_custom(parse_yaml(about.metadata.get(
                            'serialized_metadata', ''), 'metadata', references=True))


def _mcap_records(storage: Storage, stream: BinaryIO, size: int) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of the records before an mcap file's index, those in chunks, too."""
    if stream.read(len(_MAGIC)) != _MAGIC:
        raise ValueError('not an mcap file' if size else 'empty')
    at, checksum = len(_MAGIC), zlib.crc32(_MAGIC)
    while True:
        storage.reached(at / size)
        header = stream.read(_RECORD.size).ljust(_RECORD.size, b'\0')
        opcode, length = _RECORD.unpack(header)
        at += _RECORD.size + length
        if not opcode or at > size:
            raise ValueError(f'it ends at byte {size}')
        content = stream.read(length)
        if opcode == Opcode.DATA_END:
            if int.from_bytes(content, 'little') not in (0, checksum):
                raise ValueError('the checksum of all its records is wrong')
            return
        checksum = zlib.crc32(content, zlib.crc32(header, checksum))
        if opcode != Opcode.CHUNK:
            yield opcode, content
            continue
        begin, plain = 0, _unpacked_chunk(content)
        while begin < len(plain):
            inner, length = _RECORD.unpack(
                plain[begin:begin + _RECORD.size].ljust(_RECORD.size, b'\xff'))
            begin += _RECORD.size + length
            if begin > len(plain):
                raise ValueError('a record reaches beyond its chunk')
            yield inner, plain[begin - length:begin]


def _unpacked_chunk(record: bytes) -> bytes:
    chunk = Chunk.read(ReadDataStream(BytesIO(record)))
    size, data = chunk.uncompressed_size, chunk.data
    _check_chunk(size, len(data))
    if chunk.compression == 'zstd':
        data = zstandard.ZstdDecompressor().stream_reader(data).read(size)
    elif chunk.compression == 'lz4':
        data = LZ4FrameDecompressor().decompress(data, max_length=size)
    elif chunk.compression:
        raise ValueError(f'a chunk compressed with {chunk.compression!r}')
    if len(data) != size or chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError('the checksum of a chunk is wrong')
    return data


def _check_chunk(size: int, packed: int) -> None:
    check_unpacked('a chunk', size, packed)
    if size > _LARGEST_CHUNK:
        raise InputError(f'a chunk of {size} bytes, more than {_LARGEST_CHUNK}')


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
        last = database.execute('SELECT max(id) FROM messages').fetchone()[0] or 1
        for row, key, time, payload in database.execute(
                'SELECT id, topic_id, timestamp, data FROM messages ORDER BY id'):
            count[topics[key][0]] += 1
            if key in chosen:
                storage.reached(row / last)
                yield *topics[key], int(time), bytes(payload)


def _connect(file: Path) -> sqlite3.Connection:
    """Open a database without writing beside it, unless it has a log that is not yet merged."""
    with open_input(file) as stream:
        logged = stream.read(20)[18:] == b'\x02\x02' and file.with_name(f'{file.name}-wal').exists()
    options = 'mode=ro' if logged else 'mode=ro&immutable=1'
    return sqlite3.connect(f'file:{quote(str(file.absolute()))}?{options}', uri=True)


def _read_ros1(storage: Storage, file: Path, wanted: Wanted, count: Counter[str]
               ) -> Iterator[Message]:
    """Yield the messages of a ROS 1 bag as those of ROS 2, in the order of time."""
    # The types of rosbags take a second to import.
    from rosbags.rosbag1 import Reader
    from rosbags.typesys import get_typestore, Stores

    open_input(file).close()
    types = get_typestore(Stores.ROS2_JAZZY)
    with Reader(file) as reader:
        for at, chunk in reader.chunks.items():
            reader.chunks[at] = chunk._replace(decompressor=_ros1_chunk)
        chosen = [one for one in reader.connections
                  if storage.declare(one.topic, one.msgtype, wanted)]
        for one in reader.connections:
            if one not in chosen:
                count[one.topic] += one.msgcount
        total = max(sum(one.msgcount for one in chosen), 1)
        for number, (one, time, raw) in enumerate(reader.messages(chosen) if chosen else ()):
            storage.reached(number / total)
            count[one.topic] += 1
            yield one.topic, one.msgtype, int(time), bytes(types.ros1_to_cdr(raw, one.msgtype))


def _ros1_chunk(data: bytes) -> bytes:
    """Return what a chunk of a ROS 1 bag holds, by how it begins: bz2, LZ4 or plain records."""
    if data[:3] == b'BZh':
        plain = BZ2Decompressor().decompress(data, _LARGEST_CHUNK)
    elif data[:4] == b'\x04\x22\x4d\x18':
        plain = LZ4FrameDecompressor().decompress(data, max_length=_LARGEST_CHUNK)
    else:
        return data
    _check_chunk(len(plain), len(data))
    return plain


_READERS = {'.mcap': _read_mcap, '.db3': _read_sqlite, '.bag': _read_ros1}


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
            return zstandard.ZstdDecompressor().stream_reader(payload).read(_LARGEST_MESSAGE)
    return payload


def natural_key(name: str) -> list[str | int]:
    """Return a key that sorts names by their numbers, 2 before 10."""
    return [int(part) if part.isdigit() else part for part in re.split(r'(\d+)', name)]
