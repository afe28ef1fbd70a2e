# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes motor currents, or torques of joints: shared by the nodes that drive a motor."""

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

from friction_comp.errors import InputError
from friction_comp.nodes.joint_states import NANO
from friction_comp.nodes.parameters import declare
from friction_comp.topics import TORQUE_UNIT

# Deep enough that a reader may pause for seconds and miss nothing.
RELIABLE = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)

# A state that comes again was sent again because its answer was lost only if it left its sender
# this long after the answer; an earlier one had merely crossed with it.
_CROSSING = NANO // 10
# Real s that a new publisher waits for its listeners.
_MATCHING = 1.0
# Label of a command that answers no joint state: zero of the commander's own accord. A motor obeys
# it as any other; a simulation whose time rests must not take it for the answer it waits for.
UNASKED = 'unasked'
JOINT = 'joint'
# What a robot's controller takes, and how a command names its unit.
UNIT_OF = {'current': 'A', 'effort': TORQUE_UNIT}
# A current below this is zero: what decays would end in denormal numbers, A.
_NOTHING = 1e-12
# Real s that the watchdog waits for a publication under way before it publishes beside it.
_UNDER_WAY = 0.005


def input_qos(node: Any) -> QoSProfile:
    """Declare `input_reliability` and return the quality of service for the node's inputs.

    Best effort receives from every publisher. Reliable receives from reliable ones only, but loses
    nothing, which the lockstep of the simulated plant is faster with.
    """
    kind = declare(
        node, 'input_reliability', 'best_effort',
        'quality of service of the inputs: best_effort receives from every publisher, '
        'reliable from reliable ones only', read_only=True, constraints='best_effort or reliable')
    return RELIABLE if kind == 'reliable' else BEST_EFFORT


def command_interface(node: Any) -> str:
    """Declare `command_interface` and return it.

    Raises
    ------
    InputError
        If it is none of `UNIT_OF`.
    """
    kind = declare(
        node, 'command_interface', 'current',
        'unit of current_command: current, A of the motor; or effort, k_t·n times that, N·m at the '
        'joint', read_only=True, constraints='current or effort')
    if kind not in UNIT_OF:
        raise InputError(f'parameter command_interface: must be current or effort, not {kind!r}')
    return str(kind)


def unit_said(message: Any) -> str:
    """Return the unit that a command names, '' where it names none."""
    dimensions = message.layout.dim
    return str(dimensions[1].label) if len(dimensions) > 1 else ''


def currents_per_effort(node: Any, torques: Sequence[float]) -> list[float]:
    """Declare `effort_holds`; return A for each unit of effort in joint states, a joint each.

    Parameters
    ----------
    node : rclpy.node.Node
    torques : sequence of float
        Torque at each joint in N·m per A: k_t·n.

    Raises
    ------
    InputError
        If it is neither torque nor current.
    """
    kind = declare(
        node, 'effort_holds', 'torque',
        'what effort in joint_states is: torque of the motor at the joint, N·m; or current of the '
        'motor, A', read_only=True, constraints='torque or current')
    if kind not in ('torque', 'current'):
        raise InputError(f'parameter effort_holds: must be torque or current, not {kind!r}')
    return [1.0 if kind == 'current' else 1.0 / torque for torque in torques]


def publishers(node: Any, topic: str) -> list[str]:
    """Return who publishes a topic, by full node name, once for each publisher.

    The middleware may hear of a publisher some time before it hears of its node.
    """
    return sorted('a node not known yet' if info.node_name == '_NODE_NAME_UNKNOWN_' else
                  f'{info.node_namespace.rstrip("/")}/{info.node_name}'
                  for info in node.get_publishers_info_by_topic(node.resolve_topic_name(topic)))


def rivals(node: Any, *topics: str) -> list[str]:
    """Return who publishes topics of which there should be one publisher; empty where there is.

    Of several topics one node may publish each. Counting alone takes microseconds, names more.
    """
    counts = [node.count_publishers(node.resolve_topic_name(topic)) for topic in topics]
    if sum(counts) < 2:
        return []
    names = [publishers(node, topic) for topic in topics]
    one = max(counts) < 2 and len({tuple(some) for some in names}) == 1
    return [] if one else sorted(name for some in names for name in some)


