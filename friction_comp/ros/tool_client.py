# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What tools ask of running nodes: actions, parameters and diagnostics; and what they observe."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, ExitStack, suppress
import math
import os
import sys
import time
from typing import Any, TYPE_CHECKING

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticArray
from friction_comp_interfaces.action import IdentifyFriction, PlayTrajectory
import numpy as np
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from friction_comp.errors import InputError
from friction_comp.interrupts import interrupts_deferred
from friction_comp.messages import nanoseconds, TOPICS, TORQUE_UNIT
from friction_comp.ros.joint_io import BEST_EFFORT, command_unit
from friction_comp.ros.ros_start import own_node
from friction_comp.trajectory import Trajectory

if TYPE_CHECKING:
    from friction_comp.monitoring.checkup import Endpoint, Observation

# s: until a refused goal and a cancellation are sent again; the longest goal; longest time until a
# signal is heard.
_AGAIN, _LONGEST_GOAL, _LOOK = 0.2, 3600.0, 0.05
_DOCTOR = 'friction_comp_doctor'


def message_of(trajectory: Trajectory) -> Any:
    """Return a trajectory as a message."""
    message = JointTrajectory(joint_names=list(trajectory.joints))
    for (sec, nanosec), position, velocity, acceleration in zip(
            trajectory.stamps(), trajectory.position, trajectory.velocity, trajectory.acceleration):
        message.points.append(JointTrajectoryPoint(
            positions=position.tolist(), velocities=velocity.tolist(),
            accelerations=acceleration.tolist(),
            time_from_start=Duration(seconds=sec, nanoseconds=nanosec).to_msg()))
    return message


def _cancellation() -> CancelGoal.Request:
    """Return the cancellation of a new goal, with its random number."""
    request = CancelGoal.Request()
    request.goal_info.goal_id.uuid = list(os.urandom(16))
    return request


