# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Monitors how well the models fit, and refines them on request as an action server."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
import time
import traceback
from typing import Any

from friction_comp_interfaces.action import RefineModel
import numpy as np
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

from friction_comp.errors import InputError
from friction_comp.files import file_names
from friction_comp.monitoring.live_residual import JointWatch
from friction_comp.nodes.live_signals import LiveSignals
from friction_comp.nodes.refine_job import Message, RecentPast, RefineJob, refusal
from friction_comp.recorded_drive.child import Refined
from friction_comp.ros.dated_topics import DatedTopics, RECORDED, STATES
from friction_comp.ros.diagnostics import Diagnostics, ERROR, OK, Rate, WARN
from friction_comp.ros.executor import yield_to_executor
from friction_comp.ros.parameters import load_models, names_in, Settings
from friction_comp.ros.ros_start import steady_timer

# Real s between checks of a running refinement and of the residual.
_POLL_PERIOD, _MONITORING_PERIOD = 0.2, 1.0
# Time without a measured load after which it counts as not measured, s.
_LOAD_SILENCE = 5.0
# Timeout of the compensator's answers, s; it validates a new model before it answers.
_TIMEOUT = 20.0
_NOT_KEPT = ('reference', '/diagnostics')


class CompensatorClient:
    """The running compensator with a node name, and the model files of its joints."""

    def __init__(self, node: Node, name: str) -> None:
        self.name = name
        self.model_changes = 0    # answers to earlier requests are outdated
        self._get = node.create_client(GetParameters, f'{name}/get_parameters')
        self._set = node.create_client(SetParameters, f'{name}/set_parameters')

    async def files(self) -> dict[str, str]:
        """Return the model file of each joint; empty if no compensator is running."""
        if not self._get.service_is_ready() or not self._set.service_is_ready():
            return {}
        reply = await self._wait_for(self._get.call_async(
            GetParameters.Request(names=['joints', 'model_files'])))
        joints, files = (parameter_value_to_python(value) for value in reply.values)
        return dict(zip(joints or (), files or ()))

    async def load(self, joint: str, path: str) -> None:
        """Load a model for one joint; raise InputError if the compensator is missing or refuses."""
        files = await self.files()
        if joint not in files:
            raise InputError(f'no compensator of {joint} is running as {self.name}')
        files[joint] = path
        reply = await self._wait_for(self._set.call_async(SetParameters.Request(parameters=[
            Parameter('model_files', value=list(files.values())).to_parameter_msg()])))
        result = reply.results[0]
        if not result.successful:
            raise InputError(f'{self.name} refuses the model: {result.reason}')
        self.model_changes += 1

    async def _wait_for(self, future: Any) -> Any:
        end = time.monotonic() + _TIMEOUT
        while not future.done():
            if time.monotonic() > end:
                raise InputError(f'{self.name} does not answer')
            await yield_to_executor()
        return future.result()


