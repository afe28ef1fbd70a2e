# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An executor for nodes that process a fast stream of messages."""

from __future__ import annotations

from contextlib import ExitStack
import inspect
import time
from typing import Any

from rclpy.executors import (
    ConditionReachedException,
    Executor,
    ExternalShutdownException,
    ShutdownException,
    TimeoutException,
)
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.subscription import Subscription
from rclpy.waitable import NumberOfEntities

# Real time in s between looks at everything that is not a stream. It also bounds how long a
# signal waits, since Python handles one only when the executor comes back from the middleware.
_BREATH = 0.02
_NANO = 1_000_000_000


class _Streams:
    """What is waited for with every message: the subscriptions and fast timers of a node.

    The wait set is made once, and again only when the node has got or lost a subscription.

    Subscriptions come in the order in which the node made them. Before a message is taken from
    one, all that has arrived for those before it has been taken: a node whose answer to one topic
    depends on what came before it over another makes the other subscription first.
    """

    def __init__(self, node: Any, timers: list[Any], guard: GuardCondition) -> None:
        self._node, self._timers, self._guard = node, timers, guard
        self._held = ExitStack()
        self._subscriptions: list[tuple[Any, Any, bool, Any, bool]] = []
        self._wait_set: Any = None

    def renew(self) -> None:
        """Take note of which subscriptions there are now."""
        self._held.close()
        subscriptions = list(self._node.subscriptions)
        # Held, so that none goes while it is waited for.
        for one in (*subscriptions, *self._timers, self._guard, self._node.context):
            self._held.enter_context(one.handle)
        self._subscriptions = [
            (one.handle, one.msg_type, one.raw, one.callback,
             one._callback_type is Subscription.CallbackType.MessageOnly)
            for one in subscriptions]
        self._wait_set = _rclpy.WaitSet(
            len(subscriptions), 1, len(self._timers), 0, 0, 0, self._node.context.handle)

    def close(self) -> None:
        """Let go of everything."""
        self._held.close()

    def wait(self, seconds: float) -> list[Any]:
        """Wait until something has come, and take it; return callbacks that go on later."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        for handle, *_ in self._subscriptions:
            wait_set.add_subscription(handle)
        for timer in self._timers:
            wait_set.add_timer(timer.handle)
        wait_set.add_guard_condition(self._guard.handle)
        wait_set.wait(int(seconds * _NANO))
        begun: list[Any] = []
        for timer in self._timers:
            if timer.handle.is_timer_ready():
                timer.handle.call_timer()
                _add(timer.callback(), begun)
        last = -1
        for index in range(len(self._subscriptions)):
            if wait_set.is_ready('subscription', index):
                last = index
        for index in range(last + 1):
            taken = self._take(index, begun)
            while taken and index < last:
                taken = self._take(index, begun)
        return begun

    def _take(self, index: Any, begun: Any) -> bool:
        handle, kind, raw, callback, message_only = self._subscriptions[index]
        message = handle.take_message(kind, raw)
        if message is None:
            return False
        _add(callback(message[0]) if message_only else callback(*message), begun)
        return True


def _add(result: Any, begun: Any) -> None:
    if inspect.iscoroutine(result):
        begun.append(result)


class _Rest:
    """The entities that are polled less often: services, actions, events, other timers.

    A wait set that is made once, and again only when the node has got or lost something, tells
    whether there is anything to do. rclpy makes one for every look, which takes milliseconds.

    To rclpy's executor this is the node, without the fast streams, which are processed here.
    """

    subscriptions = ()
    timers = ()

    def __init__(self, node: Any, fast: list[Any]) -> None:
        self._node = node
        self._fast = set(fast)
        self._held = ExitStack()
        self._slow: list[Any] = []
        self._entities: dict[str, list[Any]] = {}
        self._waitables: list[Any] = []
        self._wait_set: Any = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._node, name)

    def renew(self) -> None:
        """Update the list of entities."""
        self._held.close()
        node = self._node
        self._slow = [timer for timer in node.timers if timer not in self._fast]
        kinds = {'client': list(node.clients), 'service': list(node.services),
                 'guard_condition': list(node.guards)}
        self._entities, self._waitables = kinds, list(node.waitables)
        count = NumberOfEntities(
            0, len(kinds['guard_condition']), 0, len(kinds['client']), len(kinds['service']))
        for waitable in self._waitables:
            count += waitable.get_num_entities()
            self._held.enter_context(waitable)
        for one in (*self._slow, *(one for several in kinds.values() for one in several),
                    node.context):
            self._held.enter_context(one.handle)
        self._wait_set = _rclpy.WaitSet(
            count.num_subscriptions, count.num_guard_conditions, count.num_timers,
            count.num_clients, count.num_services, count.num_events, node.context.handle)

    def close(self) -> None:
        """Let go of everything."""
        self._held.close()

    def call_timers(self) -> list[Any]:
        """Call the timers that are due; return callbacks that go on later."""
        begun: list[Any] = []
        for timer in self._slow:
            if timer.handle.is_timer_ready():
                timer.handle.call_timer()
                _add(timer.callback(), begun)
        return begun

    def is_waiting(self) -> bool:
        """Return whether any of them is ready."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        for kind, several in self._entities.items():
            add = getattr(wait_set, f'add_{kind}')
            for one in several:
                add(one.handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(wait_set)
        wait_set.wait(0)
        ready = False
        for kind, several in self._entities.items():
            for index, one in enumerate(several):
                if wait_set.is_ready(kind, index):
                    ready = True
                    if kind == 'guard_condition':
                        # Looking has taken its trigger; so rclpy knows of it all the same.
                        one._executor_triggered = True
        for waitable in self._waitables:
            ready = waitable.is_ready(wait_set) or ready
        return ready


class StreamExecutor(Executor):
    """Waits for messages alone, and looks at services, actions and timers fifty times a second.

    rclpy builds its wait set again for every callback, from all that a node has: parameter and
    lifecycle services, an action server's five sockets, events, timers. Here a message waits for
    none of that.

    Parameters
    ----------
    node : rclpy.node.Node
        The one node to execute. Its attribute `fast_timers` names timers that are not to wait
        for the next look; with an attribute `nap` in s, messages may wait for each other so long,
        and are then taken together, which is cheaper.
    """

    def __init__(self, node: Any) -> None:
        self._changed: GuardCondition | None = None
        super().__init__(context=node.context)
        self._changed = GuardCondition(None, None, context=node.context)
        self._is_changed = True
        self.add_node(node)
        self._streams = _Streams(node, list(node.fast_timers), self._changed)
        self._rest = _Rest(node, node.fast_timers)
        self._nap = getattr(node, 'nap', 0.0)
        self._due = 0.0

    def wake(self) -> None:
        """Take note that the node has got or lost something."""
        super().wake()
        if self._changed is not None:
            self._is_changed = True
            self._changed.trigger()

    def shutdown(self, timeout_sec: Any = None) -> Any:
        """Let go of the node."""
        self._streams.close()
        self._rest.close()
        return super().shutdown(timeout_sec)

    def spin_once(self, timeout_sec: Any = None) -> None:
        """Process ready messages, and poll the rest when it is due or when not waiting."""
        left = max(0.0, self._due - time.monotonic())
        self._attend(left if timeout_sec is None else min(left, timeout_sec))
        if timeout_sec == 0.0 or time.monotonic() >= self._due:
            self._look()
            self._due = time.monotonic() + _BREATH

    def _attend(self, seconds: Any) -> None:
        self._renew()
        for one in self._streams.wait(0.0 if self._nap else seconds):
            self.create_task(one)
        if self._nap:
            time.sleep(min(self._nap, seconds))

    def _renew(self) -> None:
        if self._is_changed:
            self._is_changed = False
            self._streams.renew()
            self._rest.renew()

    def _look(self) -> None:
        """Attend to everything that is not a stream."""
        if not self.context.ok():
            raise ExternalShutdownException
        for one in self._rest.call_timers():
            self.create_task(one)
        self._go_on_with_tasks()
        # What a callback has destroyed must not be waited for.
        self._renew()
        if self._rest.is_waiting():
            while self._execute_rest():
                pass

    def _go_on_with_tasks(self) -> None:
        with self._tasks_lock:
            self._tasks[:] = [one for one in self._tasks if not one[0].done()]
            tasks = [task for task, *_ in self._tasks if not task.executing()]
        for task in tasks:
            _execute(task)

    def _execute_rest(self) -> bool:
        try:
            handler, _, _ = self.wait_for_ready_callbacks(0.0, [self._rest])
        except (ConditionReachedException, ShutdownException, TimeoutException):
            return False
        _execute(handler)
        return True


def _execute(task: Any) -> None:
    task()
    if task.exception() is not None:
        raise task.exception()
