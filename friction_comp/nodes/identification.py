# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Measures the friction of a joint as an action server (note, sections 2.3 and 2.4)."""

from __future__ import annotations

import math
from pathlib import Path
import time
import traceback

from friction_comp_interfaces.action import IdentifyFriction
import numpy as np
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState, Temperature

from friction_comp.errors import InputError
from friction_comp.identification.run import IdentificationRun
from friction_comp.nodes.diagnostics import Diagnostics, ERROR, OK, Rate, WARN
from friction_comp.nodes.goals import declare_defaults, fill_result, make_goal
from friction_comp.nodes.joint_io import (
    AGAIN,
    CommandPort,
    input_qos,
    JointColumns,
    NANO,
    nanoseconds,
    NEW,
)
from friction_comp.nodes.node_main import run
from friction_comp.nodes.parameters import declare, declare_joints, load_models
from friction_comp.nodes.slow_inputs import MotorTemperature

# Real time in s between looks whether joint_states have a publisher at all: in simulated time,
# which rests with its publisher, nothing else would tell.
_LOOK = 0.5


class IdentificationNode(Node):
    """Serves one goal at a time; a second one is rejected while the first runs.

    The node commands currents during a goal only, one for every joint state, and leaves the drive
    at zero current however the goal ends.
    """

    finished = False
    fast_timers = ()

    def __init__(self):
        super().__init__('identification')
        self._joints = declare_joints(self)
        models = load_models(declare(
            self, 'model_files', [], "model file of each joint, of which only the section 'drive' "
            'is used', read_only=True), self._joints)
        self._drives = [model.drive for model in models]
        self._output = declare(
            self, 'output_folder', '.', 'folder that takes the model files, named after their '
            'joints')
        self._timeout = round(NANO * declare(
            self, 'joint_state_timeout', 0.05, 'age or silence of joint_states that ends a goal '
            '[s]', 0.001, 10.0, read_only=True))
        self._feedback_period = declare(
            self, 'feedback_period', 0.1, 'real time between feedback messages [s]', 0.01, 10.0,
            read_only=True)
        self._defaults = declare_defaults(self)
        qos = input_qos(self)
        self._columns = JointColumns(self._joints)
        self._temperature = MotorTemperature(self._joints)
        self._port = CommandPort(self, self._joints)
        self._rate = Rate()
        self._stamp = self._heard = None
        self._busy = False
        self._run = None
        self._done = None
        self._last_end = ''
        self._refused = ''
        self.create_subscription(Temperature, 'motor_temperature', self._on_temperature, qos)
        self.create_subscription(JointState, 'joint_states', self._on_joint_states, qos)
        self.create_timer(self._timeout / 2 / NANO, self._watch)
        self.create_timer(_LOOK, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._server = ActionServer(
            self, IdentifyFriction, 'identify_friction', self._execute,
            goal_callback=self._on_goal, cancel_callback=self._on_cancel)
        Diagnostics(self, self._report, ', '.join(self._joints))

    # The action.

    def _on_goal(self, request):
        try:
            if self._busy:
                raise InputError('another goal is running')
            number, _ = make_goal(request, self._joints, self._drives, self._defaults)
            self._check_states(number)
        except InputError as error:
            self._refused = str(error)
            self.get_logger().warning(f'goal rejected: {error}')
            return GoalResponse.REJECT
        self._refused = ''
        self._busy = True
        return GoalResponse.ACCEPT

    def _check_states(self, number):
        now = self.get_clock().now().nanoseconds
        if self._heard is None or now - self._heard > self._timeout:
            raise InputError('there are no joint_states')
        if self._joints[number] in self._columns.missing:
            raise InputError(f'joint_states lack {self._joints[number]}')
        if self._age(now) > self._timeout:
            raise InputError(
                f'joint_states are {self._age(now) / NANO:.3g} s old (clocks differ, or '
                'use_sim_time is not set alike?)')

    def _age(self, now):
        return now - self._stamp if self._stamp else 0

    def _on_cancel(self, goal_handle):
        self._end('canceled', 'cancelled on request', zero=True)
        return CancelResponse.ACCEPT

    async def _execute(self, goal_handle):
        result = IdentifyFriction.Result()
        try:
            self._number, goal = make_goal(
                goal_handle.request, self._joints, self._drives, self._defaults)
            joint = self._joints[self._number]
            self._goal_handle = goal_handle
            self._started = self._shown = None
            self._port.forget()
            self._done = Future()
            run = self._run = IdentificationRun(goal, self._drives[self._number])
            self.get_logger().info(f'identifies {joint}')
            end, result.message = await self._done
            if end == 'done':
                self._finish(run, joint, result)
        except InputError as error:
            end, result.message = 'aborted', str(error)
        except Exception:
            self.get_logger().error(traceback.format_exc())
            end, result.message = 'aborted', 'an error in the node, see its log'
        finally:
            self._end('aborted', 'an error in the node', zero=True)
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

    def _finish(self, run, joint, result):
        """Fit, write the model file, and fill the result in."""
        outcome = run.result()
        path = Path(self.get_parameter('output_folder').value) / f'{joint}.yaml'
        path = path.absolute()
        outcome.model(self._drives[self._number], joint).save(path)
        fill_result(result, outcome)
        result.model_file = str(path)
        result.message = '. '.join([f'identified {joint}, wrote {path}', *outcome.warnings])

    def _end(self, end, message, zero):
        """End the run, if one is on: currents first, words later."""
        if self._run is None:
            return
        run, self._run = self._run, None
        if zero:
            self._port.zero()
        run.abort(message)
        self._done.set_result((end, message))

    # Topics.

    def _on_temperature(self, message):
        self._temperature.take(
            message.header.frame_id, message.temperature, nanoseconds(message.header.stamp))

    def _on_joint_states(self, message, info):
        self._rate.tick()
        now = self._heard = self.get_clock().now().nanoseconds
        stamp = nanoseconds(message.header.stamp)
        self._stamp = stamp
        position, velocity, effort = self._columns.read(message)
        if self._run is None:
            return
        fate = self._port.judge(stamp, info['source_timestamp'])
        if fate == AGAIN:
            self._port.repeat()
        if fate != NEW:
            return
        try:
            self._measure(stamp, now, position, velocity, effort)
        except InputError as error:
            self._end('aborted', str(error), zero=True)
        except Exception:
            self.get_logger().error(traceback.format_exc())
            self._end('aborted', 'an error in the node, see its log', zero=True)

    def _measure(self, stamp, now, position, velocity, effort):
        """Answer one joint state."""
        if self._age(now) > self._timeout:
            raise InputError(f'joint_states are {self._age(now) / NANO:.3g} s old')
        number, drive = self._number, self._drives[self._number]
        if self._started is None:
            self._started = stamp or now
        at = ((stamp or now) - self._started) / NANO
        sample = [
            float(position[number]),
            math.nan if velocity is None else float(velocity[number]),
            float(effort[number]) / drive.torque_per_current]
        if not math.isfinite(sample[0]) or not math.isfinite(sample[2]):
            raise InputError(
                f'joint_states hold no finite position and effort of {self._joints[number]}')
        temperature = self._temperature.before(stamp or now)
        current = self._run.update(
            at, *sample,
            None if temperature is None else float(temperature[number]))
        commands = np.zeros(len(self._joints))
        commands[number] = 0.0 if self._run.finished else current
        self._port.answer(stamp, commands)
        self._feed_back(at, sample)
        if self._run.finished:
            self._end('done', '', zero=False)

    def _feed_back(self, at, sample):
        now = time.monotonic()
        if self._shown is not None and now - self._shown < self._feedback_period:
            return
        self._shown = now
        feedback = IdentifyFriction.Feedback(
            phase=self._run.phase, progress=float(self._run.progress),
            remaining_seconds=float(self._run.remaining), time=at, position=sample[0],
            velocity=sample[1], current=sample[2])
        self._goal_handle.publish_feedback(feedback)

    def _watch(self):
        if self._run is not None and self._heard is not None and (
                self.get_clock().now().nanoseconds - self._heard > self._timeout):
            self._end('aborted', 'joint_states fell silent', zero=True)

    def _look(self):
        if self._run is not None and not self.count_publishers('joint_states'):
            self._end('aborted', 'joint_states have no publisher any more', zero=True)

    def _report(self):
        values = {'joint_states per second of real time': self._rate.per_second(),
                  'last goal': self._last_end, 'last refusal': self._refused,
                  'listeners to current_command': self._port.listeners}
        if self._run is not None:
            values.update({
                'joint': self._joints[self._number], 'phase': self._run.phase,
                'progress': float(self._run.progress), 'command [A]': self._port.last})
            return OK, f'identifies {self._joints[self._number]}', values
        if self._last_end.startswith('aborted'):
            return ERROR, self._last_end, values
        if self._heard is None:
            return WARN, 'no joint_states yet', values
        return OK, 'ready', values

    def leave(self):
        """End a running goal with zero current."""
        if self._run is not None:
            self._end('aborted', 'the node was stopped', zero=True)
            self._port.wait()


def main(argv=None):
    """Start the node and return its exit code."""
    return run('identification', __doc__, IdentificationNode, argv)
