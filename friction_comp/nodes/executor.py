# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An executor for nodes whose life is a fast stream of messages."""

from __future__ import annotations

import time

from rclpy.clock import Clock, ClockType
from rclpy.executors import ConditionReachedException, Executor, ShutdownException, TimeoutException

# Real time in s between looks at everything that is not a stream. It also bounds how long a
# signal waits, since Python handles one only when the executor comes back from the middleware.
_BREATH = 0.02


class _Streams:
    """What of a node is waited for with every message: subscriptions and fast timers."""

    clients = services = guards = waitables = ()

    def __init__(self, node, fast):
        self._node = node
        self.timers = list(fast)

    @property
    def subscriptions(self):
        return self._node.subscriptions


class _Rest:
    """What of a node is looked at now and then: services, actions, the other timers."""

    subscriptions = ()

    def __init__(self, node, fast):
        self._node = node
        self._fast = set(fast)

    @property
    def timers(self):
        return [timer for timer in self._node.timers if timer not in self._fast]

    def __getattr__(self, name):
        return getattr(self._node, name)


class StreamExecutor(Executor):
    """Waits for messages alone, and looks at services, actions and timers fifty times a second.

    rclpy builds its wait set anew for every callback, from all that a node has: parameter and
    lifecycle services, an action server's five sockets, events, timers. With those left out most
    of the time, a message costs half.

    Parameters
    ----------
    node : rclpy.node.Node
        The one node to execute. Its attribute `fast_timers` names timers that are not to wait
        for the next look; with an attribute `nap` in s, messages may wait for each other so long,
        and are then taken together, which is cheaper.
    """

    def __init__(self, node):
        super().__init__()
        self.add_node(node)
        self._due = False
        fast = [*node.fast_timers, node.create_timer(
            _BREATH, self._take_breath, clock=Clock(clock_type=ClockType.STEADY_TIME))]
        self._streams = [_Streams(node, fast)]
        self._rest = [_Rest(node, fast)]
        self._nap = getattr(node, 'nap', 0.0)

    def _take_breath(self):
        self._due = True

    def spin_once(self, timeout_sec=None):
        """Execute one message's callback, and whatever else is due."""
        if not self._nap:
            self._execute(timeout_sec, self._streams)
        elif not self._execute(0.0, self._streams):
            time.sleep(self._nap)
        else:
            while self._execute(0.0, self._streams):
                pass
        if self._due:
            self._due = False
            while self._execute(0.0, self._rest):
                pass

    def _execute(self, timeout_sec, nodes):
        try:
            handler, _, _ = self.wait_for_ready_callbacks(timeout_sec, nodes)
        except (ConditionReachedException, ShutdownException, TimeoutException):
            return False
        handler()
        if handler.exception() is not None:
            raise handler.exception()
        return True
