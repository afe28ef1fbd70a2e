# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Subscribes to the package's topics, gives each message a time and counts losses."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Collection
from functools import partial
import struct
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Float64MultiArray, Int8MultiArray

from friction_comp.messages import NANO, TOPICS
from friction_comp.ros.ros_start import steady_timer

STATES = 'joint_states'
# Subscriptions are discovered in the order of their creation: a plant that waits for a subscription
# to joint_states, the last, has found all.
_SUBSCRIBED = {
    'current_command': Float64MultiArray, 'direction': Int8MultiArray,
    'direction_stamped': JointState, 'reference': JointState, 'interaction_wrench': WrenchStamped,
    'motor_temperature': Temperature, '/diagnostics': DiagnosticArray, STATES: JointState}
# Those without a stamp, or with one of a clock that may differ from that of the joint states.
_UNSTAMPED = ('current_command', 'direction', '/diagnostics')
RECORDED = {**TOPICS, '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray'}
"""Topic to message type of all that is recorded."""
# Real s between checks of the publishers.
_CHECK_PERIOD = 0.1
# Age in ns of a message without a stamp after which no joint states of its time are awaited.
_LONGEST_WAIT = 5 * NANO
# Real s within which the middleware repeats a lost message, and those that it withholds until then.
_REPEATED = 0.25
# Length of the queue: ten seconds at a kilohertz.
DEPTH = 10_000


def stamp_of(cdr: bytes) -> int:
    """Return the stamp in ns of a serialised message with a header, 0 if it is not valid."""
    if len(cdr) < 12:
        return 0
    seconds, nanoseconds = struct.unpack_from('<iI' if cdr[1] & 1 else '>iI', cdr, 4)
    return int(seconds * NANO + nanoseconds) if seconds >= 0 and nanoseconds < NANO else 0


class RecordedTopic:
    """Subscribes to a topic: reliably, until a publisher is found that does not offer that.

    `lost` counts the messages that the middleware has missed. `take` is called with each serialised
    message and the middleware's message info.
    """

    def __init__(self, node: Node, kind: Any, topic: str,
                 take: Callable[[bytes, dict[str, Any]], None]) -> None:
        self.name = node.resolve_topic_name(topic)
        self.lost = 0
        self._node, self._kind, self._take = node, kind, take
        self._subscribe(ReliabilityPolicy.RELIABLE)

    def _subscribe(self, reliability: ReliabilityPolicy) -> None:
        lost_before, self._reliability = self.lost, reliability

        def count_lost(event: Any) -> None:
            self.lost = lost_before + event.total_count

        def take(message: bytes, info: dict[str, Any]) -> None:
            self._take(message, info)
            # The executor takes one message per poll of all entities.
            self.drain()
        self._subscription = self._node.create_subscription(
            self._kind, self.name, take, QoSProfile(depth=DEPTH, reliability=reliability),
            # By default, a word in the log of each publisher that this does not hear.
            event_callbacks=SubscriptionEventCallbacks(
                message_lost=count_lost, use_default_callbacks=False), raw=True)

    @property
    def publisher_count(self) -> int:
        """Number of connected publishers."""
        return self._subscription.get_publisher_count()

    def check_publishers(self) -> None:
        """Subscribe with best effort if a publisher offers no more."""
        best_effort = ReliabilityPolicy.BEST_EFFORT
        if self._reliability != best_effort and any(
                info.qos_profile.reliability == best_effort
                for info in self._node.get_publishers_info_by_topic(self.name)):
            self.drain()
            self._node.destroy_subscription(self._subscription)
            self._subscribe(best_effort)

    def drain(self) -> None:
        """Process all messages that have arrived."""
        handle = self._subscription.handle
        with handle:
            for _ in range(DEPTH):
                message = handle.take_message(self._kind, True)
                if message is None:
                    return
                self._take(*message)


class DatedTopics:
    """Subscribes to the package's topics and gives each message a time.

    A message without a stamp gets that of the last joint state sent before it, by the system time
    of publication, which all publishers on a machine share: a command thus gets the time of the
    state that it answers. `take` is called with topic, time in ns and the serialised message.
    `waiting` are the messages whose joint states have not arrived: system time of publication in
    ns, topic and content.
    """

    def __init__(self, node: Node, take: Callable[[str, int, bytes], None],
                 left_out: Collection[str] = ()) -> None:
        self._take, self._stamped = take, False
        # System times of publication and stamps of the joint states.
        self._sent, self._stamps = (deque[int](maxlen=20_000) for _ in range(2))
        self.waiting = deque[tuple[int, str, bytes]]()
        self.topics: dict[str, RecordedTopic] = {}
        for topic, kind in _SUBSCRIBED.items():
            if topic not in left_out:
                receive = self._on_unstamped if topic in _UNSTAMPED else self._on_stamped
                self.topics[topic] = RecordedTopic(node, kind, topic, partial(receive, topic))
        steady_timer(node, _CHECK_PERIOD, self._check)

    def _check(self) -> None:
        for topic in self.topics.values():
            topic.check_publishers()
        late = time.time_ns() - _LONGEST_WAIT
        while self._sent and self.waiting and self.waiting[0][0] < late:
            self._forward()

    def finish(self) -> None:
        """Process all messages that have arrived or are waiting, and those that are repeated."""
        time.sleep(_REPEATED)
        for topic in self.topics.values():
            topic.drain()
        while self.waiting:
            self._forward()

    def _on_stamped(self, topic: str, cdr: bytes, info: dict[str, Any]) -> None:
        stamp, sent = stamp_of(cdr), info['source_timestamp']
        if not stamp:
            # If joint states have no stamp either, both clocks are the same.
            stamp = self._stamp_at(sent) if self._stamped else sent
        elif topic == STATES:
            self._stamped = True
        if topic == STATES:
            if not self._sent or sent >= self._sent[-1]:
                self._sent.append(sent)
                self._stamps.append(stamp)
            self._forward_dated()
        self._take(topic, stamp, cdr)

    def _on_unstamped(self, topic: str, cdr: bytes, info: dict[str, Any]) -> None:
        self.waiting.append((info['source_timestamp'], topic, cdr))
        self._forward_dated()

    def _forward_dated(self) -> None:
        while self.waiting and self._sent and self._sent[-1] >= self.waiting[0][0]:
            self._forward()

    def _forward(self) -> None:
        sent, topic, cdr = self.waiting.popleft()
        self._take(topic, self._stamp_at(sent), cdr)

    def _stamp_at(self, sent: int) -> int:
        """Return the stamp in ns of the last joint state sent before; `sent` if there is none."""
        if not self._sent:
            return sent
        if sent >= self._sent[-1]:
            return self._stamps[-1]
        return self._stamps[max(0, bisect_right(self._sent, sent) - 1)]
