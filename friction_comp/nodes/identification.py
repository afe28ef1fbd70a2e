# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Moves a joint by motor currents in two actions: friction identification and trajectories.

Friction is measured as in sections 2.3 and 2.4 of the note. Both actions share the supervision of
the joint, and end with zero current after every fault.
"""

from __future__ import annotations

from functools import partial
import math
from pathlib import Path
import time
import traceback
from typing import Any

from friction_comp_interfaces.action import IdentifyFriction, PlayTrajectory
import numpy as np
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from sensor_msgs.msg import JointState

from friction_comp.control import joint_states
from friction_comp.control.joint_states import JointStateInput
from friction_comp.control.watchdog import Watchdog
from friction_comp.errors import InputError
from friction_comp.files import check_folder, file_names, to_yaml
from friction_comp.identification.carried import Carried, GRAVITY
from friction_comp.identification.goal import GOAL_LIMITS
from friction_comp.identification.run import IdentificationRun, TrajectoryRun
from friction_comp.nodes import goals
from friction_comp.nodes.goals import Action, RunningGoal
from friction_comp.ros import joint_io
from friction_comp.ros.diagnostics import Diagnostics, ERROR, OK, Rate, WARN
from friction_comp.ros.parameters import load_models, Settings
from friction_comp.ros.ros_start import steady_timer
from friction_comp.stamps import NANO

# Real s between checks of the publishers of joint_states, other commanders, and the client; and
# between feedback messages.
_CHECK_PERIOD = _FEEDBACK_PERIOD = 0.1
# Largest real age in s of the last joint state for a goal to be accepted. It is large, since a busy
# machine may delay reading; the joint is not driven before a new state has arrived.
_MAX_AGE = 2.0
# rad by which a joint may move that is not to be moved, and share of a drive's limit that friction
# is taken to hold where it is not known.
_MOVED, _HELD = 0.1, 0.05
_CANCELLED = 'canceled', 'cancelled on request'
_SILENT = 'joint_states fell silent'


class IdentificationNode(Node):
    """Serves one goal at a time; a second one is rejected while the first runs.

    The node has a publisher of currents only during a goal, publishes one command per joint state,
    and ends every goal with zero current.
    """

    def __init__(self) -> None:
        super().__init__('identification')
        settings = self._settings = Settings(self, 'identification')
        self._joints = settings.joints
        models = load_models(settings['model_files'], self._joints)
        self._models, self._drives = models, [model.drive for model in models]
        self._carried = Carried(self._joints, models, settings['gravity'] == GRAVITY[0])
        timeout = settings['joint_state_timeout']
        self._defaults = {name: settings[f'default_{name}'] for name in GOAL_LIMITS}
        self._states = JointStateInput(self._joints, round(NANO * timeout))
        torques = [drive.torque_per_current for drive in self._drives]
        in_ampere = settings['effort_holds'] == 'current'
        self._per_effort = [1.0 if in_ampere else 1.0 / torque for torque in torques]
        interface = settings['command_interface']
        self._torque = interface == 'effort'    # the unit in messages
        self._port = joint_io.CommandPort(
            self, [drive.current_limit for drive in self._drives], torques, interface)
        self._watchdog = Watchdog(timeout, self._on_silence).start()
        self._rate = Rate()
        self._received = self._fresh = -math.inf
        self._busy = False
        # Joint index and run of the last request that was accepted.
        self._accepted: tuple[int, Any] = 0, None
        self._goal: RunningGoal | None = None
        self._last_end = self._refused = ''
        goals.compile_ahead(self._drives[0])
        self.create_subscription(JointState, 'joint_states', self._on_joint_states,
                                 joint_io.QOS[settings['input_reliability']])
        steady_timer(self, _CHECK_PERIOD, self._check_connections)
        self._servers = [ActionServer(
            self, action.kind, action.name, partial(self._execute, action),
            goal_callback=partial(self._on_goal, action), cancel_callback=self._on_cancel)
            for action in (
                Action(IdentifyFriction, 'identify_friction', goals.make_goal, IdentificationRun,
                       self._finish_identification),
                Action(PlayTrajectory, 'play_trajectory', goals.make_trajectory, TrajectoryRun,
                       lambda _, j, __: f'moved {self._joints[j]} along the trajectory'))]
        Diagnostics(self, self._report, self._joints, 'identification')

    def _on_goal(self, action: Action, request: Any) -> Any:
        try:
            if self._busy:
                raise InputError('another goal is running')
            if action.kind is IdentifyFriction:
                check_folder(self._settings['output_folder'])
            index, goal = action.make_goal(request, self._joints, self._defaults)
            self._accepted = index, action.run(goal, self._drives[index], self._torque)
            self._check_surroundings(self._joints[index])
            self._check_held(index)
        except InputError as error:
            self._refused = str(error)
            self.get_logger().warning(f'goal rejected: {error}')
            return GoalResponse.REJECT
        self._refused, self._busy = '', True
        return GoalResponse.ACCEPT

    def _check_surroundings(self, joint: str) -> None:
        """Raise InputError without new states of a joint, or if another node may command it."""
        now, others = time.monotonic(), self._port.others()
        if now - self._received > _MAX_AGE:
            raise InputError('there are no joint_states')
        if now - self._fresh > _MAX_AGE:
            raise InputError(_why_old(self._states, joint, 'joint_states are not updated'))
        if joint in self._states.missing:
            raise InputError(f'joint_states lack {joint}')
        if others:
            raise InputError(f'{", ".join(others)} may command the motor: deactivate it first')

    def _check_held(self, index: int) -> None:
        """Raise InputError if a motor holds another joint, which its model would not carry."""
        carried, states = self._carried.at(self._states.position), self._states
        for j, (joint, model) in enumerate(zip(self._joints, self._models)):
            held = float(states.effort[j]) * self._per_effort[j]
            friction = (_HELD * model.drive.current_limit if model.breakaway is None else min(
                model.breakaway.positive_mean, -model.breakaway.negative_mean))
            if j != index and min(abs(held), abs(held - carried[j])) > friction:
                say = partial(model.drive.in_words, torque=self._torque)
                raise InputError(
                    f'the motor of {joint} holds it with {say(held)}, of which its model carries '
                    f'{say(float(carried[j]))}: it would fall, since only {self._joints[index]} is '
                    'moved. Refine a model that carries its weight, or support it')

    def _on_cancel(self, _: Any) -> Any:
        self._end(*_CANCELLED)
        return CancelResponse.ACCEPT

    async def _execute(self, action: Action, goal_handle: Any) -> Any:
        result = action.kind.Result()
        try:
            index, run = self._accepted
            self._states.forget()
            self._port.open()
            goal = self._goal = RunningGoal(action, goal_handle, index, self._joints[index], run)
            self.get_logger().info(f'{action.name}: moves {goal.joint}')
            if goal_handle.is_cancel_requested:
                # It arrived before there was a run to end.
                self._end(*_CANCELLED)
            end, result.message = await goal.end
            if end == 'done':
                result.message = action.finish(goal.run, index, result)
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
        {'done': goal_handle.succeed, 'canceled': goal_handle.canceled,
         'aborted': goal_handle.abort}[end]()
        return result

    def _finish_identification(self, run: Any, index: int, result: Any) -> str:
        """Fit the model, write its file, and fill the result."""
        outcome, joint = run.result(), self._joints[index]
        goals.fill_result(result, outcome)
        before = self._models[index]
        model = outcome.model(before.drive, joint, before.position_limits,
                              self._carried.effects[index], before.arm)
        path = (Path(self._settings['output_folder'])
                / f'{file_names(self._joints)[index]}.yaml').absolute()
        try:
            model.save(path)
        except InputError as error:
            # The measurement takes minutes: its model is kept where it can be copied from.
            self.get_logger().error(f'the model of {joint}:\n{to_yaml(model.to_dict())}')
            raise InputError(f'{error}. The result has what was measured, and the log of the node '
                             'identification the whole model file') from None
        result.model_file = str(path)
        return '. '.join([f'identified {joint}, wrote {path}', *outcome.warnings])

    def _end(self, end: str, message: str) -> None:
        """End the present run, if any: first zero current, then the result."""
        goal, self._goal = self._goal, None
        if goal is None:
            return
        self._watchdog.rest()
        self._port.zero()
        goal.run.abort(message)
        goal.end.set_result((end, message))

    @property
    def _simulated(self) -> bool:
        return bool(self.get_clock().ros_time_is_active)

    def _on_joint_states(self, message: Any, info: Any) -> None:
        self._rate.count += 1
        now = self.get_clock().now().nanoseconds
        if self._goal is not None and not self._port.ready:
            return
        ticket = self._port.ticket
        verdict = self._states.take(
            message, now, 0 if self._simulated else info['received_timestamp'],
            info['publication_sequence_number'] or 0)
        self._received = time.monotonic()
        # While nobody commands, a simulation in lockstep repeats its last state.
        if verdict == joint_states.NEW or (verdict == joint_states.AGAIN and self._simulated):
            self._fresh = self._received
        if self._goal is not None:
            self._answer(self._goal, verdict, ticket, info['source_timestamp'])

    def _answer(self, goal: RunningGoal, verdict: str, ticket: int, sent: int) -> None:
        """Answer a joint state, or end the goal if that is not possible."""
        try:
            # What comes after a silence does not undo it, unless simulated time has stopped.
            if goal.silent and not self._simulated:
                raise InputError(_why_old(self._states, goal.joint, _SILENT))
            if verdict == joint_states.NEW:
                goal.silent = False
                self._watchdog.feed()
                self._measure(goal, ticket)
            elif verdict == joint_states.AGAIN:
                self._port.repeat(sent)
            elif verdict in (joint_states.MALFORMED, joint_states.CONTESTED):
                raise InputError(self._states.wrong)
        except InputError as error:
            self._end('aborted', str(error))
        except Exception:
            self.get_logger().error(traceback.format_exc())
            self._end('aborted', 'an error in the node, see its log')

    def _measure(self, goal: RunningGoal, ticket: int) -> None:
        """Answer a new joint state with the current of the run."""
        states, index, run = self._states, goal.index, goal.run
        if goal.started is None:
            goal.started = states.stamp
        at = (states.stamp - goal.started) / NANO
        position, effort = float(states.position[index]), float(states.effort[index])
        velocity = math.nan if states.velocity is None else float(states.velocity[index])
        if not math.isfinite(position) or not math.isfinite(effort):
            raise InputError(
                f'joint_states hold no finite position and effort of {goal.joint}')
        measured = effort * self._per_effort[index]
        # From the first state on: a joint must not fall meanwhile.
        commands = self._carried.at(states.position)
        self._check_at_rest(goal, states.position)
        current = run.update(at, position, velocity, measured, float(commands[index]))
        commands[index] = 0.0 if run.finished else current
        self._port.answer(commands, ticket, states.stamp if self._simulated else 0)
        now = time.monotonic()
        if now - goal.last_feedback >= _FEEDBACK_PERIOD:
            goal.last_feedback = now
            goal.handle.publish_feedback(goal.action.kind.Feedback(
                phase=run.phase, progress=float(run.progress),
                remaining_seconds=float(run.remaining), time=at, position=position,
                velocity=velocity, current=measured))
        if run.finished:
            self._end('done', '')

    def _check_at_rest(self, goal: RunningGoal, position: np.ndarray) -> None:
        """Raise InputError if a joint moves that is not to be moved."""
        if goal.places is None:
            goal.places = position.copy()
        moved = np.abs(position - goal.places)
        moved[goal.index] = 0.0
        if (moved > _MOVED).any():
            joint = self._joints[int(np.nanargmax(moved))]
            raise InputError(
                f'{joint} moved by {np.nanmax(moved):.2g} rad while {goal.joint} was moved: '
                'nothing holds it. Refine a model that carries its weight, or support it')

    def _on_silence(self) -> None:
        """Command zero; called by the watchdog, in its thread."""
        self._port.zero()
        if (goal := self._goal) is not None:
            goal.silent = True

    def _check_connections(self) -> None:
        """Check the publishers, and end a goal whose client is gone."""
        self._states.publishers = joint_io.competing_publishers(self, 'joint_states')
        goal = self._goal
        if goal is None:
            return
        client = self.resolve_service_name(f'{goal.action.name}/_action/get_result')
        others, clients = self._port.others(), self.count_clients(client)
        goal.had_client = goal.had_client or clients > 0
        # Simulated time may stop: its last state then stays valid.
        if goal.was_silent and goal.silent and not self._simulated:
            self._end('aborted', _why_old(self._states, goal.joint, _SILENT))
        elif not self.count_publishers(self.resolve_topic_name('joint_states')):
            self._end('aborted', 'joint_states have no publisher any more')
        elif goal.had_client and not clients:
            self._end('aborted', 'the client of the goal is gone')
        elif others:
            self._end('aborted', f'{", ".join(others)} may command the motor too')
        goal.was_silent = goal.silent

    def _report(self) -> Any:
        values = {'joint_states per second of real time': self._rate.per_second(),
                  'last goal': self._last_end, 'last refusal': self._refused,
                  'listeners to the command': self._port.listeners}
        if (goal := self._goal) is not None:
            values.update({'joint': goal.joint, 'phase': goal.run.phase,
                           'progress': float(goal.run.progress), 'command [A]': self._port.last})
            return OK, f'{goal.action.name}: moves {goal.joint}', values
        if self._last_end.startswith('aborted'):
            return ERROR, self._last_end, values
        if not self._states.stamp:
            return WARN, 'no joint_states yet', values
        return OK, 'ready', values

    def stop_motor(self) -> None:
        """Command zero current until `resume`; may be called from any thread."""
        self._port.zero(permanent=True)

    def resume(self, seconds: float) -> None:
        """End a running goal after the process was stopped for some s."""
        self._end('aborted', f'the node was stopped for {seconds:.3g} s')
        self._states.forget()
        self._received = self._fresh = -math.inf
        self._port.release()

    def leave(self) -> None:
        """End a running goal with zero current."""
        self._end('aborted', 'the node was stopped')
        # A goal that starts while the node ends must not move its joint.
        self.stop_motor()
        self._port.close()
        self._watchdog.close()


def _why_old(states: JointStateInput, joint: str, otherwise: str) -> str:
    """Return why there is no new state of a joint."""
    return states.wrong or (f'joint_states lack {joint}' if joint in states.missing else otherwise)
