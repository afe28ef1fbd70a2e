# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Moves a joint with currents, as two actions: to measure its friction, and along a trajectory.

Friction is measured by the note's sections 2.3 and 2.4. Both actions share the joint, its
supervision and the way in which every fault ends in zero current.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import functools
import math
from pathlib import Path
import time
import traceback
from typing import Any

from friction_comp_interfaces.action import IdentifyFriction, PlayTrajectory
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState, Temperature

from friction_comp.errors import InputError
from friction_comp.files import check_folder
from friction_comp.identification.run import IdentificationRun
from friction_comp.identification.supervised_run import SupervisedRun
from friction_comp.identification.trajectory_run import TrajectoryRun
from friction_comp.nodes import joint_states
from friction_comp.nodes.diagnostics import Diagnostics, ERROR, OK, per_joint, Rate, WARN
from friction_comp.nodes.goals import (
    compile_ahead,
    declare_defaults,
    fill_result,
    make_goal,
    make_trajectory,
)
from friction_comp.nodes.joint_io import (
    command_interface,
    CommandPort,
    currents_per_effort,
    input_qos,
    rivals,
)
from friction_comp.nodes.joint_states import JointStateInput, NANO, nanoseconds
from friction_comp.nodes.node_main import run
from friction_comp.nodes.parameters import declare, declare_joints, load_models
from friction_comp.nodes.slow_inputs import MotorTemperature
from friction_comp.nodes.watchdog import Watchdog

# Real time in s between looks at who else is there: publishers of joint_states, other commanders,
# and the client.
_LOOK = 0.1
# Real s within which joint states must have come for a goal to be accepted. A busy machine may
# leave them unread for long; the joint is not driven before a fresh one has come.
_RECENT = 2.0


@dataclass(frozen=True)
class Served:
    """One of the actions.

    Parameters
    ----------
    kind : type
        Of the action.
    name : str
    goal : callable
        Makes joint and goal of a request; raises InputError.
    run : callable
        Makes the run of a goal and a drive.
    finish : callable
        Fills in the result of a finished run, given the joint.
    """

    kind: Any
    name: str
    goal: Callable[[Any], tuple[int, Any]]
    run: Callable[[Any, Any], SupervisedRun]
    finish: Callable[[Any, str, Any], None]


