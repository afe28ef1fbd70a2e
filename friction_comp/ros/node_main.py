# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Starts, runs and ends every node, with an executor for frequent messages.

Every callback passes the executor, so it is also the one place where what reaches a node cannot end
it: a message that raises an error is ignored, a request is refused, each with a word in the log.
Only InputError, by which a node says that it cannot go on, and errors of timers, which nothing from
outside calls, end the spinning.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, TimeoutError
from contextlib import ExitStack, suppress
import gc
import inspect
import os
import signal
import sys
import threading
import time
import traceback
import types
from typing import Any, TypeVar

import rclpy
from rclpy import executors
from rclpy.action import ActionServer
from rclpy.exceptions import ROSInterruptException
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.utilities import remove_ros_args

from friction_comp.errors import InputError
from friction_comp.interrupts import ENDING, STOPPING
from friction_comp.messages import NANO
from friction_comp.ros.ros_start import dropping_log, start_ros, without_source_locations

T = TypeVar('T')

# Real s between polls of everything but the streams. It also limits the delay of signals, which
# Python handles only when the executor returns from the middleware.
_POLL_PERIOD = 0.02
# Real s that work in a thread may take, and between two words on what is refused.
_PATIENCE, _AGAIN = 10.0, 1.0
# Spins after leaving, and real s of them if a goal ended by it: its client may ask only now.
_FINAL_SPINS, _FAREWELL = 10, 0.3
# Switch interval of threads, s: loading a model must not delay the control loop.
_SWITCH_INTERVAL = 5e-4


@types.coroutine
def yield_to_executor() -> Generator[None, None, None]:
    """Return control to the executor once, from a coroutine that it runs."""
    yield


class _StreamSet:
    """A wait set of messages and timers, built once; rclpy builds one for every callback."""

    def __init__(self, context: Any, guard: Any, subscriptions: list[Any], timers: list[Any]
                 ) -> None:
        # Hold the handles, so that none is destroyed while it is in the wait set.
        held = ExitStack()
        for entity in (context, guard, *subscriptions, *timers):
            held.enter_context(entity.handle)
        self.close = held.close
        self._count = len(subscriptions)
        self._set = _rclpy.WaitSet(self._count, 1, len(timers), 0, 0, 0, context.handle)
        self._added = [(self._set.add_guard_condition, guard.handle),
                       *((self._set.add_subscription, one.handle) for one in subscriptions),
                       *((self._set.add_timer, one.handle) for one in timers)]

    def wait(self, seconds: float) -> int:
        """Wait for something to happen; return the last subscription with a message, or -1."""
        self._set.clear_entities()
        for add, handle in self._added:
            add(handle)
        self._set.wait(int(seconds * NANO))
        return max((index for index in range(self._count)
                    if self._set.is_ready('subscription', index)), default=-1)


class _SlowEntities:
    """The node for rclpy's executor, without the streams and timers that are processed here."""

    subscriptions = timers = ()

    def __init__(self, node: Any) -> None:
        self._node = node

    def __getattr__(self, name: str) -> Any:
        return getattr(self._node, name)


