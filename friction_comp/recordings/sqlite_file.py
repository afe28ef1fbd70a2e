# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the sqlite3 files of rosbag2 as far as the database is intact."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import sqlite3
from types import TracebackType
from urllib.parse import quote

from friction_comp.recordings.mcap_file import DamagedError, Message, Wanted


class SqliteFile:
    """One .db3 file; as `McapFile`.

    The topics' quality of service is ignored: its format differs between releases, and nothing here
    depends on it. Raises DamagedError if it is not a database with rosbag2's tables.
    """

    def __init__(self, path: Path) -> None:
        self.notes: list[str] = []
        self.custom: dict[str, str] = {}
        self.progress = 0.0
        self._database = sqlite3.connect(f'file:{quote(str(path))}?mode=ro', uri=True)
        try:
            rows = self._database.execute(
                'SELECT id, name, type, serialization_format FROM topics ORDER BY id').fetchall()
            self._last = self._database.execute('SELECT max(id) FROM messages').fetchone()[0] or 1
        except sqlite3.Error as error:
            self._database.close()
            raise DamagedError(f'not a rosbag2 database: {error}') from None
        self._by_id = {row[0]: (str(row[1]), str(row[2])) for row in rows}
        self.topics: dict[str, tuple[str, int]] = {str(r[1]): (str(r[2]), 0) for r in rows}
        self.encodings = {str(row[1]): str(row[3]) for row in rows}

    def __enter__(self) -> SqliteFile:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None,
                 traceback: TracebackType | None) -> None:
        self._database.close()

    def messages(self, wanted: Wanted) -> Iterator[Message]:
        """Yield the messages in the order they were written, as `McapFile.messages` does."""
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
                    name, kind = self._by_id[topic]
                    self.topics[name] = kind, self.topics[name][1] + int(count)
        except (sqlite3.Error, TypeError) as error:
            if not recovered:
                raise DamagedError(f'the database is damaged: {error}') from None
            self.notes.append(f'the database is damaged ({error}): {recovered} messages recovered')
        self.progress = 1.0
