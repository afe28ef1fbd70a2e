# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A ROS 2 node for tools: action client, service calls and diagnostics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, ExitStack
import time
from typing import Any, TypeVar

from action_msgs.msg import GoalStatus
from diagnostic_msgs.msg import DiagnosticArray
from friction_comp_interfaces.action import IdentifyFriction, RefineModel
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_msgs.msg import Int8MultiArray

from friction_comp.errors import InputError
from friction_comp.nodes.ros_start import own_node

Client = TypeVar('Client', bound='DemoClient')

# Time after which an unanswered request is sent again, and time to send a cancellation, s.
_ANSWER_TIME, _CANCEL_TIME = 5.0, 0.5


class DemoClient:
    """A separate node for a tool; closed with the ``with`` block.

    Parameters
    ----------
    check : callable
        Called while waiting; may raise an error to stop it.
    patience : float
        Timeout in s of everything but an identification.
    """

    def __init__(self, check: Callable[[], object] = lambda: None,
                 patience: float = 60.0) -> None:
        self._check = check
        self._patience = patience
        self._status: dict[str, dict[str, str]] = {}

    def __enter__(self: Client) -> Client:
        self._stack = ExitStack()
        self._node = self._stack.enter_context(own_node('demo'))
        self._executor = SingleThreadedExecutor(context=self._node.context)
        self._stack.callback(self._executor.shutdown)
        self._executor.add_node(self._node)
        self._node.create_subscription(
            DiagnosticArray, '/diagnostics', self._on_diagnostics, 50)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            # As diagnostic_updater names it: 'node: task'.
            name = status.name.partition(':')[0]
            self._status[name] = {'hardware_id': status.hardware_id,
                                  **{item.key: item.value for item in status.values}}

    def value(self, node: str, key: str) -> str | None:
        """Return the last value of a key in a node's diagnostics or its hardware_id, or None."""
        return self._status.get(node, {}).get(key)

    def forget(self, node: str) -> None:
        """Discard a node's diagnostics so far."""
        self._status.pop(node, None)

    def wait(self, seconds: float) -> None:
        """Process messages for a while."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._check()
            self._executor.spin_once(timeout_sec=max(0.0, end - time.monotonic()))

    def until(self, condition: Callable[[], object], what: str,
              patience: float | None = None) -> None:
        """Wait until a condition, named `what`, holds; raise InputError if it does not in time."""
        patience = patience or self._patience
        end = time.monotonic() + patience
        while not condition():
            if time.monotonic() > end:
                raise InputError(f'{what}: nothing within {patience:g} s')
            self._check()
            self._executor.spin_once(timeout_sec=0.05)

    def subscriptions(self, topic: str) -> int:
        """Return the number of subscriptions of a topic."""
        return self._node.count_subscribers(topic)

    def until_connected(self, topic: str, publishers: int, subscriptions: int) -> None:
        """Wait until a topic has the given numbers of publishers and subscriptions."""
        self.until(
            lambda: (self._node.count_publishers(topic) >= publishers
                     and self.subscriptions(topic) >= subscriptions),
            f'{topic} with {publishers} publishers and {subscriptions} subscriptions')

    @contextmanager
    def subscribed(self, kind: Any, topic: str, take: Callable[[Any], object] = lambda _: None,
                   qos: Any = 10) -> Iterator[None]:
        """Subscribe to a topic within the block."""
        subscription = self._node.create_subscription(kind, topic, take, qos)
        try:
            yield
        finally:
            self._node.destroy_subscription(subscription)

    def hearing_directions(self) -> Any:
        """Subscribe to the direction within a block: the exercise waits for a subscription."""
        return self.subscribed(Int8MultiArray, 'direction')

    def set_parameter(self, node: str, name: str, value: Any) -> None:
        """Set a parameter of a running node; raise InputError with its reason if it refuses."""
        client, what = self._node.create_client(
            SetParameters, f'{node}/set_parameters'), f'the parameters of {node}'
        try:
            self.until(client.service_is_ready, what)
            request = SetParameters.Request(parameters=[
                Parameter(name, value=value).to_parameter_msg()])
            result = self._request(lambda: client.call_async(request), what).results[0]
        finally:
            self._node.destroy_client(client)
        if not result.successful:
            raise InputError(f'{node} refuses {name}: {result.reason}')

    def identify(self, goal: dict[str, Any], report: Callable[[Any], None]) -> Any:
        """Send a goal to the identification node and return its result.

        Parameters
        ----------
        goal : dict
            Fields of IdentifyFriction's goal.
        report : callable
            Called with each feedback message.

        Raises
        ------
        InputError
            If the goal is refused or fails.
        """
        refused = IdentifyFriction.Goal(**{**goal, 'joint': 'nobody'})
        return self.reach(IdentifyFriction, 'identify_friction', IdentifyFriction.Goal(**goal),
                          refused, report, 'identification')

    def refine(self, goal: dict[str, Any], report: Callable[[Any], None]) -> Any:
        """Send a goal to the refinement node and return its result, as `identify` does."""
        refused = RefineModel.Goal(**{**goal, 'joint': 'nobody'})
        return self.reach(
            RefineModel, 'refine_model', RefineModel.Goal(**goal), refused, report, 'refinement')

    def reach(self, kind: Any, name: str, goal: Any, refused: Any,
              report: Callable[[Any], None], what: str) -> Any:
        """Send a goal to node `what` until it is accepted, and return its result.

        `refused` is a goal that is always refused: its answer shows that the connection works both
        ways. If waiting is interrupted, the goal is cancelled.
        """
        action = ActionClient(self._node, kind, name)
        try:
            self.until(action.server_is_ready, f'the action of {what}')
            self._request(lambda: action.send_goal_async(refused), 'an answer to the goal')
            outcome = self._result(self._send(action, goal, report, what), what)
        finally:
            action.destroy()
        if outcome.status != GoalStatus.STATUS_SUCCEEDED:
            result = outcome.result
            text = getattr(result, 'message', '') or getattr(result, 'error_string', '')
            raise InputError(f'{what} failed: {text}')
        return outcome.result

    def _send(self, action: Any, goal: Any, report: Callable[[Any], None], what: str) -> Any:
        """Send a goal until it is accepted: a node without joint states refuses it."""
        end = time.monotonic() + self._patience
        while time.monotonic() < end:
            future = action.send_goal_async(goal, lambda feedback: report(feedback.feedback))
            self.until(future.done, 'an answer to the goal')
            if future.result().accepted:
                return future.result()
            self.wait(0.2)
        reason = self.value(what, 'last refusal')
        raise InputError(f'{what} refuses the goal{": " if reason else ""}{reason or ""}')

    def _result(self, handle: Any, what: str) -> Any:
        try:
            future = handle.get_result_async()
            self.until(future.done, f'the result of {what}', 3600.0)
        except BaseException:
            # Not every server notices that its client is gone.
            handle.cancel_goal_async()
            end = time.monotonic() + _CANCEL_TIME
            while time.monotonic() < end:
                self._executor.spin_once(timeout_sec=0.05)
            raise
        return future.result()

    def _request(self, send: Callable[[], Any], what: str) -> Any:
        """Return the answer to an idempotent request, which is repeated until it is answered.

        A reply is lost if it is sent before both ends have discovered each other.
        """
        end = time.monotonic() + self._patience
        while time.monotonic() < end:
            future, again = send(), time.monotonic() + _ANSWER_TIME
            while not future.done() and time.monotonic() < again:
                self.wait(0.05)
            if future.done():
                return future.result()
        raise InputError(f'{what}: nothing within {self._patience:g} s')