class StreamExecutor(executors.Executor):
    """Waits for messages and timers only, and polls services and actions fifty times per second.

    That saves half of rclpy's processor time (bench/round_trip.py). Before a message is taken from
    a subscription, all messages of those created earlier are taken: a node whose answer to a topic
    depends on another topic subscribes to that one first. A node may have a `batch_time` in s, by
    which messages may be delayed to be processed together, which is cheaper.
    """

    def __init__(self, node: Any) -> None:
        super().__init__(context=node.context)
        self._is_changed = True
        self._node, self._slow_entities = node, _SlowEntities(node)
        self._batch_time = getattr(node, 'batch_time', 0.0)
        self._subscriptions: list[tuple[Any, ...]] = []
        self._timers: list[Any] = []
        self._set: _StreamSet | None = None
        self._due = 0.0
        self._said: dict[str, float] = {}
        self.add_node(node)

    def wake(self) -> None:
        """Note that the node's entities have changed."""
        self._is_changed = True
        super().wake()

    @property
    def has_coroutines(self) -> bool:
        """Whether a callback, such as a goal, has not ended yet."""
        return any(not task.done() for task, *_ in self._tasks)

    def shutdown(self, timeout_sec: Any = None) -> Any:
        """Release the node."""
        if self._set is not None:
            self._set.close()
        return super().shutdown(timeout_sec)

    def spin_once(self, timeout_sec: Any = None) -> None:
        """Process ready messages, and poll the rest when it is due or when not waiting."""
        left = max(0.0, self._due - time.monotonic())
        self._process_streams(left if timeout_sec is None else min(left, timeout_sec))
        if timeout_sec == 0.0 or time.monotonic() >= self._due:
            self._poll()
            self._due = time.monotonic() + _POLL_PERIOD

    def do_beside(self, work: Callable[[], T], what: str) -> T:
        """Do work in a thread, while streams and timers go on; return its result.

        Raises InputError where the work fails, or takes longer than ten seconds.
        """
        future: Future[T] = Future()

        def run() -> None:
            try:
                future.set_result(work())
            except Exception as error:
                future.set_exception(error)
        # A daemon, unlike an executor's: work that hangs must not hold up the end of the node.
        threading.Thread(target=run, name=what, daemon=True).start()
        end = time.monotonic() + _PATIENCE
        while not future.done() and time.monotonic() < end:
            self._process_streams(_POLL_PERIOD)
        try:
            return future.result(0.0)
        except InputError:
            raise
        except TimeoutError:
            raise InputError(f'{what}: not done within {_PATIENCE:g} s') from None
        except Exception as error:
            raise InputError(f'{what}: {error!r}') from None

    def _stream_set(self) -> _StreamSet:
        """Return the wait set of streams, rebuilt if entities have changed."""
        if self._is_changed or self._set is None:
            self._is_changed = False
            if self._set is not None:
                self._set.close()
            node, subscriptions = self._node, list(self._node.subscriptions)
            self._subscriptions = [
                (entity, entity.handle, entity.msg_type, entity.raw, entity.callback,
                 _arguments(entity.callback) == 1) for entity in subscriptions]
            self._timers = list(node.timers)
            # The base class triggers its guard when the node's entities have changed.
            self._set = _StreamSet(node.context, self._guard, subscriptions, self._timers)
        return self._set

    def _process_streams(self, seconds: float) -> None:
        """Wait for messages or timers, and process them."""
        last_ready = self._stream_set().wait(0.0 if self._batch_time else seconds)
        # The last ready one gives a single message, before which all of the earlier ones are taken
        # (see the class). Use a copy, since a callback may replace the list.
        for index, subscription in enumerate(self._subscriptions[:last_ready + 1]):
            while self._take(*subscription) and index < last_ready:
                pass
        for timer in self._timers:
            if timer.handle.is_timer_ready():
                timer.handle.call_timer()
                self._schedule(timer.callback())
        if self._batch_time:
            time.sleep(min(self._batch_time, seconds))

    def _take(self, entity: Any, handle: Any, kind: Any, raw: bool, callback: Any,
              message_only: bool) -> bool:
        try:
            message = handle.take_message(kind, raw)
            if message is None:
                return False
            self._schedule(callback(message[0]) if message_only else callback(*message))
        except InputError:
            raise
        except Exception as error:
            self._refuse(f'a message on {entity.topic_name} was ignored', error)
            return False
        return True

    def _take_service(self, service: Any) -> Any:
        """Return what answers a request, as rclpy does; a request that raises is refused."""
        with service.handle:
            request, header = service.handle.service_take_request(service.srv_type.Request)

        async def answer() -> None:
            if header is None:
                return
            response = service.srv_type.Response()
            try:
                response = await executors.await_or_execute(service.callback, request, response)
            except Exception as error:
                text = self._refuse(f'a request to {service.srv_name} was refused', error)
                # All that says success is false by default.
                response = service.srv_type.Response()
                if hasattr(response, 'message'):
                    response.message = text
            service.send_response(response, header)
        return answer

    def _refuse(self, what: str, error: Exception) -> str:
        """Log what was refused because of an error, and return the text."""
        why = without_source_locations(error) or repr(error)
        text, now = f'{what}: {why}', time.monotonic()
        if now - self._said.get(what, -_AGAIN) >= _AGAIN:
            self._said[what] = now
            self._node.get_logger().error(text)
        return text

    def _schedule(self, result: Any) -> None:
        """Continue a callback later if it waits."""
        if inspect.iscoroutine(result):
            self.create_task(result)

    def _poll(self) -> None:
        """Process services and actions."""
        if not self.context.ok():
            raise executors.ExternalShutdownException
        with suppress(executors.ShutdownException, executors.TimeoutException):
            # One pass over the waiting callbacks and what is ready ends with a timeout.
            while True:
                task, entity, _ = self.wait_for_ready_callbacks(0.0, [self._slow_entities])
                task()
                error = task.exception()
                if error is not None:
                    name = getattr(entity, 'srv_name', type(entity).__name__)
                    self._refuse(f'what reached {name} was ignored', error)
                    _release(entity)


