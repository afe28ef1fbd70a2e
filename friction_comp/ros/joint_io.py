# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes motor currents or joint torques, for all nodes that drive a motor."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
import math
import threading
import time
from typing import Any

import numpy as np
from rclpy.duration import Duration
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from friction_comp.control.port import NEGLIGIBLE
from friction_comp.messages import NANO, TORQUE_UNIT

# Deep enough for a reader that pauses for seconds.
RELIABLE = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
QOS = {'best_effort': BEST_EFFORT, 'reliable': RELIABLE}
"""Of inputs, by `input_reliability`: best effort hears every publisher; reliable has no losses,
which makes lockstep with the simulated plant faster."""
# For a reader that pauses for a second at a kilohertz. What one that is stopped did not take is
# thrown away when it counts as gone, while no command can be published: half a second for 10,000.
_COMMANDS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)

# A repeated state means that its answer was lost only if it was sent this long after the answer,
# ns; otherwise both were under way at the same time.
_CROSSING_TIME = NANO // 10
# Real s that a new publisher waits for its subscriptions.
_DISCOVERY_TIME = 1.0
# Label of a zero command that answers no joint state. A drive obeys it as any other; a simulation
# in lockstep must not take it for the answer it waits for.
UNASKED = 'unasked'
JOINT = 'joint'
# Command interface to the unit in the label of a command.
UNIT_OF = {'current': 'A', 'effort': TORQUE_UNIT}
# Real s that a stopped reader may take to acknowledge the last zero, before its publisher is
# destroyed, and between looks; a wait in the middleware would hold Python's interpreter lock.
_ACKNOWLEDGEMENT_TIME, _LOOK = 2.0, 0.005
# Real s that the watchdog waits for a blocked publication before it publishes zero.
_LOCK_TIMEOUT = 0.005


def command_unit(message: Any) -> str:
    """Return the unit in the label of a command, '' if there is none."""
    dimensions = message.layout.dim
    return str(dimensions[1].label) if len(dimensions) > 1 else ''


def publisher_names(node: Any, topic: str) -> list[str]:
    """Return the full node name of each publisher of a topic."""
    # A publisher may be discovered some time before its node.
    return sorted('an unknown node' if info.node_name == '_NODE_NAME_UNKNOWN_' else
                  f'{info.node_namespace.rstrip("/")}/{info.node_name}'
                  for info in node.get_publishers_info_by_topic(node.resolve_topic_name(topic)))


def competing_publishers(node: Any, *topics: str) -> list[str]:
    """Return the publishers of topics that only one node should publish; empty if it is one."""
    # Counting is faster than asking for names.
    counts = [node.count_publishers(node.resolve_topic_name(topic)) for topic in topics]
    if sum(counts) < 2:
        return []
    names = [publisher_names(node, topic) for topic in topics]
    one = max(counts) < 2 and len({tuple(some) for some in names}) == 1
    return [] if one else sorted(name for some in names for name in some)


