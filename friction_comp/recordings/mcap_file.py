# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads mcap files, including the undamaged chunks of truncated or corrupt ones.

The library `mcap` parses records, decompresses chunks and verifies their checksums, but its readers
stop at the first invalid record. This reader iterates over the records itself, and continues after
damage with the next chunk whose checksum is valid.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from io import BytesIO
import mmap
from pathlib import Path
import re
import struct
from types import TracebackType
import zlib

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Footer, MessageIndex, Metadata, Schema, Statistics
from mcap.stream_reader import get_chunk_data_stream
import yaml

Message = tuple[str, str, int, bytes]
Wanted = Callable[[str, str], bool]

MAGIC = b'\x89MCAP0\r\n'
_RECORD = struct.Struct('<BQ')
_MESSAGE = struct.Struct('<BQHIQQ')
_FOOTER_SIZE = 20
_BLOCK = 1 << 20
# Bytes of the mapped file that may stay in memory.
_KEPT = 1 << 25
# A chunk begins with its opcode, a length below 2^48, two times, size, checksum and the name of the
# compression. False matches are rare, and the checksum rejects them.
_CHUNK = re.compile(rb'(?=\x06.{6}\x00\x00.{28}(?:\x00{4}|\x03\x00{3}lz4|\x04\x00{3}zstd))', re.S)
_KNOWN = {int(code) for code in Opcode}
_FIXED_SIZES = {int(Opcode.FOOTER): _FOOTER_SIZE, int(Opcode.DATA_END): 4}


class DamagedError(ValueError):
    """A file that cannot be read; the text says why."""


