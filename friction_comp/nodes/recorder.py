# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Records the package's topics into a rosbag2 folder that evaluate, refine and ros2 bag read."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter, deque
from collections.abc import Sequence
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

from friction_comp.errors import InputError
from friction_comp.nodes.diagnostics import Diagnostics, ERROR, OK, Rate, WARN
from friction_comp.nodes.joint_states import NANO
from friction_comp.nodes.node_main import run
from friction_comp.nodes.parameters import declare
from friction_comp.nodes.recorded_topic import RecordedTopic
from friction_comp.recordings.writer import RecordingWriter

STATES = 'joint_states'
# Topic, message class, its name in recordings, and whether its stamp dates it. Others find the
# subscriptions of a node in the order in which it made them: who has found the last, as a plant
# that waits for its listeners, has found them all.
TOPICS = (
    ('current_command', Float64MultiArray, 'std_msgs/msg/Float64MultiArray', False),
    ('direction', Int8MultiArray, 'std_msgs/msg/Int8MultiArray', False),
    ('direction_stamped', JointState, 'sensor_msgs/msg/JointState', True),
    ('reference', JointState, 'sensor_msgs/msg/JointState', True),
    ('interaction_wrench', WrenchStamped, 'geometry_msgs/msg/WrenchStamped', True),
    ('motor_temperature', Temperature, 'sensor_msgs/msg/Temperature', True),
    # Stamped by the clock of its node, which need not be that of the joint states.
    ('/diagnostics', DiagnosticArray, 'diagnostic_msgs/msg/DiagnosticArray', False),
    (STATES, JointState, 'sensor_msgs/msg/JointState', True),
)
# Joint states that are remembered to date messages without stamp.
_MEMORY = 20_000
# Real s between putting what has come onto the disk, and between looks at who publishes.
_FLUSH, _LOOK = 0.25, 0.1
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


def who_says(cdr: bytes) -> str:
    """Return whose status a serialised diagnostic message bears; each node sends its own.

    Empty for one that cannot be read.
    """
    try:
        message = deserialize_message(cdr, DiagnosticArray)
    except Exception:  # whatever the middleware raises
        return ''
    return ', '.join(status.name for status in message.status)


class Dates:
    """Dates messages without stamp by the joint state that was sent just before them.

    All publishers' system clocks agree on one machine, whereas joint states may carry simulated
    time: a command bears the time of the state that it answers, however late either arrived.
    """

    def __init__(self) -> None:
        self._sent: deque[int] = deque(maxlen=_MEMORY)
        self._stamps: deque[int] = deque(maxlen=_MEMORY)

    def see(self, sent: int, stamp: int) -> None:
        """Take a joint state: system time at which it was sent, and its stamp, in ns."""
        if not self._sent or sent >= self._sent[-1]:
            self._sent.append(sent)
            self._stamps.append(stamp)

    def known(self, sent: int) -> bool:
        """Tell whether joint states up to this system time have come."""
        return bool(self._sent) and self._sent[-1] >= sent

    def at(self, sent: int) -> int | None:
        """Return the date in ns of what was sent at this system time; None without any state."""
        if not self._sent:
            return None
        if sent >= self._sent[-1]:
            return self._stamps[-1]
        return self._stamps[max(0, bisect_right(self._sent, sent) - 1)]


