# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads mcap files, whole, unfinished or damaged, as far as their chunks go.

The library `mcap` describes the records, decompresses and checks chunks; its readers give up where
a file breaks off or a record makes no sense. Here the records are walked one by one, and behind a
damaged place the search for the next chunk that its own checksum confirms goes on.
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
# Bytes of the file that may stay in memory.
_KEPT = 1 << 25
# A chunk begins with its opcode, a length below 2^48, two times, size, checksum and the name of a
# compression: rare enough by chance, and the checksum decides.
_CHUNK = re.compile(rb'(?=\x06.{6}\x00\x00.{28}(?:\x00{4}|\x03\x00{3}lz4|\x04\x00{3}zstd))', re.S)
_KNOWN = {int(code) for code in Opcode}
_FIXED_SIZES = {int(Opcode.FOOTER): _FOOTER_SIZE, int(Opcode.DATA_END): 4}


class DamagedError(ValueError):
    """What cannot be read as mcap; the text says why."""


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
        What is missing or damaged, in plain words; complete after `messages` has ended.
    custom : dict
        What rosbag2's metadata in the file say under ``custom_data``.
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
        self._found = 0
        self._lost_chunks = 0
        self._lost_messages = 0
        self._strange: list[int] = []
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
            Given topic and type, says whether its messages are asked for; all are counted.

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
                yield from self._of_chunk(begin, end, wanted)
            elif opcode == Opcode.MESSAGE:
                yield from self._walk(self._data[begin:end], wanted)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._declare(opcode, self._data[begin + 9:end])
            elif opcode == Opcode.METADATA:
                self._take_metadata(self._data[begin + 9:end])
            ended = opcode == Opcode.DATA_END
        self._conclude(ended)

    def _records(self) -> Iterator[tuple[int, int, int]]:
        """Yield (opcode, begin, end) of the data section's records, past damaged places."""
        at = len(MAGIC)
        # Behind a length that lies, the walk lands anywhere: the search starts where all was well.
        sure = at
        while at < self.size:
            fits = self._record_at(at)
            if fits is None:
                following = self._next_chunk(sure)
                self.position = at if following is None else sure
                if self._footer is None and following is None:
                    return
                self._strange.append(at)
                if following is None:
                    return
                at = following
                continue
            opcode, end = fits
            self.position = at
            yield opcode, at, end
            if opcode == Opcode.DATA_END:
                return
            at = end
            if opcode == Opcode.CHUNK:
                sure = end
                self._release(end)
        self.position = at

    def _release(self, end: int) -> None:
        """Give back the memory that the file took up to here, now and then."""
        begin, end = self._released, end - end % mmap.PAGESIZE
        if end - begin > _KEPT and hasattr(self._data, 'madvise'):
            self._data.madvise(mmap.MADV_DONTNEED, begin, end - begin)
            self._released = end

    def _record_at(self, at: int) -> tuple[int, int] | None:
        """Return opcode and end of the record that begins here, None where none can."""
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
        """Return where the next whole chunk begins, None without any."""
        for match in _CHUNK.finditer(self._data, start):
            fits = self._record_at(match.start())
            if fits is not None:
                try:
                    self._open_chunk(match.start(), fits[1])
                except DamagedError:
                    continue
                return match.start()
        return None

    def _open_chunk(self, begin: int, end: int) -> bytes:
        try:
            chunk = Chunk.read(ReadDataStream(BytesIO(self._data[begin + 9:end])))
            stream, size = get_chunk_data_stream(chunk, validate_crc=True)
            content = stream.read(size)
        # Each compression has errors of its own.
        except Exception as error:
            raise DamagedError(f'a chunk at byte {begin}: {error}') from None
        if size != chunk.uncompressed_size:
            raise DamagedError(f'a chunk at byte {begin}: {size} bytes long')
        return content

    def _of_chunk(self, begin: int, end: int, wanted: Wanted) -> Iterator[Message]:
        try:
            content = self._open_chunk(begin, end)
        except DamagedError:
            self._lost_chunks += 1
            self._lost_messages += self._indexed(end)
            return
        yield from self._walk(content, wanted)

    def _indexed(self, at: int) -> int:
        """Return how many messages the indexes behind a chunk list."""
        count = 0
        while (fits := self._record_at(at)) is not None and fits[0] == Opcode.MESSAGE_INDEX:
            try:
                index = MessageIndex.read(ReadDataStream(BytesIO(self._data[at + 9:fits[1]])))
            except Exception:
                break
            count += len(index.records)
            at = fits[1]
        return count

    def _walk(self, content: bytes, wanted: Wanted) -> Iterator[Message]:
        at, stop = 0, len(content)
        asked: dict[int, tuple[str, str] | None] = {}
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
                if channel not in asked:
                    topic = self._channels.get(channel)
                    kind = self.topics[topic][0] if topic is not None else ''
                    asked[channel] = (topic, kind) if topic is not None and wanted(
                        topic, kind) else None
                about = asked[channel]
                if about is not None:
                    yield *about, time, content[at + 31:end]
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._declare(opcode, content[at + 9:end])
                asked.clear()
            at = end
        self._count(counts)

    def _count(self, counts: dict[int, int]) -> None:
        for channel, count in counts.items():
            self._found += count
            topic = self._channels.get(channel)
            if topic is None:
                self._lost_messages += count
            else:
                kind, before = self.topics[topic]
                self.topics[topic] = kind, before + count

    def _declare(self, opcode: int, content: bytes) -> None:
        try:
            self._take_declaration(opcode, ReadDataStream(BytesIO(content)))
        # Without a checksum a damaged one fails in any way.
        except Exception:
            self.notes.append('a description of its topics is damaged')

    def _take_declaration(self, opcode: int, stream: ReadDataStream) -> None:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas[schema.id] = schema.name
            return
        channel = Channel.read(stream)
        self._channels[channel.id] = channel.topic
        self.encodings[channel.topic] = channel.message_encoding
        kind, count = self.topics.get(channel.topic, ('', 0))
        self.topics[channel.topic] = self._schemas.get(channel.schema_id, kind), count

    def _take_metadata(self, content: bytes) -> None:
        try:
            record = Metadata.read(ReadDataStream(BytesIO(content)))
            text = record.metadata.get('serialized_metadata', '')
            about = yaml.safe_load(text) if record.name == 'rosbag2' else None
        except Exception:
            self.notes.append('its metadata are damaged')
            return
        custom = about.get('custom_data') if isinstance(about, dict) else None
        if isinstance(custom, dict):
            self.custom.update({str(key): str(value) for key, value in custom.items()})

    def _read_footer(self) -> Footer | None:
        if self.size < 2 * len(MAGIC) + 9 + _FOOTER_SIZE or self._data[-len(MAGIC):] != MAGIC:
            return None
        begin = self.size - len(MAGIC) - _FOOTER_SIZE - 9
        fits = self._record_at(begin)
        if fits is None or fits[0] != Opcode.FOOTER:
            return None
        footer: Footer = Footer.read(
            ReadDataStream(BytesIO(self._data[begin + 9:fits[1]])))
        return footer

    def _read_summary(self) -> int | None:
        """Take topics from the summary and return the number of messages it promises."""
        if self._footer is None or not self._footer.summary_start:
            return None
        begin, end = self._footer.summary_start, self.size - len(MAGIC) - 9 - _FOOTER_SIZE
        crc = self._footer.summary_crc
        if crc and zlib.crc32(self._data[begin:self.size - len(MAGIC) - 4]) != crc:
            self.notes.append('the index at its end is damaged')
            return None
        expected = None
        while begin < end and (fits := self._record_at(begin)) is not None:
            opcode, stop = fits
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._declare(opcode, self._data[begin + 9:stop])
            elif opcode == Opcode.STATISTICS:
                stream = ReadDataStream(BytesIO(self._data[begin + 9:stop]))
                expected = Statistics.read(stream).message_count
            begin = stop
        return expected

    def _conclude(self, ended: bool) -> None:
        """Say what is missing."""
        if self._data[:len(MAGIC)] != MAGIC:
            self.notes.append('its first bytes are damaged')
        if self._lost_chunks:
            lost = f', {self._lost_messages} messages' if self._lost_messages else ''
            self.notes.append(f'{self._lost_chunks} damaged chunks left out (checksum{lost})')
        elif self._lost_messages:
            self.notes.append(f'{self._lost_messages} messages are of topics that were lost')
        if self._strange:
            more = len(self._strange) - 1
            self.notes.append(f'unreadable at byte {self._strange[0]}'
                              + (f' and {more} further places' if more else ''))
        if not ended and self._footer is None:
            if not self._found:
                raise DamagedError('it breaks off before the end of its first chunk')
            behind = self.size - self.position
            self.notes.append(
                f'it was not finished: {self._found} messages recovered'
                + (f', {behind} bytes behind them are no whole chunk' if behind > 0 else ''))
        elif self._footer is None:
            self.notes.append('the index at its end is missing')
        if self._expected is not None and self._found < self._expected:
            self.notes.append(
                f'{self._expected - self._found} of {self._expected} messages are missing')
        if not self.notes and ended:
            self._check_data()
        self.position = self.size

    def _check_data(self) -> None:
        """Check the data section's checksum, where it has one, for damage outside the chunks."""
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
