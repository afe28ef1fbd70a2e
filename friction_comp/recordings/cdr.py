# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Decodes many CDR messages of one type at once.

The layout (joint names and array lengths) is determined from one message; all messages with the
same length, counts and strings are then decoded together with numpy.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import math
import struct

import numpy as np

from friction_comp.stamps import NANO

JOINT_STATE = 'sensor_msgs/msg/JointState'
FLOAT_ARRAY = 'std_msgs/msg/Float64MultiArray'
INT8_ARRAY = 'std_msgs/msg/Int8MultiArray'
WRENCH = 'geometry_msgs/msg/WrenchStamped'
TEMPERATURE = 'sensor_msgs/msg/Temperature'
DYNAMIC_STATE = 'control_msgs/msg/DynamicJointState'

# Most values or names in one message: a corrupt one could fill the memory.
MOST_VALUES = 200


class _Cursor:
    """Reads through one message and stores the offset of each field."""

    def __init__(self, data: bytes) -> None:
        if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
            raise ValueError('unknown CDR encapsulation')
        self.data = data
        self.order = '<' if data[1] == 1 else '>'
        self.position = 4
        # Byte positions that determine the layout: byte order, counts and strings, but no padding,
        # whose content is undefined.
        self.fixed = [0, 1]
        # Name to (numpy type, byte position, number of values).
        self.fields: dict[str, tuple[str, int, int]] = {}

    def advance(self, size: int, alignment: int) -> int:
        """Skip a field and return where it starts."""
        start = self.position + -(self.position - 4) % alignment
        if start + size > len(self.data):
            raise ValueError('message is shorter than its fields')
        self.position = start + size
        return start

    def count(self, most: float = math.inf) -> int:
        start = self.advance(4, 4)
        self.fixed.extend(range(start, start + 4))
        count = int(struct.unpack_from(self.order + 'I', self.data, start)[0])
        if count > most:
            raise ValueError(f'{count} values or names in one message')
        return count

    def string(self) -> str:
        size = self.count()
        start = self.advance(size, 1)
        self.fixed.extend(range(start, start + size))
        return self.data[start:start + size].rstrip(b'\0').decode('utf-8', 'replace')

    def values(self, name: str, code: str, count: int | None = 1) -> None:
        """Add a field of `count` values; None reads the count first."""
        if count is None:
            count = self.count(MOST_VALUES)
        size = np.dtype(code).itemsize
        start = self.advance(size * count, size) if count else self.position
        self.fields[name] = (self.order + code, start, count)


def _walk(cursor: _Cursor, kind: str) -> tuple[str, ...]:
    """Advance the cursor over all fields of a message; return the names that it contains."""
    if kind in (FLOAT_ARRAY, INT8_ARRAY):
        unit: tuple[str, ...] = ()
        for k in range(cursor.count(MOST_VALUES)):
            if k == 1:
                unit = (cursor.string(),)
            else:
                # Labels may differ between messages: only their length is fixed.
                cursor.advance(cursor.count(), 1)
            # Size and stride of the dimension.
            cursor.advance(8, 4)
        # Offset of the data.
        cursor.advance(4, 4)
        cursor.values('data', 'f8' if kind == FLOAT_ARRAY else 'i1', None)
        return unit
    cursor.values('sec', 'i4')
    cursor.values('nanosec', 'u4')
    frame = cursor.string()
    if kind == JOINT_STATE:
        names = tuple(cursor.string() for _ in range(cursor.count(MOST_VALUES)))
        for name in ('position', 'velocity', 'effort'):
            cursor.values(name, 'f8', None)
        return names
    if kind == DYNAMIC_STATE:
        joints = tuple(cursor.string() for _ in range(cursor.count(MOST_VALUES)))
        found = []
        for joint in joints[:cursor.count(MOST_VALUES)]:
            interfaces = [cursor.string() for _ in range(cursor.count(MOST_VALUES))]
            found += [f'{joint}/{interface}' for interface in interfaces]
            cursor.values(joint, 'f8', None)
        return tuple(found)
    name, count = {WRENCH: ('wrench', 6), TEMPERATURE: ('temperature', 2)}[kind]
    cursor.values(name, 'f8', count)
    return (frame,)


def decode(type_name: str, payloads: Sequence[bytes]
           ) -> Iterator[tuple[np.ndarray, tuple[str, ...], dict[str, np.ndarray]]]:
    """Decode serialised messages of one of this module's types, in groups of the same layout.

    Yields indices of the messages of a group, shape (K,); joint names, the frame of a stamped
    message, or the label of an array's second dimension; and each field's values, shape (K, number
    of values), with the ``stamp`` of stamped messages in ns, (K,). The names of dynamic joint
    states are ``joint/interface``: the field JOINT holds a joint's interfaces. Broken messages, or
    with more than `MOST_VALUES` values or names, are left out.
    """
    lengths = np.fromiter(map(len, payloads), dtype=np.int64, count=len(payloads))
    for length in np.unique(lengths):
        index = np.nonzero(lengths == length)[0]
        block = np.frombuffer(b''.join([payloads[int(i)] for i in index]), dtype=np.uint8
                              ).reshape(len(index), length)
        while len(index):
            try:
                cursor = _Cursor(bytes(block[0]))
                names = _walk(cursor, type_name)
            except ValueError:
                index, block = index[1:], block[1:]
                continue
            fixed_bytes = block[:, cursor.fixed]
            same = (fixed_bytes == fixed_bytes[0]).all(axis=1)
            rows = block if same.all() else block[same]
            yield index[same], names, _extract_fields(rows, cursor.fields)
            index, block = index[~same], block[~same]


def _extract_fields(block: np.ndarray, fields: dict[str, tuple[str, int, int]]
                    ) -> dict[str, np.ndarray]:
    values = {}
    for name, (code, start, count) in fields.items():
        stop = start + np.dtype(code).itemsize * count
        values[name] = np.ascontiguousarray(block[:, start:stop]).view(code) if count else \
            np.empty((len(block), 0), dtype=code)
    if 'sec' in values:
        values['stamp'] = (values['sec'][:, 0].astype(np.int64) * NANO + values['nanosec'][:, 0])
    return values