class IdentificationNode(Node):
    """Serves one goal at a time; a second one is rejected while the first runs.

    The node has a publisher of currents during a goal only, commands one for every joint state,
    and leaves the drive at zero current however the goal ends.
    """

    finished = False
    fast_timers = ()

    def __init__(self) -> None:
        super().__init__('identification')
        self._joints = declare_joints(self)
        models = load_models(declare(
            self, 'model_files', [], "model file of each joint, of which only the section 'drive' "
            'is used', read_only=True), self._joints)
        self._drives = [model.drive for model in models]
        self._output = declare(
            self, 'output_folder', '.', 'folder that takes the model files, named after their '
            'joints')
        timeout = declare(
            self, 'joint_state_timeout', 0.05, 'silence of joint_states that ends a goal, in real '
            'time, and largest age [s]', 0.001, 10.0, read_only=True)
        self._feedback_period = declare(
            self, 'feedback_period', 0.1, 'real time between feedback messages [s]', 0.01, 10.0,
            read_only=True)
        self._defaults = declare_defaults(self)
        qos = input_qos(self)
        self._states = JointStateInput(self._joints, round(NANO * timeout))
        self._temperature = MotorTemperature(self._joints)
        torques = [drive.torque_per_current for drive in self._drives]
        self._per_effort = currents_per_effort(self, torques)
        self._port = CommandPort(self, [drive.current_limit for drive in self._drives], torques,
                                 command_interface(self))
        self._watchdog = Watchdog(timeout, self._on_silence).start()
        self._rate = Rate()
        self._received = self._fresh = -math.inf
        self._busy = self._silent = False
        self._run: SupervisedRun | None = None
        self._done: Future | None = None
        self._started: int | None = None
        self._shown: float | None = None
        self._last_end = ''
        self._refused = ''
        compile_ahead(self._drives[0])
        self.create_subscription(Temperature, 'motor_temperature', self._on_temperature, qos)
        self.create_subscription(JointState, 'joint_states', self._on_joint_states, qos)
        self.create_timer(_LOOK, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._served = (
            Served(IdentifyFriction, 'identify_friction', self._identification_goal,
                   IdentificationRun, self._finish_identification),
            Served(PlayTrajectory, 'play_trajectory', self._trajectory_goal, TrajectoryRun,
                   _finish_trajectory))
        self._now = self._served[0]
        self._servers = [ActionServer(
            self, one.kind, one.name, functools.partial(self._execute, one),
            goal_callback=functools.partial(self._on_goal, one),
            cancel_callback=self._on_cancel) for one in self._served]
        Diagnostics(self, self._report, ', '.join(self._joints), 'identification')

    # The actions.

    def _identification_goal(self, request: Any) -> tuple[int, Any]:
        check_folder(self.get_parameter('output_folder').value)
        goal: tuple[int, Any] = make_goal(request, self._joints, self._drives, self._defaults)
        return goal

    def _trajectory_goal(self, request: Any) -> tuple[int, Any]:
        goal: tuple[int, Any] = make_trajectory(
            request, self._joints, self._drives, self._defaults)
        return goal

    def _on_goal(self, served: Served, request: Any) -> Any:
        try:
            if self._busy:
                raise InputError('another goal is running')
            index, _ = served.goal(request)
            self._check_states(index)
            self._check_surroundings()
        except InputError as error:
            self._refused = str(error)
            self.get_logger().warning(f'goal rejected: {error}')
            return GoalResponse.REJECT
        self._refused = ''
        self._busy = True
        return GoalResponse.ACCEPT

    def _check_states(self, index: Any) -> None:
        if time.monotonic() - self._received > _RECENT:
            raise InputError('there are no joint_states')
        if time.monotonic() - self._fresh > _RECENT:
            raise InputError(self._states.wrong or 'joint_states bring nothing new')
        if self._joints[index] in self._states.missing:
            raise InputError(f'joint_states lack {self._joints[index]}')

    def _check_surroundings(self) -> None:
        """Raise InputError where the joint must not be driven, or to no purpose."""
        others = self._port.others()
        if others:
            raise InputError(f'{", ".join(others)} may command the motor: deactivate it first')

    def _on_cancel(self, goal_handle: Any) -> Any:
        self._end('canceled', 'cancelled on request')
        return CancelResponse.ACCEPT

    async def _execute(self, served: Served, goal_handle: Any) -> Any:
        result = served.kind.Result()
        try:
            self._now = served
            self._index, goal = served.goal(goal_handle.request)
            joint = self._joints[self._index]
            self._goal_handle = goal_handle
            self._started = self._shown = None
            self._done, self._silent, self._accompanied = Future(), False, False
            self._states.forget()
            self._port.open()
            run = self._run = served.run(goal, self._drives[self._index])
            self.get_logger().info(f'{served.name}: moves {joint}')
            end, result.message = await self._done
            if end == 'done':
                served.finish(run, joint, result)
        except InputError as error:
            end, result.message = 'aborted', str(error)
        except Exception:
            self.get_logger().error(traceback.format_exc())
            end, result.message = 'aborted', 'an error in the node, see its log'
        finally:
            self._end('aborted', 'an error in the node')
            self._port.close()
            self._busy = False
        result.success = end == 'done'
        self._last_end = f'{end}: {result.message}'
        self.get_logger().info(self._last_end)
        if end == 'done':
            goal_handle.succeed()
        elif end == 'canceled':
            goal_handle.canceled()
        else:
            goal_handle.abort()
        return result

    def _finish_identification(self, run: Any, joint: str, result: Any) -> None:
        """Fit, write the model file, and fill the result in."""
        outcome = run.result()
        path = Path(self.get_parameter('output_folder').value) / f'{joint}.yaml'
        path = path.absolute()
        outcome.model(self._drives[self._index], joint).save(path)
        fill_result(result, outcome)
        result.model_file = str(path)
        result.message = '. '.join([f'identified {joint}, wrote {path}', *outcome.warnings])

    def _end(self, end: Any, message: Any) -> None:
        """End the run, if one is on: currents first, words later."""
        if self._run is None:
            return
        run, self._run = self._run, None
        self._watchdog.rest()
        self._port.zero()
        run.abort(message)
        self._done.set_result((end, message))

    # Topics.

    def _on_temperature(self, message: Any) -> None:
        self._temperature.take(
            message.header.frame_id, message.temperature, nanoseconds(message.header.stamp))

    def _on_joint_states(self, message: Any, info: Any) -> None:
        self._rate.tick()
        now = self.get_clock().now().nanoseconds
        simulated = self.get_clock().ros_time_is_active
        if self._run is not None and not self._port.ready:
            return
        ticket = self._port.ticket
        verdict = self._states.take(
            message, now, 0 if simulated else info['received_timestamp'],
            info['publication_sequence_number'] or 0)
        self._received = time.monotonic()
        # A simulation whose time rests, since nobody commands, sends its last state again.
        if verdict == joint_states.NEW or (verdict == joint_states.AGAIN and simulated):
            self._fresh = self._received
        if self._run is None:
            return
        try:
            if verdict == joint_states.NEW:
                self._silent = False
                self._watchdog.feed()
                self._measure(ticket)
            elif verdict == joint_states.AGAIN:
                if self._port.is_lost(info['source_timestamp']):
                    self._port.repeat()
            elif verdict in (joint_states.MALFORMED, joint_states.CONTESTED):
                raise InputError(self._states.wrong)
        except InputError as error:
            self._end('aborted', str(error))
        except Exception:
            self.get_logger().error(traceback.format_exc())
            self._end('aborted', 'an error in the node, see its log')

    def _measure(self, ticket: Any) -> None:
        """Answer one joint state."""
        states, index = self._states, self._index
        if self._started is None:
            self._started = states.stamp
        at = (states.stamp - self._started) / NANO
        velocity = states.velocity
        sample = [
            float(states.position[index]),
            math.nan if velocity is None else float(velocity[index]),
            float(states.effort[index]) * self._per_effort[index]]
        if not math.isfinite(sample[0]) or not math.isfinite(sample[2]):
            raise InputError(
                f'joint_states hold no finite position and effort of {self._joints[index]}')
        temperature = self._temperature.before(states.stamp)
        current = self._run.update(
            at, sample[0], sample[1], sample[2],
            None if temperature is None else float(temperature[index]))
        commands = [0.0] * len(self._joints)
        commands[index] = 0.0 if self._run.finished else current
        simulated = self.get_clock().ros_time_is_active
        self._port.answer(commands, ticket, states.stamp if simulated else 0)
        self._feed_back(at, sample)
        if self._run.finished:
            self._end('done', '')

    def _feed_back(self, at: Any, sample: Any) -> None:
        now = time.monotonic()
        if self._shown is not None and now - self._shown < self._feedback_period:
            return
        self._shown = now
        feedback = self._now.kind.Feedback(
            phase=self._run.phase, progress=float(self._run.progress),
            remaining_seconds=float(self._run.remaining), time=at, position=sample[0],
            velocity=sample[1], current=sample[2])
        self._goal_handle.publish_feedback(feedback)

    def _on_silence(self) -> None:
        """Command zero; called by the watchdog, in its thread."""
        self._port.zero()
        self._silent = True

    def _look(self) -> None:
        """Check the publishers, and end a goal whose client is gone."""
        self._states.publishers = rivals(self, 'joint_states')
        if self._run is None:
            return
        states = self.resolve_topic_name('joint_states')
        client = self.resolve_service_name(f'{self._now.name}/_action/get_result')
        others, clients = self._port.others(), self.count_clients(client)
        self._accompanied = self._accompanied or clients > 0
        # A simulation's time may rest: then its last state is as fresh as ever.
        if self._silent and not self.get_clock().ros_time_is_active:
            self._end('aborted', 'joint_states fell silent')
        elif not self.count_publishers(states):
            self._end('aborted', 'joint_states have no publisher any more')
        elif self._accompanied and not clients:
            self._end('aborted', 'the client that asked for it has gone')
        elif others:
            self._end('aborted', f'{", ".join(others)} may command the motor too')

    def _report(self) -> Any:
        values = {'joint_states per second of real time': self._rate.per_second(),
                  'last goal': self._last_end, 'last refusal': self._refused,
                  'listeners to the command': self._port.listeners}
        if self._run is not None:
            values.update({
                'joint': self._joints[self._index], 'phase': self._run.phase,
                'progress': float(self._run.progress),
                **per_joint(self._joints, 'command [A]', self._port.last)})
            return OK, f'{self._now.name}: moves {self._joints[self._index]}', values
        if self._last_end.startswith('aborted'):
            return ERROR, self._last_end, values
        if not self._states.stamp:
            return WARN, 'no joint_states yet', values
        return OK, 'ready', values

    def let_go(self) -> None:
        """Command zero current permanently; may be called from any thread."""
        self._port.zero(for_good=True)

    def leave(self) -> None:
        """End a running goal with zero current."""
        self._end('aborted', 'the node was stopped')
        self._port.wait()
        self._watchdog.close()


def _finish_trajectory(run: Any, joint: str, result: Any) -> None:
    result.message = f'moved {joint} along the trajectory'


def main(argv: list[str] | None = None) -> Any:
    """Start the node and return its exit code."""
    return run('identification', __doc__, IdentificationNode, argv)