class RefinementNode(Node):
    """Serves one goal at a time; commands no motor.

    It subscribes to the topics of the recorder, keeps the last minutes, and compares the measured
    current with the model of each joint.
    """

    # Nothing waits for this node: messages are processed in batches.
    batch_time = 0.01

    def __init__(self) -> None:
        super().__init__('refinement')
        settings = self._settings = Settings(self, 'refinement')
        self._joints = settings.joints
        models = load_models(settings['model_files'], self._joints)
        self._files = dict(zip(self._joints, names_in(settings['model_files'])))
        self._past = RecentPast(settings['memory'], round(1e6 * settings['memory_size']))
        self._compensator = CompensatorClient(self, settings['compensator'])
        self._in_ampere = settings['effort_holds'] == 'current'
        self._signals = LiveSignals(self._joints, [
            1.0 if self._in_ampere else model.drive.torque_per_current for model in models])
        self._watches = {joint: JointWatch(settings['tolerance'], joint, path)
                         for joint, path in self._files.items()}
        self._rate = Rate()
        self._job: RefineJob | None = None
        self._busy = self._comparing = False
        self._fits = dict.fromkeys(self._joints, True)
        # By joint: file that was worse in its trial, file to load instead, and why.
        self._to_unload: dict[str, tuple[str, str, str]] = {}
        self._last_result = self._last_refusal = self._error = ''
        self._topics = DatedTopics(self, self._keep, _NOT_KEPT).topics
        # In the node's default group, waiting for the compensator would block all callbacks.
        steady_timer(
            self, _MONITORING_PERIOD, self._monitor, callback_group=ReentrantCallbackGroup())
        self._server = ActionServer(
            self, RefineModel, 'refine_model', self._execute, goal_callback=self._on_goal,
            cancel_callback=lambda _: CancelResponse.ACCEPT)
        Diagnostics(self, self._report, self._joints, 'refinement')

    def _keep(self, topic: str, stamp: int, cdr: bytes) -> None:
        cdr = bytes(cdr)
        self._past.add(Message(stamp, self._topics[topic].name, RECORDED[topic], cdr))
        if topic == STATES:
            self._rate.count += 1
            self._signals.add_state(stamp, cdr)
        elif topic in ('interaction_wrench', 'motor_temperature'):
            self._signals.add_message(topic, stamp, cdr)

    async def _monitor(self) -> None:
        if self._comparing:
            return
        self._comparing = True
        try:
            await self._compare()
            self._error = ''
        except InputError as error:
            self._error = str(error)
        finally:
            self._comparing = False

    async def _compare(self) -> None:
        model_changes = self._compensator.model_changes
        files = await self._compensator.files()
        if model_changes != self._compensator.model_changes:
            # The answer may be older than the change, and would end the trial of the new model.
            return
        name = self._compensator.name.rpartition('/')[2]
        compensated = any(info.node_name == name for info in self.get_publishers_info_by_topic(
            self.resolve_topic_name('current_command')))
        for joint, rows in zip(self._joints, self._signals.take()):
            watch = self._watches[joint]
            if not self._busy:
                watch.use(files.get(joint, self._files[joint]))
            if compensated and len(rows):
                # Use only rows with a measured load: it adds to the compensator's own current.
                now, rows = rows[-1, 0], rows[np.isfinite(rows[:, 4])]
                if len(rows):
                    watch.last_load = rows[-1, 0]
                watch.residual.blind = (
                    'the compensator feeds the model itself forward, and the load of a person '
                    'is not measured' if now - watch.last_load > _LOAD_SILENCE else '')
            watch.add(rows)
            self._judge(joint, watch)
        for joint in list(self._to_unload):
            await self._unload(joint)

    def _judge(self, joint: str, watch: JointWatch) -> None:
        ended = watch.end_trial()
        if ended is not None:
            self._to_unload[joint] = watch.file, *ended
        verdict = watch.residual.verdict()
        if verdict.fits != self._fits[joint]:
            self._fits[joint] = verdict.fits
            log = self.get_logger().info if verdict.fits else self.get_logger().warning
            log(f'{joint}: {verdict.text}')

    async def _unload(self, joint: str) -> None:
        """Replace a worse model by the previous one; if the compensator fails, do it next time."""
        worse, previous, reason = self._to_unload[joint]
        watch = self._watches[joint]
        # Otherwise another one was loaded meanwhile.
        if watch.file == worse:
            await self._compensator.load(joint, previous)
            watch.use(previous)
            self._last_result = f'{joint}: {worse} was unloaded: {reason}'
            self.get_logger().warning(self._last_result)
        del self._to_unload[joint]

    def _on_goal(self, request: RefineModel.Goal) -> GoalResponse:
        self._last_refusal = ''
        if request.joint and request.joint not in self._joints:
            self._last_refusal = (
                f'unknown joint {request.joint!r}; known: {", ".join(self._joints)}')
        elif self._busy:
            self._last_refusal = 'another goal is running'
        if self._last_refusal:
            self.get_logger().warning(f'goal rejected: {self._last_refusal}')
            return GoalResponse.REJECT
        self._busy = True
        return GoalResponse.ACCEPT

    async def _execute(self, goal_handle: Any) -> RefineModel.Result:
        result = RefineModel.Result()
        request = goal_handle.request
        joint = request.joint or self._joints[0]
        try:
            refined, start = await self._refine(joint, request, goal_handle)
            report = refined.report
            result = RefineModel.Result(
                success=True, verdict=report.verdict, error_before=report.before.held_out_rmse,
                error_after=report.after.held_out_rmse, noise_floor=report.noise_floor,
                effects=[effect.name for effect in report.effects],
                variables=[effect.variable for effect in report.effects],
                model_file=str(refined.model_file), report=str(refined.page))
            result.message = await self._load_if_requested(joint, request, refined, start, result)
            goal_handle.succeed()
        except InputError as error:
            result.message = str(error)
            if goal_handle.is_cancel_requested:
                goal_handle.canceled()
            else:
                goal_handle.abort()
        except Exception:
            self.get_logger().error(traceback.format_exc())
            result.message = 'an error in the node, see its log'
            goal_handle.abort()
        finally:
            self._job, self._busy = None, False
        self._last_result = f'{joint}: {result.message}'
        self.get_logger().info(self._last_result)
        return result

    async def _refine(self, joint: str, request: RefineModel.Goal, goal_handle: Any
                      ) -> tuple[Refined, str]:
        """Return the result of refinement and the initial model file."""
        files = await self._compensator.files()
        start = files.get(joint, self._files[joint])
        output = Path(self._settings['output_folder']).absolute() / (
            f'{file_names([joint])[0]}_{datetime.now():%Y-%m-%d_%H-%M-%S.%f}')
        messages = []
        if not request.recording:
            if blind := self._watches[joint].residual.blind:
                raise InputError(f'{joint}: the messages kept do not show the friction: {blind}')
            messages = self._past.last(request.seconds)
            if not messages:
                raise InputError('no messages are kept')
        job = self._job = RefineJob(
            joint, start, output, request.recording, messages, self._in_ampere)
        while not job.poll():
            if goal_handle.is_cancel_requested:
                job.cancel('cancelled on request')
            share, step = job.progress
            goal_handle.publish_feedback(RefineModel.Feedback(progress=share, step=step))
            end = time.monotonic() + _POLL_PERIOD
            while time.monotonic() < end and not job.cancelled:
                # The executor does not sleep while a coroutine is pending.
                time.sleep(self.batch_time)
                await yield_to_executor()
        return job.result(), start

    async def _load_if_requested(self, joint: str, request: RefineModel.Goal, refined: Refined,
                                 start: str, result: RefineModel.Result) -> str:
        """Load the refined model if requested and allowed; return a message about it."""
        watch = self._watches[joint]
        watch.use(start)
        found = ', '.join(result.effects) or 'no effect'
        reasons = '; '.join(line.rstrip('.') for line in refined.report.reasons)
        summary = (f'found {found}; error {1e3 * result.error_before:.3g} mA before, '
                   f'{1e3 * result.error_after:.3g} mA after; verdict: {result.verdict}'
                   f'{": " if reasons else ""}{reasons}')
        if not request.load:
            return summary
        if refused := refusal(refined, watch.residual.model):
            return f'{summary}; not loaded: {refused}'
        try:
            await self._compensator.load(joint, str(refined.model_file))
        except InputError as error:
            return f'{summary}; not loaded: {error}'
        watch.start_trial(str(refined.model_file))
        result.loaded = True
        return f'{summary}; loaded, and on trial beside {start}'

    def _report(self) -> tuple[Any, ...]:
        values = {'joint_states per second of real time': self._rate.per_second(),
                  'kept [s]': self._past.span, 'kept [MB]': self._past.size / 1e6,
                  'last goal': self._last_result, 'last refusal': self._last_refusal}
        misfits = []
        for joint, watch in self._watches.items():
            verdict = watch.residual.verdict()
            text = watch.residual.blind or verdict.text
            values.update({f'{joint}: residual': text,
                           f'{joint}: error as a share of the friction': float(verdict.share),
                           f'{joint}: model file': watch.file,
                           f'{joint}: on trial': watch.trial is not None})
            if not verdict.fits and not watch.residual.blind:
                misfits.append(f'{joint}: {text}: refine it')
        if self._error:
            return ERROR, self._error, values
        if misfits:
            return WARN, '; '.join(misfits), values
        if self._job is not None:
            return OK, f'refines: {self._job.progress[1]}', values
        if not self._rate.count:
            return WARN, 'no joint_states yet', values
        return OK, 'watching', values

    def leave(self) -> None:
        """End a running refinement."""
        if self._job is not None:
            self._job.cancel('the node was stopped')
