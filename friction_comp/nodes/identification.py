# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Moves a joint by motor currents in two actions: friction identification and trajectories."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
import math
from pathlib import Path
import time
import traceback
from typing import Any

from friction_comp_interfaces.action import IdentifyFriction, PlayTrajectory
import numpy as np
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState

from friction_comp.control import joint_states
from friction_comp.control.watchdog import Watchdog
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.files import check_folder, file_names
from friction_comp.identification import goal as goals
from friction_comp.identification.goal import IdentificationGoal, TrajectoryGoal
from friction_comp.identification.run import IdentificationRun, TrajectoryRun
from friction_comp.messages import NANO, nanoseconds
from friction_comp.ros import joint_io, node_parts as parts
from friction_comp.ros.ros_start import steady_timer

# Real s between checks of publishers, other commanders and the client, and between feedbacks.
_PERIOD = 0.1
_SILENT = 'joint_states fell silent'


@dataclass
class RunningGoal:
    """A goal while its joint is moved; `name` is that of its action."""

    name: str
    index: int
    joint: str
    run: Any
    tell: Callable[..., None]       # publishes feedback, by its fields
    end: Future = field(default_factory=Future)     # with why it ended too early, '' if it did not
    started: int | None = None      # stamp of the first joint state, ns
    places: np.ndarray | None = None    # of all joints then, rad
    last_feedback: float = -math.inf    # real time, s
    had_client: bool = False        # whether a client has waited for the result
    silent: bool = False            # whether joint states are


