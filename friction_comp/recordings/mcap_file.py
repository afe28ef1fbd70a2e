# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads mcap files, including the undamaged chunks of truncated or corrupt ones.

The library `mcap` parses records and unpacks chunks, but its readers stop at the first invalid
record. This one continues after damage with the next chunk whose checksum is valid.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Callable, Iterator
from io import BytesIO
import mmap
from pathlib import Path
import re
import struct
from typing import Any
import zlib

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Footer, Metadata, Schema, Statistics
from mcap.stream_reader import get_chunk_data_stream, StreamReader

from friction_comp.files import open_input, parse_yaml

Message = tuple[str, str, int, bytes]
Wanted = Callable[[str, str], bool]

MAGIC = b'\x89MCAP0\r\n'
_HEADER = struct.Struct('<BQ')
_MESSAGE = struct.Struct('<BQHIQQ')
# A chunk begins with its opcode, a length below 2^48, two times, size, checksum and the name of the
# compression. False matches are rare, and the checksum rejects them.
_CHUNK = re.compile(rb'(?=\x06.{6}\x00\x00.{28}(?:\x00{4}|\x03\x00{3}lz4|\x04\x00{3}zstd))', re.S)
_KNOWN = {int(code) for code in Opcode}
_FIXED_SIZES = {int(Opcode.FOOTER): 20, int(Opcode.DATA_END): 4}
_FOOTER_SIZE = _HEADER.size + 20 + len(MAGIC)
_DESCRIPTIONS: dict[int, Any] = {
    int(Opcode.SCHEMA): Schema, int(Opcode.CHANNEL): Channel, int(Opcode.METADATA): Metadata}


class DamagedError(ValueError):
    """A file that cannot be read; the text says why."""


class MessageFile(ABC):
    """A file of messages; notes and counts are complete after `messages` has ended."""

    def __init__(self) -> None:
        self.notes: list[str] = []              # on missing or damaged parts
        # Topic to (message type, number of messages), of the part that has been read.
        self.topics: dict[str, tuple[str, int]] = {}
        self.encodings: dict[str, str] = {}     # topic to serialisation
        self.custom: dict[str, str] = {}        # custom_data of rosbag2's metadata
        self.progress = 0.0                     # share of the file that has been read

    @abstractmethod
    def close(self) -> None:
        """Close the file."""

    @abstractmethod
    def messages(self, wanted: Wanted) -> Iterator[Message]:
        """Yield (topic, type, receive time in ns, payload) of messages in the order of the file.

        Only messages for which `wanted(topic, type)` is true are yielded; all are counted. Raises
        DamagedError if the file has no readable record at all.
        """

    def count(self, topic: str, messages: int) -> None:
        """Add to the number of a topic's messages."""
        kind, before = self.topics[topic]
        self.topics[topic] = kind, before + messages


