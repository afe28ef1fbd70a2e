# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Joint states in, motor currents out: what the nodes that drive a motor share."""

from __future__ import annotations

from array import array
import time

import numpy as np
from rclpy.duration import Duration
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from friction_comp.nodes.parameters import declare

NANO = 1_000_000_000

# Deep enough that a reader may pause for seconds and miss nothing.
RELIABLE = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)

# A state that comes again was sent again because its answer was lost only if it left its sender
# this long after the answer; an earlier one had merely crossed with it.
_CROSSING = NANO // 10

NEW, AGAIN, CROSSED = 'new', 'again', 'crossed'


def input_qos(node):
    """Declare `input_reliability` and return the quality of service for the node's inputs.

    Best effort hears every publisher. Reliable hears reliable ones only, but loses nothing, which
    the lockstep of the simulated plant is faster with.
    """
    kind = declare(
        node, 'input_reliability', 'best_effort',
        'quality of service of the inputs: best_effort hears every publisher, reliable only '
        'reliable ones', read_only=True, constraints='best_effort or reliable')
    return RELIABLE if kind == 'reliable' else BEST_EFFORT


def nanoseconds(stamp):
    """Return a builtin_interfaces/Time in ns."""
    return stamp.sec * NANO + stamp.nanosec


def set_stamp(stamp, value):
    """Set a builtin_interfaces/Time to a time in ns."""
    stamp.sec, stamp.nanosec = divmod(value, NANO)


class JointColumns:
    """Picks the node's joints out of joint states, whatever their order and company.

    Parameters
    ----------
    joints : list of str
    """

    def __init__(self, joints):
        self._joints = list(joints)
        self._names = None
        self._columns = None
        self._blank = np.full(len(self._joints), np.nan)
        self.missing = list(self._joints)

    def read(self, message):
        """Return position, velocity and effort, each (J,), NaN where there is no value.

        Velocity is None where the message has none. The attribute `missing` names the joints
        that the message lacks.
        """
        if message.name != self._names:
            self._names = list(message.name)
            places = {name: k for k, name in enumerate(self._names)}
            self._columns = [places.get(name, -1) for name in self._joints]
            self.missing = [name for name in self._joints if name not in places]
        position = self._pick(message.position)
        velocity = self._pick(message.velocity) if len(message.velocity) else None
        return position, velocity, self._pick(message.effort)

    def _pick(self, values):
        if len(values) != len(self._names):
            return self._blank.copy()
        return np.array([values[k] if k >= 0 else np.nan for k in self._columns])


class CommandPort:
    """Publishes `current_command`: one message for each joint state, so that they pair up.

    Float64MultiArray carries no stamp. A plant in lockstep therefore counts: the first command
    after a state is its answer. It sends a state again when no answer came; that must neither be
    answered twice nor, if the first answer was lost, not at all.

    Parameters
    ----------
    node : rclpy.node.Node
    joints : list of str
    """

    def __init__(self, node, joints):
        self._node = node
        self._zeros = array('d', bytes(8 * len(joints)))
        self._message = Float64MultiArray(data=array('d', self._zeros))
        self._message.layout.dim = [MultiArrayDimension(
            label='joint', size=len(joints), stride=len(joints))]
        self._publisher = node.create_publisher(Float64MultiArray, 'current_command', RELIABLE)
        self.forget()

    def forget(self):
        """Take the next state as new whatever its stamp."""
        self._stamp = None
        self._answered = 0

    def judge(self, stamp, sent):
        """Return NEW, AGAIN (to be answered with `repeat`) or CROSSED (not to be answered).

        Parameters
        ----------
        stamp : int
            Stamp of the state in ns; zero where the driver gives none.
        sent : int
            System time in ns at which its sender published it.
        """
        if stamp == 0 or stamp != self._stamp:
            return NEW
        return AGAIN if sent > self._answered + _CROSSING else CROSSED

    def answer(self, stamp, currents):
        """Publish currents in A, (J,), as the answer to the state with this stamp.

        A value that is not finite goes out as zero.
        """
        values = np.asarray(currents, dtype=float)
        if not np.isfinite(values).all():
            values = np.where(np.isfinite(values), values, 0.0)
        self._message.data = array('d', values.tobytes())
        self._stamp = stamp
        self.repeat()

    def repeat(self):
        """Publish the last answer again."""
        self._publisher.publish(self._message)
        self._answered = time.time_ns()

    def zero(self):
        """Command zero current on all joints."""
        if not self._node.context.ok():
            return
        self._message.data = array('d', self._zeros)
        self._publisher.publish(self._message)
        self.forget()

    def wait(self, patience=0.2):
        """Wait at most `patience` s until every reliable reader has confirmed what was published.

        Confirmations come with the middleware's heartbeat, which may take seconds: this only
        gives a lost message a chance before the publisher goes.
        """
        self._publisher.wait_for_all_acked(Duration(seconds=patience))

    def destroy(self):
        """Give the publisher back."""
        self._node.destroy_publisher(self._publisher)

    @property
    def last(self):
        """The last command, list of A."""
        return list(self._message.data)

    @property
    def listeners(self):
        """Number of subscriptions that the commands reach."""
        return self._publisher.get_subscription_count()