class IdentificationNode(Node):
    """Serves one goal at a time, which is the only time when it has a publisher of currents.

    It publishes one command per joint state, and ends every goal with zero current.
    """

    def __init__(self) -> None:
        super().__init__('identification')
        settings = self._settings = parts.Settings(self, 'identification')
        self._joints = settings.joints
        self._models = parts.load_models(settings['model_files'], self._joints)
        self._drives = [model.drive for model in self._models]
        self._carried = goals.Carried(
            self._joints, self._models, settings['gravity'] == goals.GRAVITY[0])
        timeout = settings['joint_state_timeout']
        self._defaults = {name: settings[f'default_{name}'] for name in goals.GOAL_LIMITS}
        self._states = joint_states.JointStateInput(self._joints, round(NANO * timeout))
        torques = [drive.torque_per_current for drive in self._drives]
        in_ampere = settings['effort_holds'] == 'current'
        self._per_effort = [1.0 if in_ampere else 1.0 / torque for torque in torques]
        interface = settings['command_interface']
        self._torque = interface == 'effort'    # the unit in messages
        self._port = joint_io.CommandPort(
            self, [drive.current_limit for drive in self._drives], torques, interface)
        self._watchdog = Watchdog(timeout, self._on_silence).start()
        self._rate, self._fresh, self._simulated = parts.Rate(), -math.inf, settings['use_sim_time']
        # Joint index and run of the last request that was accepted.
        self._accepted: tuple[int, Any] = 0, None
        self._goal: RunningGoal | None = None
        compile_ahead(self._drives[0])
        self.create_subscription(JointState, 'joint_states', self._on_joint_states,
                                 joint_io.QOS[settings['input_reliability']])
        steady_timer(self, _PERIOD, self._check_connections)
        self._goals = parts.GoalServer(self)
        for kind, name, make_goal, make_run, finish in (
                (IdentifyFriction, 'identify_friction', identification_goal, IdentificationRun,
                 self._finish_identification),
                (PlayTrajectory, 'play_trajectory', trajectory_goal, TrajectoryRun,
                 lambda _, j, __: f'moved {self._joints[j]} along the trajectory')):
            self._goals.serve(kind, name, partial(self._accept, make_goal, make_run),
                              partial(self._move, name, kind.Feedback, finish),
                              lambda: self._end('cancelled on request'))
        parts.Diagnostics(self, self._report, self._joints, 'identification')

    def _accept(self, make_goal: Callable[..., Any], make_run: Callable[..., Any], request: Any
                ) -> None:
        check_folder(self._settings['output_folder'])
        index, goal = make_goal(request, self._joints, self._defaults)
        self._accepted = index, make_run(goal, self._drives[index], self._torque)
        self._check_surroundings(self._joints[index])
        self._check_held(index)

    def _check_surroundings(self, joint: str) -> None:
        """Raise InputError without new states of a joint, or if another node may command it."""
        # A busy machine may delay reading; the joint is not driven before a new state has arrived.
        if time.monotonic() - self._fresh > 2.0:
            raise InputError(_why_old(self._states, joint, 'joint_states are not updated')
                             if self._rate.count else 'there are no joint_states')
        if joint in self._states.missing:
            raise InputError(f'joint_states lack {joint}')
        if others := self._port.others():
            raise InputError(f'{", ".join(others)} may command the motor: deactivate it first')

    def _check_held(self, index: int) -> None:
        """Raise InputError if a motor holds another joint, which its model would not carry."""
        carried, states = self._carried.at(self._states.position), self._states
        for j, (joint, model) in enumerate(zip(self._joints, self._models)):
            held = float(states.effort[j]) * self._per_effort[j]
            friction = (0.05 * model.drive.current_limit if model.breakaway is None else min(
                model.breakaway.positive_mean, -model.breakaway.negative_mean))
            if j != index and min(abs(held), abs(held - carried[j])) > friction:
                say = partial(model.drive.in_words, torque=self._torque)
                raise InputError(
                    f'the motor of {joint} holds it with {say(held)}, of which its model carries '
                    f'{say(float(carried[j]))}: it would fall, since only {self._joints[index]} is '
                    'moved. Refine a model that carries its weight, or support it')

    async def _move(self, name: str, feedback: Any, finish: Callable[..., str], handle: Any,
                    result: Any) -> str:
        """Move the joint of the accepted goal to its end; return what to say."""
        index, run = self._accepted
        try:
            self._states.forget()
            self._port.open()
            goal = self._goal = RunningGoal(
                name, index, self._joints[index], run,
                lambda **fields: handle.publish_feedback(feedback(**fields)))
            self.get_logger().info(f'{name}: moves {goal.joint}')
            if handle.is_cancel_requested:
                # It arrived before there was a run to end.
                self._end('cancelled on request')
            if why := await goal.end:
                raise InputError(why)
            return finish(run, index, result)
        finally:
            self._end('an error in the node')
            self._port.close()

    def _finish_identification(self, run: Any, index: int, result: Any) -> str:
        """Fit the model, write its file, and fill the result."""
        outcome, joint = run.result(), self._joints[index]
        for name in ('speeds', 'currents', 'standard_deviations', 'coefficients'):
            setattr(result, name, [float(value) for value in getattr(outcome, name)])
        for name in ('positive_mean', 'positive_std', 'negative_mean', 'negative_std'):
            setattr(result, f'breakaway_{name}', float(getattr(outcome.breakaway, name)))
        before = self._models[index]
        model = outcome.model(before.drive, joint, before.position_limits,
                              self._carried.effects[index], before.arm)
        path = (Path(self._settings['output_folder'])
                / f'{file_names(self._joints)[index]}.yaml').absolute()
        model.save(path)
        result.model_file = str(path)
        return '. '.join([f'identified {joint}, wrote {path}', *outcome.warnings])

    def _end(self, why: str = '') -> None:
        """End the present run, if any, and say why unless it is done: first zero, then the rest."""
        goal, self._goal = self._goal, None
        if goal is None:
            return
        self._watchdog.rest()
        self._port.zero()
        goal.run.abort(why)
        goal.end.set_result(why)

    def _on_joint_states(self, message: Any, info: Any) -> None:
        self._rate.count += 1
        if self._goal is not None and not self._port.ready:
            return
        ticket = self._port.ticket
        verdict = self._states.take(
            message, self.get_clock().now().nanoseconds,
            0 if self._simulated else info['received_timestamp'],
            info['publication_sequence_number'] or 0)
        # While nobody commands, a simulation in lockstep repeats its last state.
        if verdict == joint_states.NEW or (verdict == joint_states.AGAIN and self._simulated):
            self._fresh = time.monotonic()
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
            self._end(str(error))
        except Exception:
            self._end('an error in the node, see its log')
            self.get_logger().error(traceback.format_exc())

    def _measure(self, goal: RunningGoal, ticket: int) -> None:
        """Answer a new joint state with the current of the run."""
        states, index, run = self._states, goal.index, goal.run
        if goal.started is None:
            goal.started = states.stamp
        at = (states.stamp - goal.started) / NANO
        position, effort, velocity = (math.nan if values is None else float(values[index])
                                      for values in (states.position, states.effort,
                                                     states.velocity))
        if not math.isfinite(position) or not math.isfinite(effort):
            raise InputError(f'joint_states hold no finite position and effort of {goal.joint}')
        measured = effort * self._per_effort[index]
        # From the first state on: a joint must not fall meanwhile.
        commands = self._carried.at(states.position)
        self._check_at_rest(goal, states.position)
        current = run.update(at, position, velocity, measured, float(commands[index]))
        commands[index] = 0.0 if run.finished else current
        self._port.answer(commands, ticket, states.stamp if self._simulated else 0)
        now = time.monotonic()
        if now - goal.last_feedback >= _PERIOD:
            goal.last_feedback = now
            goal.tell(phase=run.phase, progress=float(run.progress),
                      remaining_seconds=float(run.remaining), time=at, position=position,
                      velocity=velocity, current=measured)
        if run.finished:
            self._end()

    def _check_at_rest(self, goal: RunningGoal, position: np.ndarray) -> None:
        """Raise InputError if a joint moves that is not to be moved."""
        if goal.places is None:
            goal.places = position.copy()
        moved = np.abs(position - goal.places)
        moved[goal.index] = 0.0
        if (moved > 0.1).any():
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
        clients = self.count_clients(self.resolve_service_name(f'{goal.name}/_action/get_result'))
        goal.had_client = goal.had_client or clients > 0
        others = ', '.join(self._port.others())
        for ends, why in (
                # Simulated time may stop: its last state then stays valid.
                (goal.silent and not self._simulated,
                 _why_old(self._states, goal.joint, _SILENT)),
                (not self.count_publishers(self.resolve_topic_name('joint_states')),
                 'joint_states have no publisher any more'),
                (goal.had_client and not clients, 'the client of the goal is gone'),
                (others, f'{others} may command the motor too')):
            if ends:
                self._end(why)
                break

    def _report(self) -> Any:
        values = {'joint_states per second of real time': self._rate.per_second(),
                  'last goal': self._goals.last, 'last refusal': self._goals.refused,
                  'listeners to the command': self._port.listeners}
        if (goal := self._goal) is not None:
            values.update({'joint': goal.joint, 'phase': goal.run.phase,
                           'progress': float(goal.run.progress), 'command [A]': self._port.last})
        last = self._goals.last
        return parts.first_of(
            values, (goal, parts.OK, f'{goal.name}: moves {goal.joint}' if goal else ''),
            (last.startswith('aborted'), parts.ERROR, last),
            (self._states.stamp, parts.OK, 'ready'), (True, parts.WARN, 'no joint_states yet'))

    def stop_motor(self) -> None:
        """Command zero current for good; may be called from any thread."""
        self._port.zero(permanent=True)

    def leave(self) -> None:
        """End a running goal with zero current."""
        self._end('the node was stopped')
        # A goal that starts while the node ends must not move its joint.
        self.stop_motor()
        self._port.close()
        self._watchdog.close()