class CommandPort:
    """Publishes `current_command`, one message for each joint state; it is a `Port`.

    A plant in lockstep repeats a state that was not answered, which must be answered again only if
    the answer was lost. In simulated time, the label of an answer is therefore the stamp of its
    state, and the plant ignores other answers. The publisher exists only while the port is open:
    every node with a publisher may command the motor, and the others can see it.

    `limits` are the largest currents of the joints in A, `torques` those at the joints, k_t·n in
    N·m per A.
    """

    def __init__(self, node: Any, limits: Sequence[float], torques: Sequence[float],
                 interface: str = 'current') -> None:
        self._node = node
        self._topic = node.resolve_topic_name('current_command')
        self._by_torque = interface == 'effort'
        self.set_limits(limits, torques)
        size = len(self.limits)
        self._message, self._zero = (Float64MultiArray(data=array('d', bytes(8 * size)))
                                     for _ in range(2))
        for message, label in ((self._message, JOINT), (self._zero, UNASKED)):
            message.layout.dim = [
                MultiArrayDimension(label=label, size=size, stride=size),
                MultiArrayDimension(label=UNIT_OF[interface], size=1, stride=1)]
        self._publisher: Any = None
        self._lock = threading.Lock()
        self._sealed = False
        self.ticket = 0
        self.last = [0.0] * size
        self._stamp = self._answered = 0

    def set_limits(self, limits: Sequence[float], torques: Sequence[float]) -> None:
        """Set the largest currents of the joints, A, and their torques, N·m per A."""
        self.limits, self.torques = [float(limit) for limit in limits], list(torques)

    def open(self) -> None:
        """Create the publisher."""
        self._publisher = self._node.create_publisher(Float64MultiArray, self._topic, _COMMANDS)
        self._opened, self._discovered = time.monotonic(), False
        self.last, self._answered = [0.0] * len(self.limits), 0

    def close(self) -> None:
        """Destroy the publisher when its readers have acknowledged everything, zero at last.

        Some of them may be stopped: after two seconds the log says that they have not.
        """
        if self._publisher is None:
            return
        end, ok = time.monotonic() + _ACKNOWLEDGEMENT_TIME, self._node.context.ok
        while ok() and not (acknowledged := self._publisher.wait_for_all_acked(Duration())) and (
                time.monotonic() < end):
            time.sleep(_LOOK)
        if not ok() or not acknowledged:
            self._node.get_logger().error(
                'the last command, zero, was not acknowledged within '
                f'{_ACKNOWLEDGEMENT_TIME:g} s: make sure that the motor has no current')
        with self._lock:
            publisher, self._publisher = self._publisher, None
        self._node.destroy_publisher(publisher)

    @property
    def ready(self) -> bool:
        """Whether the port is open and has discovered its subscriptions, or waited for them."""
        if self._publisher is None:
            return False
        if not self._discovered:
            known = self._node.count_subscribers(self._topic)
            self._discovered = (0 < known <= self.listeners
                                or time.monotonic() - self._opened > _DISCOVERY_TIME)
        return self._discovered

    def answer(self, currents: Sequence[float] | np.ndarray, ticket: int, stamp: int = 0) -> bool:
        """Publish currents in A, one per joint, unless zero was commanded since the ticket.

        Values beyond a limit become the limit. Where one is not finite, all become zero; return
        whether all are finite. `stamp` is that of the answered state, ns; 0 in real time.
        """
        given = np.asarray(currents, dtype=float).tolist()
        finite = all(map(math.isfinite, given))
        values = [0.0 if not finite or -NEGLIGIBLE < value < NEGLIGIBLE
                  else min(max(value, -limit), limit)
                  for value, limit in zip(given, self.limits)]
        self._publish(values, ticket, stamp)
        return finite

    def _publish(self, values: list[float], ticket: int, stamp: int) -> None:
        """Publish values in A, unless zero was commanded since the ticket or is permanent."""
        with self._lock:
            if ticket != self.ticket or self._sealed or self._publisher is None:
                return
            self._message.data = array('d', values if not self._by_torque else [
                value * torque for value, torque in zip(values, self.torques)])
            self._message.layout.dim[0].label = str(stamp) if stamp else JOINT
            self.last, self._stamp = values, stamp
            self._publisher.publish(self._message)
            if ticket != self.ticket:
                # Zero was published while this publication was blocked: repeat it.
                self.last = [0.0] * len(self.limits)
                self._publisher.publish(self._zero)
                return
        self._answered = time.time_ns()

    def repeat(self, sent: int) -> None:
        """Answer a state that was `sent` again, system time in ns, if its first answer was lost."""
        if sent > self._answered + _CROSSING_TIME:
            self.answer(self.last, self.ticket, self._stamp)

    def zero(self, permanent: bool = False) -> None:
        """Command zero current now; `permanent` blocks all later commands."""
        self._sealed = self._sealed or permanent
        self.ticket += 1
        # A blocked publication must not prevent the zero command.
        taken = self._lock.acquire(timeout=_LOCK_TIMEOUT)
        try:
            self.ticket += 1
            self.last = [0.0] * len(self.limits)
            publisher = self._publisher
            if publisher is not None and self._node.context.ok():
                publisher.publish(self._zero)
                self._answered = time.time_ns()
        finally:
            if taken:
                self._lock.release()

    def others(self) -> list[str]:
        """Return the names of other nodes that publish the same topic."""
        own = self._publisher is not None
        if self._node.count_publishers(self._topic) <= own:
            return []
        names = publisher_names(self._node, self._topic)
        if own and (name := self._node.get_fully_qualified_name()) in names:
            names.remove(name)
        return names

    @property
    def listeners(self) -> int:
        """Number of connected subscriptions."""
        return 0 if self._publisher is None else self._publisher.get_subscription_count()