class McapFile:
    """One mcap file.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    topics : dict
        Topic to (message type, number of messages), as far as the file has been read.
    notes : list of str
        Remarks on missing or damaged parts; complete after `messages` has ended.
    custom : dict
        ``custom_data`` of rosbag2's metadata in the file.
    encodings : dict
        Topic to serialisation.

    Raises
    ------
    DamagedError
        If nothing in the file can be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notes: list[str] = []
        self.topics: dict[str, tuple[str, int]] = {}
        self.encodings: dict[str, str] = {}
        self.custom: dict[str, str] = {}
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, str] = {}
        self._message_count = 0
        self._lost_chunks = 0
        self._lost_messages = 0
        self._unreadable: list[int] = []
        self._released = 0
        with path.open('rb') as stream:
            self.size = path.stat().st_size
            if not self.size:
                raise DamagedError('the file is empty')
            self._data = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
        self.position = 0
        self._footer = self._read_footer()
        self._expected = self._read_summary()

    def __enter__(self) -> McapFile:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None,
                 traceback: TracebackType | None) -> None:
        self._data.close()

    @property
    def progress(self) -> float:
        """Share of the file that has been read."""
        return self.position / self.size

    def messages(self, wanted: Wanted) -> Iterator[Message]:
        """Yield the messages in the order of the file.

        Parameters
        ----------
        wanted : callable
            Returns whether messages of a topic and type are wanted; all are counted.

        Yields
        ------
        topic, type : str
        time : int
            Receive time (mcap's log time) in ns.
        payload : bytes

        Raises
        ------
        DamagedError
            If the file holds no readable record at all.
        """
        if self._data[:len(MAGIC)] != MAGIC and self._next_chunk(0) is None:
            raise DamagedError('it does not begin as mcap does (file magic) and holds no chunk')
        ended = False
        for opcode, begin, end in self._records():
            if opcode == Opcode.CHUNK:
                yield from self._chunk_messages(begin, end, wanted)
            elif opcode == Opcode.MESSAGE:
                yield from self._iterate(self._data[begin:end], wanted)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._declare(opcode, self._data[begin + 9:end])
            elif opcode == Opcode.METADATA:
                self._read_metadata(self._data[begin + 9:end])
            ended = opcode == Opcode.DATA_END
        self._report_damage(ended)

    def _records(self) -> Iterator[tuple[int, int, int]]:
        """Yield (opcode, begin, end) of the data section's records, past damaged places."""
        at = len(MAGIC)
        # A corrupt length leads to an arbitrary position: resume from the last valid chunk.
        last_valid = at
        while at < self.size:
            record = self._record_at(at)
            if record is None:
                following = self._next_chunk(last_valid)
                self.position = at if following is None else last_valid
                if self._footer is None and following is None:
                    return
                self._unreadable.append(at)
                if following is None:
                    return
                at = following
                continue
            opcode, end = record
            self.position = at
            yield opcode, at, end
            if opcode == Opcode.DATA_END:
                return
            at = end
            if opcode == Opcode.CHUNK:
                last_valid = end
                self._release(end)
        self.position = at

    def _release(self, end: int) -> None:
        """Release the mapped memory up to a position, in large blocks."""
        begin, end = self._released, end - end % mmap.PAGESIZE
        if end - begin > _KEPT and hasattr(self._data, 'madvise'):
            self._data.madvise(mmap.MADV_DONTNEED, begin, end - begin)
            self._released = end

    def _record_at(self, at: int) -> tuple[int, int] | None:
        """Return opcode and end of the record at a position, None if it is invalid."""
        if at + 9 > self.size:
            return None
        opcode, length = _RECORD.unpack_from(self._data, at)
        end = at + 9 + length
        if opcode not in _KNOWN or end > self.size or length != _FIXED_SIZES.get(opcode, length):
            return None
        if opcode == Opcode.CHUNK and not _CHUNK.match(self._data, at):
            return None
        return opcode, end

    def _next_chunk(self, start: int) -> int | None:
        """Return the position of the next valid chunk, or None."""
        for match in _CHUNK.finditer(self._data, start):
            record = self._record_at(match.start())
            if record is not None:
                try:
                    self._open_chunk(match.start(), record[1])
                except DamagedError:
                    continue
                return match.start()
        return None

    def _open_chunk(self, begin: int, end: int) -> bytes:
        try:
            chunk = Chunk.read(ReadDataStream(BytesIO(self._data[begin + 9:end])))
            stream, size = get_chunk_data_stream(chunk, validate_crc=True)
            content = stream.read(size)
        # Each compression library has its own exceptions.
        except Exception as error:
            raise DamagedError(f'a chunk at byte {begin}: {error}') from None
        if size != chunk.uncompressed_size:
            raise DamagedError(f'a chunk at byte {begin}: {size} bytes long')
        return content

    def _chunk_messages(self, begin: int, end: int, wanted: Wanted) -> Iterator[Message]:
        try:
            content = self._open_chunk(begin, end)
        except DamagedError:
            self._lost_chunks += 1
            self._lost_messages += self._count_indexed(end)
            return
        yield from self._iterate(content, wanted)

    def _count_indexed(self, at: int) -> int:
        """Return the number of messages in the indexes after a chunk."""
        count = 0
        while (record := self._record_at(at)) is not None and record[0] == Opcode.MESSAGE_INDEX:
            try:
                index = MessageIndex.read(ReadDataStream(BytesIO(self._data[at + 9:record[1]])))
            except Exception:
                break
            count += len(index.records)
            at = record[1]
        return count

    def _iterate(self, content: bytes, wanted: Wanted) -> Iterator[Message]:
        at, stop = 0, len(content)
        requested: dict[int, tuple[str, str] | None] = {}
        counts = dict.fromkeys(self._channels, 0)
        message = int(Opcode.MESSAGE)
        while at + 9 <= stop:
            opcode, length = _RECORD.unpack_from(content, at)
            end = at + 9 + length
            if end > stop or (opcode == message and length < 22):
                self._lost_chunks += 1
                break
            if opcode == message:
                _, _, channel, _, time, _ = _MESSAGE.unpack_from(content, at)
                counts[channel] = counts.get(channel, 0) + 1
                if channel not in requested:
                    topic = self._channels.get(channel)
                    kind = self.topics[topic][0] if topic is not None else ''
                    requested[channel] = (topic, kind) if topic is not None and wanted(
                        topic, kind) else None
                topic_and_type = requested[channel]
                if topic_and_type is not None:
                    yield *topic_and_type, time, content[at + 31:end]
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._declare(opcode, content[at + 9:end])
                requested.clear()
            at = end
        self._add_counts(counts)

    def _add_counts(self, counts: dict[int, int]) -> None:
        for channel, count in counts.items():
            self._message_count += count
            topic = self._channels.get(channel)
            if topic is None:
                self._lost_messages += count
            else:
                kind, before = self.topics[topic]
                self.topics[topic] = kind, before + count

    def _declare(self, opcode: int, content: bytes) -> None:
        try:
            self._read_declaration(opcode, ReadDataStream(BytesIO(content)))
        # There is no checksum: a corrupt record may raise anything.
        except Exception:
            self.notes.append('a description of its topics is damaged')

    def _read_declaration(self, opcode: int, stream: ReadDataStream) -> None:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas[schema.id] = schema.name
            return
        channel = Channel.read(stream)
        self._channels[channel.id] = channel.topic
        self.encodings[channel.topic] = channel.message_encoding
        kind, count = self.topics.get(channel.topic, ('', 0))
        self.topics[channel.topic] = self._schemas.get(channel.schema_id, kind), count

    def _read_metadata(self, content: bytes) -> None:
        try:
            record = Metadata.read(ReadDataStream(BytesIO(content)))
            text = record.metadata.get('serialized_metadata', '')
            metadata = yaml.safe_load(text) if record.name == 'rosbag2' else None
        except Exception:
            self.notes.append('its metadata are damaged')
            return
        custom = metadata.get('custom_data') if isinstance(metadata, dict) else None
        if isinstance(custom, dict):
            self.custom.update({str(key): str(value) for key, value in custom.items()})

    def _read_footer(self) -> Footer | None:
        if self.size < 2 * len(MAGIC) + 9 + _FOOTER_SIZE or self._data[-len(MAGIC):] != MAGIC:
            return None
        begin = self.size - len(MAGIC) - _FOOTER_SIZE - 9
        record = self._record_at(begin)
        if record is None or record[0] != Opcode.FOOTER:
            return None
        footer: Footer = Footer.read(
            ReadDataStream(BytesIO(self._data[begin + 9:record[1]])))
        return footer

    def _read_summary(self) -> int | None:
        """Read the topics of the summary and return its number of messages."""
        if self._footer is None or not self._footer.summary_start:
            return None
        begin, end = self._footer.summary_start, self.size - len(MAGIC) - 9 - _FOOTER_SIZE
        crc = self._footer.summary_crc
        if crc and zlib.crc32(self._data[begin:self.size - len(MAGIC) - 4]) != crc:
            self.notes.append('the index at its end is damaged')
            return None
        expected = None
        while begin < end and (record := self._record_at(begin)) is not None:
            opcode, stop = record
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._declare(opcode, self._data[begin + 9:stop])
            elif opcode == Opcode.STATISTICS:
                stream = ReadDataStream(BytesIO(self._data[begin + 9:stop]))
                expected = Statistics.read(stream).message_count
            begin = stop
        return expected

    def _report_damage(self, ended: bool) -> None:
        """Note what is missing or damaged."""
        if self._data[:len(MAGIC)] != MAGIC:
            self.notes.append('its first bytes are damaged')
        if self._lost_chunks:
            lost = f', {self._lost_messages} messages' if self._lost_messages else ''
            self.notes.append(f'{self._lost_chunks} damaged chunks left out (checksum{lost})')
        elif self._lost_messages:
            self.notes.append(f'{self._lost_messages} messages are of topics that were lost')
        if self._unreadable:
            more = len(self._unreadable) - 1
            self.notes.append(f'unreadable at byte {self._unreadable[0]}'
                              + (f' and {more} further places' if more else ''))
        if not ended and self._footer is None:
            if not self._message_count:
                raise DamagedError('it is truncated before the end of its first chunk')
            behind = self.size - self.position
            self.notes.append(
                f'it was not finished: {self._message_count} messages recovered'
                + (f', {behind} bytes after them are an incomplete chunk' if behind > 0 else ''))
        elif self._footer is None:
            self.notes.append('the index at its end is missing')
        if self._expected is not None and self._message_count < self._expected:
            self.notes.append(
                f'{self._expected - self._message_count} of {self._expected} messages are missing')
        if not self.notes and ended:
            self._check_data()
        self.position = self.size

    def _check_data(self) -> None:
        """Verify the checksum of the data section, if any, for damage outside the chunks."""
        expected, = struct.unpack_from('<I', self._data, self.position + 9)
        if not expected:
            return
        crc, left = 0, self.position
        with self.path.open('rb') as stream:
            while left:
                block = stream.read(min(_BLOCK, left))
                crc, left = zlib.crc32(block, crc), left - len(block)
        if crc != expected:
            self.notes.append('damaged outside its messages (checksum of the data)')