class McapFile(MessageFile):
    """One mcap file; raises DamagedError if it is empty."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, str] = {}
        self._message_count = 0
        self._lost_chunks = 0
        self._lost_messages = 0
        self._unreadable: list[int] = []
        self._size = path.stat().st_size
        if not self._size:
            raise DamagedError('the file is empty')
        self._position = 0
        self._file = open_input(path)
        self._expected: int | None = None
        self._footer = self._read_footer()
        if self._footer is not None and self._footer.summary_start:
            self._read_summary(self._footer)

    def close(self) -> None:
        self._file.close()

    def messages(self, wanted: Wanted) -> Iterator[Message]:
        self._file.seek(0)
        begin = self._file.read(len(MAGIC))
        if begin != MAGIC:
            if self._next_chunk(0) is None:
                raise DamagedError('it is not an mcap file (wrong first bytes and no chunk)')
            self.notes.append('its first bytes are damaged')
        opcode, checksum = 0, zlib.crc32(begin)
        for record in self._records():
            opcode = record[0]
            if opcode == Opcode.DATA_END:
                break
            checksum = zlib.crc32(record, checksum)
            if opcode == Opcode.CHUNK:
                content = _unpack_chunk(record)
                if content is None:
                    self._lost_chunks += 1
                else:
                    yield from self._iterate(content, wanted)
            elif opcode == Opcode.MESSAGE or opcode in _DESCRIPTIONS:
                yield from self._iterate(record, wanted)
        ended = opcode == Opcode.DATA_END
        self._report_damage(ended)
        if ended and not self.notes:
            expected = int.from_bytes(record[_HEADER.size:], 'little')
            if expected not in (0, checksum):
                self.notes.append('damaged outside its messages (checksum of the data)')

    def _records(self) -> Iterator[bytes]:
        """Yield the records of the data section; damaged parts are skipped."""
        # A corrupt length leads to an arbitrary position: resume from the last valid chunk.
        at = last_valid = len(MAGIC)
        while at < self._size:
            self._position, self.progress = at, at / self._size
            record = self._record_at(at)
            if record is None:
                following = self._next_chunk(last_valid)
                if following is not None or self._footer is not None:
                    self._unreadable.append(at)
                if following is None:
                    return
                at = following
                continue
            yield record
            at += len(record)
            if record[0] == Opcode.CHUNK:
                last_valid = at
        self._position = at

    def _record_at(self, at: int) -> bytes | None:
        self._file.seek(at)
        header = self._file.read(_HEADER.size)
        if len(header) < _HEADER.size:
            return None
        opcode, length = _HEADER.unpack(header)
        if (opcode not in _KNOWN or length != _FIXED_SIZES.get(opcode, length)
                or at + len(header) + length > self._size):
            return None
        record = header + self._file.read(length)
        return None if opcode == Opcode.CHUNK and not _CHUNK.match(record) else record

    def _next_chunk(self, start: int) -> int | None:
        data = mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ)
        for match in _CHUNK.finditer(data, start):
            record = self._record_at(match.start())
            if record is not None and _unpack_chunk(record) is not None:
                return match.start()
        return None

    def _iterate(self, content: bytes, wanted: Wanted) -> Iterator[Message]:
        """Yield the messages in a sequence of records, and store the descriptions of topics."""
        at, stop = 0, len(content)
        requested: dict[int, tuple[str, str] | None] = {}
        counts: defaultdict[int, int] = defaultdict(int)
        message = int(Opcode.MESSAGE)
        while at + _HEADER.size <= stop:
            opcode, length = _HEADER.unpack_from(content, at)
            end = at + _HEADER.size + length
            if end > stop or (opcode == message and length < 22):
                self._lost_chunks += 1
                break
            if opcode == message:
                _, _, channel, _, time, _ = _MESSAGE.unpack_from(content, at)
                counts[channel] += 1
                if channel not in requested:
                    topic = self._channels.get(channel, '')
                    kind = self.topics[topic][0] if topic else ''
                    requested[channel] = (topic, kind) if topic and wanted(topic, kind) else None
                topic_and_type = requested[channel]
                if topic_and_type is not None:
                    yield *topic_and_type, time, content[at + _MESSAGE.size:end]
            elif opcode in _DESCRIPTIONS:
                self._read_description(opcode, content[at + _HEADER.size:end])
                requested.clear()
            at = end
        for channel, count in counts.items():
            self._message_count += count
            if channel in self._channels:
                self.count(self._channels[channel], count)
            else:
                self._lost_messages += count

    def _read_description(self, opcode: int, content: bytes) -> None:
        try:
            self._add(_DESCRIPTIONS[opcode].read(ReadDataStream(BytesIO(content))))
        # Without a checksum, a corrupt record may raise anything.
        except Exception:
            self.notes.append('a description of its contents is damaged')

    def _add(self, record: object) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = record.name
        elif isinstance(record, Channel):
            self._channels[record.id] = record.topic
            self.encodings[record.topic] = record.message_encoding
            kind, count = self.topics.get(record.topic, ('', 0))
            self.topics[record.topic] = self._schemas.get(record.schema_id, kind), count
        elif isinstance(record, Statistics):
            self._expected = record.message_count
        elif isinstance(record, Metadata) and record.name == 'rosbag2':
            metadata = parse_yaml(
                record.metadata.get('serialized_metadata', ''), 'metadata', long=True) or {}
            custom = metadata.get('custom_data') or {}
            self.custom.update({str(key): str(value) for key, value in custom.items()})

    def _read_footer(self) -> Footer | None:
        self._file.seek(max(self._size - _FOOTER_SIZE, 0))
        try:
            footer, = StreamReader(BytesIO(self._file.read()), skip_magic=True).records
        # Anything may be there instead of a footer.
        except Exception:
            return None
        return footer if isinstance(footer, Footer) else None

    def _read_summary(self, footer: Footer) -> None:
        self._file.seek(footer.summary_start)
        summary = self._file.read()
        try:
            if footer.summary_crc not in (0, zlib.crc32(summary[:-len(MAGIC) - 4])):
                raise DamagedError
            for record in StreamReader(BytesIO(summary), skip_magic=True).records:
                self._add(record)
        except Exception:
            self.notes.append('the index at its end is damaged')

    def _report_damage(self, ended: bool) -> None:
        if self._lost_chunks:
            self.notes.append(f'{self._lost_chunks} damaged chunks left out (checksum)')
        if self._lost_messages:
            self.notes.append(f'{self._lost_messages} messages are of topics that were lost')
        if self._unreadable:
            more = len(self._unreadable) - 1
            self.notes.append(f'unreadable at byte {self._unreadable[0]}'
                              + (f' and {more} further places' if more else ''))
        if not ended and self._footer is None:
            if not self._message_count:
                raise DamagedError('it is truncated before the end of its first chunk')
            behind = self._size - self._position
            self.notes.append(
                f'it was not finished: {self._message_count} messages recovered'
                + (f', {behind} bytes after them are an incomplete chunk' if behind else ''))
        elif self._footer is None:
            self.notes.append('the index at its end is missing')
        if self._expected is not None and self._message_count < self._expected:
            self.notes.append(
                f'{self._expected - self._message_count} of {self._expected} messages are missing')
        self.progress = 1.0


def _unpack_chunk(record: bytes) -> bytes | None:
    """Return the records in a chunk; None if it is damaged."""
    try:
        chunk = Chunk.read(ReadDataStream(BytesIO(record[_HEADER.size:])))
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        return stream.read(size) if size == chunk.uncompressed_size else None
    # Each compression library has its own exceptions.
    except Exception:
        return None