def _why_old(states: joint_states.JointStateInput, joint: str, otherwise: str) -> str:
    """Return why there is no new state of a joint."""
    return states.wrong or (f'joint_states lack {joint}' if joint in states.missing else otherwise)


def identification_goal(request: Any, joints: list[str], defaults: dict[str, Any]
                        ) -> tuple[int, IdentificationGoal]:
    """Return joint index and goal of an IdentifyFriction goal."""
    index = _index_of(request.joint, joints) if request.joint else 0
    fields = {name: getattr(request, name) or default for name, default in defaults.items()}
    return index, IdentificationGoal(**dict(
        fields, speeds=tuple(fields['speeds']), ramp_slope=fields['ramp_slope'] or None))


def trajectory_goal(request: Any, joints: list[str], defaults: dict[str, Any]
                    ) -> tuple[int, TrajectoryGoal]:
    """Return joint index and goal of a PlayTrajectory goal."""
    names, points = list(request.trajectory.joint_names), request.trajectory.points
    if len(names) != 1:
        raise InputError(f'one joint is moved at a time, not {len(names)}')
    index = _index_of(names[0], joints)
    if any(len(point.positions) != 1 or len(point.velocities) != 1 for point in points):
        raise InputError('a point of the trajectory lacks position or velocity')
    return index, TrajectoryGoal(
        [nanoseconds(point.time_from_start) / NANO for point in points],
        [point.positions[0] for point in points], [point.velocities[0] for point in points],
        request.ramp_slope or defaults['ramp_slope'] or None,
        request.ramp_period or defaults['ramp_period'])


def _index_of(joint: str, joints: list[str]) -> int:
    if joint not in joints:
        raise InputError(f'unknown joint {joint!r}; known: {", ".join(joints)}')
    return joints.index(joint)


def compile_ahead(drive: Drive) -> None:
    """Import and compile everything a goal needs before the first one arrives."""
    goal = IdentificationGoal(
        speeds=(0.4, 0.8), ramp_slope=drive.current_limit / 10.0, ramp_period=1.0)
    identification = IdentificationRun(goal, drive)
    for k in range(3):
        identification.update(1e-3 * k, 0.0, 0.0, 0.0)
    identification.abort()