def _arguments(callback: Any) -> int:
    """Return how many arguments a callback needs: the message, and the middleware's info on it."""
    return sum(one.default is one.empty for one in inspect.signature(callback).parameters.values())


def _release(entity: Any) -> None:
    """Let an entity, and others of its group, be called again after an error before its call."""
    if entity is not None:
        entity._executor_event = False
        with suppress(AssertionError):
            entity.callback_group.ending_execution(entity)


def run(name: str, make_node: Callable[[], Any], argv: Sequence[str]) -> int:
    """Start a node, spin it until it is done or a signal ends it, and shut it down in order.

    Return 0 if it ended by itself or by a signal, also one that would stop the process (Ctrl-Z), 1
    after an exception; raise InputError if an argument, parameter or file cannot be used. rclpy
    would shut the context down at a signal, so that zero could no longer be published.

    A node may have a method `leave()`, which is always called at the end, and an attribute
    `finished`, with which it ends by itself. One that drives a motor has `stop_motor()`, which
    commands zero current and blocks all later commands; it is called in another thread as soon as a
    signal arrives, and at the end whatever happened.
    """
    signals = _Signals()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    try:
        unknown = remove_ros_args([name, *argv])[1:]
    except Exception as error:
        raise InputError(f'ROS arguments: {without_source_locations(error)}') from None
    if unknown:
        raise InputError(f'unrecognized arguments: {" ".join(unknown)} (parameters and remappings '
                         'come after --ros-args)')
    with dropping_log():
        start_ros(name, argv)
        try:
            return _run(make_node, signals)
        finally:
            rclpy.try_shutdown()


def _run(make_node: Callable[[], Any], signals: _Signals) -> int:
    node, why = None, ''
    try:
        node = make_node()
    except (InputError, _rclpy.RCLError) as error:
        # For instance missing keys, or a middleware without security.
        why = without_source_locations(error)
    if node is None:
        # What there is of it must be gone before the middleware.
        gc.collect()
        raise InputError(why)
    stop_motor = getattr(node, 'stop_motor', lambda: None)
    signals.set_callback(stop_motor)
    executor = StreamExecutor(node)
    # The first line that rclpy logs looks for its caller through all modules, for 50 ms.
    inspect.getframeinfo(inspect.currentframe())    # type: ignore[arg-type]
    # Exclude long-lived objects from garbage collection between samples.
    gc.collect()
    gc.freeze()
    try:
        while not signals.caught and not getattr(node, 'finished', False):
            executor.spin_once()
    except (executors.ExternalShutdownException, ROSInterruptException):
        pass
    except InputError:
        raise
    except Exception:
        node.get_logger().fatal(f'stopped by an error:\n{traceback.format_exc()}')
        return 1
    finally:
        # First, so that zero is the last command also if leaving fails.
        stop_motor()
        getattr(node, 'leave', lambda: None)()
        # Publish what leaving has caused, such as the result of an action.
        end = time.monotonic() + _FAREWELL * executor.has_coroutines
        for _ in range(_FINAL_SPINS):
            executor.spin_once(0.0)
        while time.monotonic() < end:
            executor.spin_once()
        # Its wait set holds the node's entities, and must not outlive the context.
        executor.shutdown(0.0)
        _destroy(node)
    return 0


def _destroy(node: Any) -> None:
    """Destroy a node, and what `destroy_node` forgets.

    That would keep the node in the middleware until the process is over.
    """
    for waitable in list(node.waitables):
        if isinstance(waitable, ActionServer):
            waitable.destroy()
    node.destroy_node()
    state_machine = getattr(node, '_state_machine', None)
    if state_machine is not None:
        state_machine.destroy_when_not_in_use()


class _Signals:
    """Catches signals.

    Python runs signal handlers only in the main thread, when it returns to the interpreter. A
    separate thread is notified at once through the interpreter's wakeup pipe.
    """

    def __init__(self) -> None:
        self.caught: list[int] = []
        self._callback: Callable[[], None] = lambda: None
        for signum in (*ENDING, *STOPPING):
            signal.signal(signum, lambda signum, _: self.caught.append(signum))
        end, begin = os.pipe()
        os.set_blocking(begin, False)
        signal.set_wakeup_fd(begin, warn_on_full_buffer=False)
        self._arrived = False
        threading.Thread(
            target=self._listen, args=(end,), name='signals', daemon=True).start()

    def set_callback(self, callback: Callable[[], None]) -> None:
        """Set the function to call, in another thread, at a signal; call it now if one arrived."""
        self._callback = callback
        if self._arrived:
            callback()

    def _listen(self, end: int) -> None:
        while os.read(end, 16):
            self._arrived = True
            self._callback()