class CommandPort:
    """Publishes `current_command`: one message for each joint state, so that they pair up.

    Float64MultiArray carries no stamp. A plant in lockstep sends a state again when no answer
    came; that must neither be answered twice nor, if the first answer was lost, not at all. In
    simulated time an answer's label therefore is the stamp of its state, and the plant passes over
    what answers another.

    There is a publisher only while the port is open: whoever has one may command the motor, and
    the others can count.

    Zero current may be commanded from any thread, and overtakes: what was asked for before it, by
    its `ticket`, does not go out after it.

    Parameters
    ----------
    node : rclpy.node.Node
    limits : sequence of float
        Largest current of each joint in A.
    torques : sequence of float
        Torque at each joint in N·m per A: k_t·n.
    interface : str
        A key of `UNIT_OF`.

    Attributes
    ----------
    ticket : int
        To be taken before a current is computed.
    last : list of float
        The last command in A.
    """

    def __init__(self, node: Any, limits: Sequence[float], torques: Sequence[float],
                 interface: str = 'current') -> None:
        self._node = node
        self._topic = node.resolve_topic_name('current_command')
        self._by_torque = interface == 'effort'
        self.limits, self.torques = list(limits), list(torques)
        size = len(self.limits)
        self._message, self._zero = (
            self._make(label, size, UNIT_OF[interface]) for label in (JOINT, UNASKED))
        self._stamp = 0
        self._publisher: Any = None
        self._lock = threading.Lock()
        self._sealed = False
        self.ticket = 0
        self.last = [0.0] * size
        self._answered = 0

    @staticmethod
    def _make(label: str, size: int, unit: str) -> Any:
        message = Float64MultiArray(data=array('d', bytes(8 * size)))
        message.layout.dim = [
            MultiArrayDimension(label=label, size=size, stride=size),
            MultiArrayDimension(label=unit, size=1, stride=1)]
        return message

    def open(self) -> None:
        """Make the publisher."""
        self._publisher = self._node.create_publisher(Float64MultiArray, self._topic, RELIABLE)
        self._opened, self._matched = time.monotonic(), False
        self.last, self._answered = [0.0] * len(self.limits), 0

    def close(self) -> None:
        """Give the publisher back when its readers have what it said."""
        if self._publisher is None:
            return
        self.wait()
        with self._lock:
            publisher, self._publisher = self._publisher, None
        self._node.destroy_publisher(publisher)

    @property
    def ready(self) -> bool:
        """Whether the port is open and has found those who listen, or waited for them."""
        if self._publisher is None:
            return False
        if not self._matched:
            known = self._node.count_subscribers(self._topic)
            self._matched = (0 < known <= self.listeners
                             or time.monotonic() - self._opened > _MATCHING)
        return self._matched

    def is_lost(self, sent: int) -> bool:
        """Return whether a state that comes again was sent since its answer was lost.

        Parameters
        ----------
        sent : int
            System time in ns at which its sender published it.
        """
        return sent > self._answered + _CROSSING

    def answer(self, currents: Sequence[float] | np.ndarray, ticket: int, stamp: int = 0) -> bool:
        """Publish currents in A, one a joint, unless zero was commanded since the ticket.

        A value that is not finite goes out as zero, one beyond the limit as the limit.

        Parameters
        ----------
        currents : sequence of float
        ticket : int
            As it was before they were computed.
        stamp : int
            Of the simulated joint state that they answer, ns; 0 in real time.

        Returns
        -------
        bool
            Whether the currents went out.
        """
        values = []
        for value, limit in zip(np.asarray(currents).tolist(), self.limits):
            if not -limit <= value <= limit:
                if not math.isfinite(value):
                    value = 0.0
                value = min(max(value, -limit), limit)
            elif -_NOTHING < value < _NOTHING:
                value = 0.0
            values.append(value)
        with self._lock:
            if ticket != self.ticket or self._sealed or self._publisher is None:
                return False
            self._message.data = array('d', values if not self._by_torque else [
                value * torque for value, torque in zip(values, self.torques)])
            self._message.layout.dim[0].label = str(stamp) if stamp else JOINT
            self.last, self._stamp = values, stamp
            self._publisher.publish(self._message)
            if ticket != self.ticket:
                # Zero went out meanwhile, beside a publication that hung: it has the last word.
                self.last = [0.0] * len(self.limits)
                self._publisher.publish(self._zero)
                return False
        self._answered = time.time_ns()
        return True

    def repeat(self) -> None:
        """Publish the last answer again."""
        self.answer(self.last, self.ticket, self._stamp)

    def zero(self, for_good: bool = False) -> None:
        """Command zero current on all joints, now; `for_good` lets nothing out after it."""
        self._sealed = self._sealed or for_good
        self.ticket += 1
        # A publication that hangs must not keep zero from going out.
        taken = self._lock.acquire(timeout=_UNDER_WAY)
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
        """Return who else has a publisher of the same topic, by node name."""
        own = 0 if self._publisher is None else 1
        if self._node.count_publishers(self._topic) <= own:
            return []
        names = publishers(self._node, self._topic)
        mine = self._node.get_fully_qualified_name()
        if own and mine in names:
            names.remove(mine)
        return sorted(names)

    def wait(self, patience: float = 0.2) -> None:
        """Wait at most `patience` s until every reliable reader has confirmed what was published.

        Confirmations come with the middleware's heartbeat, which may take seconds: this only
        gives a lost message a chance before the publisher goes.
        """
        if self._publisher is not None and self._node.context.ok():
            self._publisher.wait_for_all_acked(Duration(seconds=patience))

    @property
    def listeners(self) -> int:
        """Number of subscriptions that the commands reach."""
        return 0 if self._publisher is None else self._publisher.get_subscription_count()