class ToolClient:
    """A separate node for a tool, `node`, closed with the ``with`` block.

    `check` is called while waiting and may raise an error to stop it. `patience` is the timeout in
    s of everything but the result of an action. `arguments` are ROS arguments. Methods raise
    InputError where a node does not answer, refuses or fails.
    """

    def __init__(self, check: Callable[[], object] = lambda: None, patience: float = 60.0,
                 name: str = 'demo', arguments: Sequence[str] = ()) -> None:
        self._check, self._patience = check, patience
        self._name, self._arguments = name, arguments
        self._status: dict[str, dict[str, str]] = {}

    def __enter__(self) -> ToolClient:
        self._stack = ExitStack()
        self.node = self._stack.enter_context(own_node(self._name, self._arguments))
        self._executor = SingleThreadedExecutor(context=self.node.context)
        self._stack.callback(self._executor.shutdown)
        self._executor.add_node(self.node)
        self.node.create_subscription(
            DiagnosticArray, '/diagnostics', self._on_diagnostics, 50)
        return self

    def __exit__(self, *_: object) -> None:
        with interrupts_deferred():
            self._stack.close()

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            # As diagnostic_updater names it: 'node: task'.
            self._status[status.name.partition(':')[0]] = {
                item.key: item.value for item in status.values}

    def value(self, node: str, key: str) -> str | None:
        """Return the last value of a key in a node's diagnostics, or None."""
        return self._status.get(node, {}).get(key)

    def forget(self, node: str) -> None:
        """Discard a node's diagnostics so far."""
        self._status.pop(node, None)

    def _spin(self, seconds: float) -> None:
        # An exception amid compiled code of the middleware may end the process.
        with interrupts_deferred():
            self._executor.spin_once(timeout_sec=min(seconds, _LOOK))

    def wait(self, seconds: float) -> None:
        """Process messages for a while."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._check()
            self._spin(max(0.0, end - time.monotonic()))

    def wait_until(self, condition: Callable[[], object], what: str,
                   patience: float | None = None) -> None:
        """Wait until a condition, named `what`, holds; raise InputError if it does not in time."""
        patience = patience or self._patience
        end = time.monotonic() + patience
        while not condition():
            if time.monotonic() > end:
                raise InputError(f'{what}: nothing within {patience:g} s')
            self._check()
            self._spin(_LOOK)

    def wait_until_connected(self, topic: str, publishers: int, subscriptions: int) -> None:
        """Wait until a topic has at least these numbers of publishers and subscriptions."""
        self.wait_until(
            lambda: (self.node.count_publishers(topic) >= publishers
                     and self.node.count_subscribers(topic) >= subscriptions),
            f'{topic} with {publishers} publishers and {subscriptions} subscriptions')

    @contextmanager
    def subscribed(self, kind: Any, topic: str, take: Callable[[Any], object] = lambda _: None
                   ) -> Iterator[None]:
        """Subscribe to a topic within the block."""
        subscription = self.node.create_subscription(kind, topic, take, BEST_EFFORT)
        try:
            yield
        finally:
            self.node.destroy_subscription(subscription)

    def subscribed_to_direction(self) -> Any:
        """Subscribe to the direction within a block: the exercise waits for a subscription."""
        return self.subscribed(Int8MultiArray, 'direction')

    def set_parameter(self, node: str, name: str, value: Any) -> None:
        """Set a parameter of a running node."""
        result = self._call(SetParameters, f'{node}/set_parameters',
                            parameters=[Parameter(name, value=value).to_parameter_msg()]).results[0]
        if not result.successful:
            raise InputError(f'{node} refuses {name}: {result.reason}')

    def parameters(self, node: str) -> dict[str, Any]:
        """Return the parameters of a running node."""
        names = self._call(ListParameters, f'{node}/list_parameters').result.names
        values = self._call(GetParameters, f'{node}/get_parameters', names=names).values
        return dict(zip(names, map(parameter_value_to_python, values)))

    def _call(self, kind: Any, name: str, **fields: Any) -> Any:
        client = self.node.create_client(kind, name)
        try:
            self.wait_until(client.service_is_ready, f'the service {name}')
            return self._request(lambda: client.call_async(kind.Request(**fields)),
                                 f'the service {name}')
        finally:
            self.node.destroy_client(client)

    def identify(self, goal: dict[str, Any], report: Callable[[Any], None]) -> Any:
        """Send a goal, by its fields, and return its result; `report` gets each feedback."""
        return self.send_goal(IdentifyFriction, 'identify_friction',
                              IdentifyFriction.Goal(**goal), report, 'identification')

    def play(self, trajectory: Trajectory, report: Callable[[float, str], None]) -> None:
        """Move a joint by the node `identification`; `report` gets progress 0..1 and the phase."""
        self.send_goal(
            PlayTrajectory, 'play_trajectory',
            PlayTrajectory.Goal(trajectory=message_of(trajectory)),
            lambda feedback: report(feedback.progress, feedback.phase), 'identification')

    def send_goal(self, kind: Any, name: str, goal: Any, report: Callable[[Any], None],
                  what: str) -> Any:
        """Send a goal to node `what` until it is accepted, and return its result.

        A node without joint states refuses it. Whatever ends the waiting before the result, the
        goal is cancelled.
        """
        action = ActionClient(self.node, kind, name)
        cancel = self.node.create_client(CancelGoal, f'{name}/_action/cancel_goal')
        try:
            self.wait_until(lambda: action.server_is_ready() and cancel.service_is_ready(),
                            f'the action of {what}')
            # An answer could be lost before the server knows of who waits for it. It hears of the
            # client for cancellations last: what answers that nobody knows a goal answers goals.
            self._request(lambda: cancel.call_async(_cancellation()), f'an answer of {what}')
            end = time.monotonic() + self._patience
            while (outcome := self._follow(action, cancel, goal, report, what)) is None:
                if time.monotonic() > end:
                    reason = self.value(what, 'last refusal')
                    raise InputError(f'{what} refuses the goal' + (f': {reason}' if reason else ''))
        finally:
            with interrupts_deferred():
                action.destroy()
                self.node.destroy_client(cancel)
        if outcome.status != GoalStatus.STATUS_SUCCEEDED:
            result = outcome.result
            text = getattr(result, 'message', '') or getattr(result, 'error_string', '')
            raise InputError(f'{what} failed: {text}')
        return outcome.result

    def _follow(self, action: Any, cancel: Any, goal: Any, report: Callable[[Any], None],
                what: str) -> Any:
        """Return the outcome of a goal; None if it was refused."""
        request = _cancellation()
        accepted = action.send_goal_async(
            goal, lambda feedback: report(feedback.feedback), request.goal_info.goal_id)
        ready_at = time.monotonic()

        def is_done() -> Any:
            nonlocal ready_at
            if action.server_is_ready():
                ready_at = time.monotonic()
            elif time.monotonic() - ready_at > 1.0 and not result.done():
                raise InputError(f'{what} has ended')
            return result.done()
        try:
            self.wait_until(accepted.done, f'an answer of {what} to the goal')
            if not accepted.result().accepted:
                self.wait(_AGAIN)
                return None
            result = accepted.result().get_result_async()
            self.wait_until(is_done, f'the result of {what}', _LONGEST_GOAL)
        except BaseException:
            self._cancel(cancel, request, accepted, what)
            raise
        return result.result()

    def _cancel(self, cancel: Any, request: Any, accepted: Any, what: str) -> None:
        """Cancel a goal; say so on standard error if nobody acknowledges it."""
        if accepted.done() and not accepted.result().accepted:
            return
        end = time.monotonic() + 2.0
        with interrupts_deferred():
            while time.monotonic() < end:
                answer, again = cancel.call_async(request), time.monotonic() + _AGAIN
                while time.monotonic() < again:
                    self._spin(_LOOK)
                    # Otherwise the goal may still be on its way.
                    if answer.done() and (answer.result().goals_canceling or answer.result(
                            ).return_code == CancelGoal.Response.ERROR_GOAL_TERMINATED):
                        return
        print(f'{what} did not acknowledge that its goal is cancelled: make sure that nothing '
              'moves', file=sys.stderr)

    def _request(self, send: Callable[[], Any], what: str) -> Any:
        """Return the answer to a request, repeated since replies before discovery are lost."""
        end = time.monotonic() + self._patience
        while time.monotonic() < end:
            future, again = send(), time.monotonic() + 5.0
            while not future.done() and time.monotonic() < again:
                self.wait(_LOOK)
            if future.done():
                return future.result()
        raise InputError(f'{what}: nothing within {self._patience:g} s')


def observe(seconds: float, arguments: Sequence[str],
            progress: Callable[[float, str], None]) -> Observation:
    """Observe a running system for `seconds` s; `progress` gets the share 0..1 and the step."""
    from friction_comp.monitoring.checkup import Observation

    seen, commands = Observation(seconds), []
    states: defaultdict[str, list[list[float]]] = defaultdict(list)

    def on_states(message: Any) -> None:
        now, stamp = time.time(), 1e-9 * nanoseconds(message.header.stamp)
        signals = [values if len(values) == len(message.name) else [math.nan] * len(message.name)
                   for values in (message.position, message.velocity, message.effort)]
        for joint, *values in zip(message.name, *signals):
            states[joint].append([now, stamp, *values])

    def on_command(message: Any) -> None:
        commands.append([time.time(), *message.data])
        seen.in_torque = command_unit(message) == TORQUE_UNIT

    def on_diagnostics(message: Any) -> None:
        seen.diagnostics.update({
            status.name: (ord(status.level), status.message) for status in message.status})
    with ToolClient(patience=3.0, name=_DOCTOR, arguments=arguments) as ros, ExitStack() as on:
        for heard in ((JointState, 'joint_states', on_states),
                      (Float64MultiArray, 'current_command', on_command),
                      (DiagnosticArray, '/diagnostics', on_diagnostics),
                      (Clock, '/clock', lambda _: setattr(seen, 'clock', True))):
            on.enter_context(ros.subscribed(*heard))
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            progress(0.8 * (1.0 - left / seconds), 'listening')
            ros.wait(min(left, 2.0 * _LOOK))
        node = ros.node
        seen.nodes = sorted(f'{space.rstrip("/")}/{name}'
                            for name, space in node.get_node_names_and_namespaces()
                            if name != _DOCTOR and not name.startswith('_'))
        seen.names = {name: node.resolve_topic_name(name) for name in TOPICS}
        seen.topics = {name: (_endpoints(node.get_publishers_info_by_topic(name)),
                              _endpoints(node.get_subscriptions_info_by_topic(name)))
                       for name, types in node.get_topic_names_and_types()
                       if {*TOPICS.values()} & set(types)}
        for index, name in enumerate(seen.nodes):
            progress(0.8 + 0.2 * index / len(seen.nodes), f'asking {name}')
            # Not every node answers.
            with suppress(InputError):
                seen.parameters[name] = ros.parameters(name)
    width = max(map(len, commands), default=1)
    seen.commands = np.array([row for row in commands if len(row) == width]).reshape(-1, width)
    seen.states = {joint: np.array(rows) for joint, rows in states.items()}
    return seen


def _endpoints(infos: Any) -> list[Endpoint]:
    from friction_comp.monitoring.checkup import Endpoint

    return [Endpoint(f'{info.node_namespace.rstrip("/")}/{info.node_name}', info.topic_type,
                     info.qos_profile.reliability == ReliabilityPolicy.RELIABLE)
            for info in infos if info.node_name != _DOCTOR]