class RecorderNode(Node):
    """Writes every message as it went over the wire, at once, and counts what was lost."""

    finished = False
    fast_timers = ()
    # Nothing waits for a recording: messages are taken in handfuls.
    nap = 0.005

    def __init__(self) -> None:
        super().__init__('recorder')
        output = declare(
            self, 'output', 'recording', 'folder to create', read_only=True)
        model = declare(
            self, 'model_file', '', 'model that is active, noted in the metadata', read_only=True)
        compression = declare(
            self, 'compression', 'none', 'none, message or storage', read_only=True)
        size = declare(
            self, 'max_file_size', 0.0, 'MB after which the next file begins, 0.01 at least; 0: '
            'never', low=0.0, read_only=True)
        duration = declare(
            self, 'max_file_duration', 0.0, 's after which the next file begins, 0.1 at least; 0: '
            'never', low=0.0, read_only=True)
        self._dates = Dates()
        self._undated: deque[tuple[int, str, str, bytes]] = deque()
        self._rate = Rate()
        self._counts = dict.fromkeys((topic for topic, *_ in TOPICS), 0)
        self._failed = ''
        self._stamped = False
        # Nothing more is taken: a driver does not fall silent because nobody records it.
        self._over = False
        self._lost_before = self._lost_told = 0
        data = {'recorded_by': 'friction_comp recorder'}
        if model:
            data['model_file'] = model
        self._writer = RecordingWriter(
            output, data, compression, split_size=1e6 * size, split_duration=duration)
        self._writer.__enter__()
        self._topics = {topic: RecordedTopic(self, kind, topic, partial(
            self._on_stamped if stamped else self._on_unstamped, topic, name),
            who_says if kind is DiagnosticArray else None)
            for topic, kind, name, stamped in TOPICS}
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_FLUSH, self._flush, clock=steady)
        self.create_timer(_LOOK, self._look, clock=steady)
        Diagnostics(self, self._report, output, 'recording')

    def _look(self) -> None:
        for topic in self._topics.values():
            topic.look()

    def _flush(self) -> None:
        if self._failed or self._over:
            return
        try:
            self._writer.flush()
        except InputError as error:
            self._failed = str(error)
            raise

    def _on_stamped(self, topic: str, name: str, cdr: bytes, info: dict[str, Any]) -> None:
        stamp, sent = stamp_of(cdr), info['source_timestamp']
        if not stamp:
            # As old as what was sent just before it, where that bears a stamp; both clocks agree
            # where nothing does.
            stamp = (self._dates.at(sent) if self._stamped else None) or sent
        elif topic == STATES:
            self._stamped = True
        if topic == STATES:
            self._dates.see(sent, stamp)
            self._date()
        self._write(topic, name, stamp, cdr)

    def _on_unstamped(self, topic: str, name: str, cdr: bytes, info: dict[str, Any]) -> None:
        self._undated.append((info['source_timestamp'], topic, name, cdr))
        self._date()

    def _date(self, all_of_them: bool = False) -> None:
        """Write the messages without stamp for which the joint states around them have come."""
        waiting = self._undated
        while waiting and (all_of_them or self._dates.known(waiting[0][0])):
            sent, topic, name, cdr = waiting.popleft()
            date = self._dates.at(sent)
            self._write(topic, name, sent if date is None else date, cdr)

    def _write(self, topic: str, name: str, stamp: int, cdr: bytes) -> None:
        if self._failed or self._over:
            # The node is about to leave; what comes until then has no place any more.
            return
        heard = self._topics[topic]
        if not self._counts[topic]:
            # Now its publishers are known.
            self._writer.add_topic(heard.name, name, heard.offered())
        self._counts[topic] += 1
        self._rate.tick()
        try:
            # As it is called here, so that a recording from a namespace or with remapped topics
            # plays back as it was.
            self._writer.write(heard.name, name, stamp, cdr)
        except InputError as error:
            self._failed = str(error)
            raise

    def _lost(self) -> str:
        """Return how many messages of which topics were lost; '' if none."""
        return ', '.join(f'{topic.lost} {name}' for name, topic in self._topics.items()
                         if topic.lost)

    def _report(self) -> tuple[Any, str, dict[str, Any]]:
        lost = sum(topic.lost for topic in self._topics.values())
        # Heard, though not written before the joint states that date them have come.
        waiting = Counter(topic for _, topic, *_ in self._undated)
        values = {'messages per second of real time': self._rate.per_second(),
                  'messages lost': lost,
                  **{topic: count + waiting[topic] for topic, count in self._counts.items()},
                  **{f'publishers of {name}': topic.publishers
                     for name, topic in self._topics.items()}}
        # Once it has stood for a second: what seemed lost may have been a slow publisher's.
        if lost == self._lost_before and lost > self._lost_told:
            self.get_logger().warning(f'messages lost so far: {self._lost()}')
            self._lost_told = lost
        self._lost_before = lost
        if self._failed:
            return ERROR, self._failed, values
        if lost:
            return WARN, f'messages lost: {self._lost()}', values
        if not self._counts[STATES]:
            return WARN, 'no joint_states yet', values
        return OK, 'recording', values

    def leave(self) -> None:
        """Take what is still waiting and finish the recording."""
        if self._failed:
            return
        try:
            for topic in self._topics.values():
                topic.drain()
            self._date(all_of_them=True)
            for key, _, name, _ in TOPICS:
                self._writer.add_topic(self._topics[key].name, name)
            if self._lost():
                self._writer.custom_data['messages_lost'] = self._lost()
            self._over = True
            self._writer.close()
        except InputError as error:
            self._failed = str(error)
            raise
        if self._lost():
            self.get_logger().error(f'{self._writer.path}: messages lost: {self._lost()}')
        self.get_logger().info(f'{self._writer.path}: ' + ', '.join(
            f'{count} {topic}' for topic, count in self._counts.items() if count))


def main(argv: Sequence[str] | None = None) -> int:
    """Start the node and return its exit code."""
    return run('recorder', __doc__, RecorderNode, argv)
