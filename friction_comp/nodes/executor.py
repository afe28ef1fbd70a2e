# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An executor for nodes that process frequent messages."""

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

# Real s between polls of everything but the streams. It also limits the delay of signals, which
# Python handles only when the executor returns from the middleware.
_POLL_PERIOD = 0.02
_NANO = 1_000_000_000


class _Streams:
    """The subscriptions and fast timers of a node, in one wait set.

    The wait set is rebuilt only when the node's subscriptions have changed.

    Subscriptions are processed in the order of their creation: before a message is taken from one,
    all messages of those before it are taken. A node whose answer to a topic depends on earlier
    messages of another topic subscribes to that one first.
    """

    def __init__(self, node: Any, timers: list[Any], guard: GuardCondition) -> None:
        self._node, self._timers, self._guard = node, timers, guard
        self._held = ExitStack()
        self._subscriptions: list[tuple[Any, Any, bool, Any, bool]] = []
        self._wait_set: Any = None

    def rebuild(self) -> None:
        """Rebuild the wait set from the present subscriptions."""
        self._held.close()
        subscriptions = list(self._node.subscriptions)
        # Hold the handles, so that none is destroyed while it is in the wait set.
        for entity in (*subscriptions, *self._timers, self._guard, self._node.context):
            self._held.enter_context(entity.handle)
        self._subscriptions = [
            (entity.handle, entity.msg_type, entity.raw, entity.callback,
             entity._callback_type is Subscription.CallbackType.MessageOnly)
            for entity in subscriptions]
        self._wait_set = _rclpy.WaitSet(
            len(subscriptions), 1, len(self._timers), 0, 0, 0, self._node.context.handle)

    def close(self) -> None:
        """Release the handles."""
        self._held.close()

    def wait(self, seconds: float) -> list[Any]:
        """Wait for messages or timers and process them; return unfinished coroutines."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        for handle, *_ in self._subscriptions:
            wait_set.add_subscription(handle)
        for timer in self._timers:
            wait_set.add_timer(timer.handle)
        wait_set.add_guard_condition(self._guard.handle)
        wait_set.wait(int(seconds * _NANO))
        coroutines: list[Any] = []
        for timer in self._timers:
            if timer.handle.is_timer_ready():
                timer.handle.call_timer()
                _collect(timer.callback(), coroutines)
        last = -1
        for index in range(len(self._subscriptions)):
            if wait_set.is_ready('subscription', index):
                last = index
        for index in range(last + 1):
            taken = self._take(index, coroutines)
            while taken and index < last:
                taken = self._take(index, coroutines)
        return coroutines

    def _take(self, index: Any, coroutines: Any) -> bool:
        handle, kind, raw, callback, message_only = self._subscriptions[index]
        message = handle.take_message(kind, raw)
        if message is None:
            return False
        _collect(callback(message[0]) if message_only else callback(*message), coroutines)
        return True


def _collect(result: Any, coroutines: Any) -> None:
    if inspect.iscoroutine(result):
        coroutines.append(result)


class _SlowEntities:
    """The entities that are polled less often: services, actions, events, other timers.

    One wait set, rebuilt only when the node's entities have changed, shows whether any of them is
    ready. rclpy builds a wait set for every poll, which takes milliseconds.

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

    def rebuild(self) -> None:
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
        for entity in (*self._slow, *(entity for entities in kinds.values() for entity in entities),
                    node.context):
            self._held.enter_context(entity.handle)
        self._wait_set = _rclpy.WaitSet(
            count.num_subscriptions, count.num_guard_conditions, count.num_timers,
            count.num_clients, count.num_services, count.num_events, node.context.handle)

    def close(self) -> None:
        """Release the handles."""
        self._held.close()

    def call_timers(self) -> list[Any]:
        """Call the timers that are due; return unfinished coroutines."""
        coroutines: list[Any] = []
        for timer in self._slow:
            if timer.handle.is_timer_ready():
                timer.handle.call_timer()
                _collect(timer.callback(), coroutines)
        return coroutines

    def is_waiting(self) -> bool:
        """Return whether any of them is ready."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        for kind, entities in self._entities.items():
            add = getattr(wait_set, f'add_{kind}')
            for entity in entities:
                add(entity.handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(wait_set)
        wait_set.wait(0)
        ready = False
        for kind, entities in self._entities.items():
            for index, entity in enumerate(entities):
                if wait_set.is_ready(kind, index):
                    ready = True
                    if kind == 'guard_condition':
                        # Waiting has consumed the trigger: pass it on to rclpy.
                        entity._executor_triggered = True
        for waitable in self._waitables:
            ready = waitable.is_ready(wait_set) or ready
        return ready


class StreamExecutor(Executor):
    """Waits for messages only, and polls services, actions and timers fifty times a second.

    rclpy rebuilds its wait set for every callback from all entities of a node: parameter and
    lifecycle services, five entities of each action server, events and timers. Here none of them
    delays a message. The simulated loop in lockstep runs at 2.5 times real time instead of 1.1
    with rclpy's SingleThreadedExecutor, for a third of the processor time (bench/lockstep.py). At
    1 kHz the median round trip is the same with both, within noise, and the processor time half
    (bench/round_trip.py).

    Parameters
    ----------
    node : rclpy.node.Node
        The only node to execute. Its attribute `fast_timers`, if any, lists timers that must not
        wait for the next poll. With an attribute `nap` in s, messages may be delayed by that time
        and are then processed together, which is cheaper.
    """

    def __init__(self, node: Any) -> None:
        self._changed: GuardCondition | None = None
        super().__init__(context=node.context)
        self._changed = GuardCondition(None, None, context=node.context)
        self._is_changed = True
        self.add_node(node)
        fast_timers = list(getattr(node, 'fast_timers', ()))
        self._streams = _Streams(node, fast_timers, self._changed)
        self._slow_entities = _SlowEntities(node, fast_timers)
        self._nap = getattr(node, 'nap', 0.0)
        self._due = 0.0

    def wake(self) -> None:
        """Note that the node's entities have changed."""
        super().wake()
        if self._changed is not None:
            self._is_changed = True
            self._changed.trigger()

    def shutdown(self, timeout_sec: Any = None) -> Any:
        """Release the node."""
        self._streams.close()
        self._slow_entities.close()
        return super().shutdown(timeout_sec)

    def spin_once(self, timeout_sec: Any = None) -> None:
        """Process ready messages, and poll the rest when it is due or when not waiting."""
        left = max(0.0, self._due - time.monotonic())
        self._process_streams(left if timeout_sec is None else min(left, timeout_sec))
        if timeout_sec == 0.0 or time.monotonic() >= self._due:
            self._poll()
            self._due = time.monotonic() + _POLL_PERIOD

    def _process_streams(self, seconds: Any) -> None:
        self._rebuild()
        for coroutine in self._streams.wait(0.0 if self._nap else seconds):
            self.create_task(coroutine)
        if self._nap:
            time.sleep(min(self._nap, seconds))

    def _rebuild(self) -> None:
        if self._is_changed:
            self._is_changed = False
            self._streams.rebuild()
            self._slow_entities.rebuild()

    def _poll(self) -> None:
        """Process everything but the streams."""
        if not self.context.ok():
            raise ExternalShutdownException
        for coroutine in self._slow_entities.call_timers():
            self.create_task(coroutine)
        self._continue_tasks()
        # Callbacks may have destroyed entities.
        self._rebuild()
        if self._slow_entities.is_waiting():
            while self._execute_slow():
                pass

    def _continue_tasks(self) -> None:
        with self._tasks_lock:
            self._tasks[:] = [entry for entry in self._tasks if not entry[0].done()]
            tasks = [task for task, *_ in self._tasks if not task.executing()]
        for task in tasks:
            _execute(task)

    def _execute_slow(self) -> bool:
        try:
            handler, _, _ = self.wait_for_ready_callbacks(0.0, [self._slow_entities])
        except (ConditionReachedException, ShutdownException, TimeoutException):
            return False
        _execute(handler)
        return True


def _execute(task: Any) -> None:
    task()
    if task.exception() is not None:
        raise task.exception()
