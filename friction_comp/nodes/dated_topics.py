# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Subscribes to the package's topics, gives each message a time and counts losses."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Collection
from functools import partial
import struct
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Float64MultiArray, Int8MultiArray

from friction_comp.nodes.joint_states import NANO
from friction_comp.nodes.recorded_topic import RecordedTopic
from friction_comp.topics import TOPICS

STATES = 'joint_states'
# Topic, message class, and whether its stamp dates it. Others find the subscriptions of a node in
# the order in which it made them: who has found the last, as a plant that waits for its listeners,
# has found them all.
_SUBSCRIBED = (
    ('current_command', Float64MultiArray, False),
    ('direction', Int8MultiArray, False),
    ('direction_stamped', JointState, True),
    ('reference', JointState, True),
    ('interaction_wrench', WrenchStamped, True),
    ('motor_temperature', Temperature, True),
    # Stamped by the clock of its node, which need not be that of the joint states.
    ('/diagnostics', DiagnosticArray, False),
    (STATES, JointState, True),
)
RECORDED = {**TOPICS, '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray'}
"""Topic to message type of all that is recorded."""
# Joint states that are remembered to date messages without stamp.
_MEMORY = 20_000
# Real s between looks at who publishes.
_LOOK = 0.1
_STAMP = struct.Struct('<iI')
_STAMP_BIG_ENDIAN = struct.Struct('>iI')


def stamp_of(cdr: bytes) -> int:
    """Return the stamp in ns that a serialised message with a header begins with.

    0, as of an empty stamp, for one that is no time: before 1970, or of a thousand million
    nanoseconds and more; and for a message that is too short to have one.
    """
    if len(cdr) < 4 + _STAMP.size:
        return 0
    kind = _STAMP if cdr[1] & 1 else _STAMP_BIG_ENDIAN
    seconds, nanoseconds = kind.unpack_from(cdr, 4)
    return int(seconds * NANO + nanoseconds) if seconds >= 0 and nanoseconds < NANO else 0


def diagnosed_nodes(cdr: bytes) -> str:
    """Return whose status a serialised diagnostic message holds; each node sends its own.

    Empty for one that cannot be read.
    """
    try:
        message = deserialize_message(cdr, DiagnosticArray)
    except Exception:  # whatever the middleware raises
        return ''
    return ', '.join(status.name for status in message.status)


class DatedTopics:
    """Subscribes to the package's topics and gives each message a time.

    Messages with a stamp keep it. One without a stamp gets that of the joint state that was sent
    just before it: all publishers' system clocks agree on one machine, whereas joint states may
    carry simulated time. A command so gets the time of the state that it answers, however late
    either arrived.

    Parameters
    ----------
    node : rclpy.node.Node
    take : callable
        Called with topic, time in ns and the serialised message.
    left_out : collection of str
        Topics that are not subscribed to.

    Attributes
    ----------
    topics : dict of str to RecordedTopic
    waiting : deque
        Messages without stamp whose joint states have not come yet: system time in ns at which
        they were sent, topic and content.
    """

    def __init__(self, node: Node, take: Callable[[str, int, bytes], None],
                 left_out: Collection[str] = ()) -> None:
        self._take = take
        self._stamped = False
        self._sent: deque[int] = deque(maxlen=_MEMORY)
        self._stamps: deque[int] = deque(maxlen=_MEMORY)
        self.waiting: deque[tuple[int, str, bytes]] = deque()
        self.topics = {topic: RecordedTopic(
            node, kind, topic, partial(self._on_stamped if stamped else self._on_unstamped, topic),
            diagnosed_nodes if kind is DiagnosticArray else None)
            for topic, kind, stamped in _SUBSCRIBED if topic not in left_out}
        node.create_timer(_LOOK, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _look(self) -> None:
        for topic in self.topics.values():
            topic.look()

    def finish(self) -> None:
        """Take all that has arrived, and date what still waits."""
        for topic in self.topics.values():
            topic.drain()
        self._date(all_of_them=True)

    def _on_stamped(self, topic: str, cdr: bytes, info: dict[str, Any]) -> None:
        stamp, sent = stamp_of(cdr), info['source_timestamp']
        if not stamp:
            # Where joint states carry no stamp either, both clocks agree.
            stamp = (self._date_of(sent) if self._stamped else None) or sent
        elif topic == STATES:
            self._stamped = True
        if topic == STATES:
            if not self._sent or sent >= self._sent[-1]:
                self._sent.append(sent)
                self._stamps.append(stamp)
            self._date()
        self._take(topic, stamp, cdr)

    def _on_unstamped(self, topic: str, cdr: bytes, info: dict[str, Any]) -> None:
        self.waiting.append((info['source_timestamp'], topic, cdr))
        self._date()

    def _date(self, all_of_them: bool = False) -> None:
        """Hand on the messages without stamp for which the joint states around them have come."""
        while self.waiting and (all_of_them or (
                self._sent and self._sent[-1] >= self.waiting[0][0])):
            sent, topic, cdr = self.waiting.popleft()
            date = self._date_of(sent)
            self._take(topic, sent if date is None else date, cdr)

    def _date_of(self, sent: int) -> int | None:
        """Return the stamp in ns of the joint state sent last before; None without any."""
        if not self._sent:
            return None
        if sent >= self._sent[-1]:
            return self._stamps[-1]
        return self._stamps[max(0, bisect_right(self._sent, sent) - 1)]
