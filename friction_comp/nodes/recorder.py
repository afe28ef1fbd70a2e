# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Records the package's topics into a rosbag2 folder that evaluate, refine and ros2 bag read."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from functools import partial
import struct

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Float64MultiArray, Int8MultiArray

from friction_comp.errors import InputError
from friction_comp.nodes.diagnostics import Diagnostics, ERROR, OK, Rate, WARN
from friction_comp.nodes.joint_io import input_qos, NANO
from friction_comp.nodes.node_main import run
from friction_comp.nodes.parameters import declare
from friction_comp.recordings.writer import RecordingWriter

STATES = 'joint_states'
# Topic, message class, its name in recordings, and whether its stamp dates it.
TOPICS = (
    (STATES, JointState, 'sensor_msgs/msg/JointState', True),
    ('current_command', Float64MultiArray, 'std_msgs/msg/Float64MultiArray', False),
    ('direction', Int8MultiArray, 'std_msgs/msg/Int8MultiArray', False),
    ('reference', JointState, 'sensor_msgs/msg/JointState', True),
    ('interaction_wrench', WrenchStamped, 'geometry_msgs/msg/WrenchStamped', True),
    ('motor_temperature', Temperature, 'sensor_msgs/msg/Temperature', True),
    # Stamped by the clock of its node, which need not be that of the joint states.
    ('/diagnostics', DiagnosticArray, 'diagnostic_msgs/msg/DiagnosticArray', False),
)
# Joint states that are remembered to date messages without stamp.
_MEMORY = 20_000
_STAMP = struct.Struct('<iI')
_STAMP_BIG_ENDIAN = struct.Struct('>iI')


def stamp_of(cdr):
    """Return the stamp in ns that a serialised message with a header begins with."""
    kind = _STAMP if cdr[1] & 1 else _STAMP_BIG_ENDIAN
    seconds, nanoseconds = kind.unpack_from(cdr, 4)
    return seconds * NANO + nanoseconds


class Dates:
    """Dates messages without stamp by the joint state that was sent just before them.

    All publishers' system clocks agree on one machine, whereas joint states may carry simulated
    time: a command bears the time of the state that it answers, however late either arrived.
    """

    def __init__(self):
        self._sent = deque(maxlen=_MEMORY)
        self._stamps = deque(maxlen=_MEMORY)

    def see(self, sent, stamp):
        """Take a joint state: system time at which it was sent, and its stamp, in ns."""
        if not self._sent or sent >= self._sent[-1]:
            self._sent.append(sent)
            self._stamps.append(stamp)

    def known(self, sent):
        """Tell whether joint states up to this system time have come."""
        return bool(self._sent) and self._sent[-1] >= sent

    def at(self, sent):
        """Return the date in ns of what was sent at this system time; None without any state."""
        if not self._sent:
            return None
        if sent >= self._sent[-1]:
            return self._stamps[-1]
        return self._stamps[max(0, bisect_right(self._sent, sent) - 1)]


class RecorderNode(Node):
    """Writes every message as it went over the wire; the recording is whole or not there."""

    finished = False
    fast_timers = ()
    # Nothing waits for a recording: messages are taken in handfuls.
    nap = 0.005

    def __init__(self):
        super().__init__('recorder')
        output = declare(
            self, 'output', 'recording', 'folder to create', read_only=True)
        model = declare(
            self, 'model_file', '', 'model that is active, noted in the metadata', read_only=True)
        compression = declare(
            self, 'compression', 'none', 'none, message or storage', read_only=True)
        qos = input_qos(self)
        self._dates = Dates()
        self._undated = deque()
        self._rate = Rate()
        self._counts = dict.fromkeys((topic for topic, *_ in TOPICS), 0)
        self._failed = ''
        data = {'recorded_by': 'friction_comp recorder'}
        if model:
            data['model_file'] = model
        self._writer = RecordingWriter(output, data, compression)
        self._writer.__enter__()
        for topic, kind, name, stamped in TOPICS:
            # As it is called here, so that a recording from a namespace or with remapped topics
            # plays back as it was.
            resolved = self.resolve_topic_name(topic)
            self._writer.add_topic(resolved, name)
            take = self._on_stamped if stamped else self._on_unstamped
            self.create_subscription(
                kind, topic, partial(take, topic, resolved, name), qos, raw=True)
        Diagnostics(self, self._report, output)

    def _on_stamped(self, topic, resolved, name, cdr, info):
        stamp = stamp_of(cdr)
        sent = info['source_timestamp']
        if topic == STATES:
            if not stamp:
                stamp = sent
            self._dates.see(sent, stamp)
            self._date()
        self._write(topic, resolved, name, stamp or sent, cdr)

    def _on_unstamped(self, topic, resolved, name, cdr, info):
        self._undated.append((info['source_timestamp'], topic, resolved, name, bytes(cdr)))
        self._date()

    def _date(self, all_of_them=False):
        """Write the messages without stamp for which the joint states around them have come."""
        waiting = self._undated
        while waiting and (all_of_them or self._dates.known(waiting[0][0])):
            sent, topic, resolved, name, cdr = waiting.popleft()
            date = self._dates.at(sent)
            self._write(topic, resolved, name, sent if date is None else date, cdr)

    def _write(self, topic, resolved, name, stamp, cdr):
        self._counts[topic] += 1
        self._rate.tick()
        self._writer.write(resolved, name, stamp, bytes(cdr))

    def _report(self):
        values = {'messages per second of real time': self._rate.per_second(), **self._counts}
        if self._failed:
            return ERROR, self._failed, values
        if not self._counts[STATES]:
            return WARN, 'no joint_states yet', values
        return OK, 'recording', values

    def leave(self):
        """Finish the recording."""
        try:
            self._date(all_of_them=True)
            self._writer.close()
        except InputError as error:
            self._failed = str(error)
            raise
        self.get_logger().info(f'{self._writer.path}: ' + ', '.join(
            f'{count} {topic}' for topic, count in self._counts.items() if count))


def main(argv=None):
    """Start the node and return its exit code."""
    return run('recorder', __doc__, RecorderNode, argv)
