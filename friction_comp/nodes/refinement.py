# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Monitors how well the models fit, and refines them on request as an action server."""

from __future__ import annotations

import ast
from collections import deque
from datetime import datetime
import math
import os
from pathlib import Path
import re
import subprocess
import sys
import time
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from friction_comp_interfaces.action import RefineModel
import numpy as np
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message

from friction_comp.errors import InputError
from friction_comp.files import file_names, read_json
from friction_comp.messages import NANO
from friction_comp.model.friction_model import FrictionModel
from friction_comp.monitoring.live_residual import LiveResidual
from friction_comp.recordings.scan import Track, tracks_of
from friction_comp.recordings.writer import RecordingWriter
from friction_comp.ros import node_parts as parts
from friction_comp.ros.dated_topics import DatedTopics, RECORDED, STATES
from friction_comp.ros.node_main import yield_to_executor
from friction_comp.ros.ros_start import steady_timer
from friction_comp.terminal import PROGRESS

# ns between states that are compared, and of age up to which a load, or temperature, counts.
_STEP = 8_000_000
_AGES = {'interaction_wrench': 50_000_000, 'motor_temperature': 60 * NANO}


class Message(NamedTuple):
    """A recorded message: when it arrived, real s, its stamp, ns, topic, type and content."""

    arrived: float
    stamp: int
    topic: str
    kind: str
    cdr: bytes


def live_rows(tracks: dict[str, Track], joint: str, effort_per_current: float) -> np.ndarray:
    """Return rows of a joint for `LiveResidual`, (N, 6), some hundred per second."""
    states = tracks.get(STATES)
    if states is None or joint not in states.values:
        return np.empty((0, 6))
    some = np.flatnonzero(np.diff(states.receive // _STEP, prepend=0))
    times, rows = states.receive[some], np.full((len(some), 6), np.nan)
    rows[:, 0], rows[:, 1:4] = times / NANO, states.values[joint][some]
    rows[:, 3] /= effort_per_current
    for column, (topic, oldest) in enumerate(_AGES.items(), 4):
        if topic in tracks and joint in (track := tracks[topic]).values:
            order = np.argsort(track.receive, kind='stable')
            last = order[np.searchsorted(track.receive[order], times + oldest // 10, 'right') - 1]
            fresh = np.abs(times - track.receive[last]) <= oldest
            rows[fresh, column] = track.values[joint][last[fresh], 0]
    return rows


class RefineTool:
    """The tool `refine` on one recording, in a process of its own.

    The attributes `share` (0 to 1) and `step` are its progress.
    """

    def __init__(self, recording: Path, output: Path, *options: str) -> None:
        self.share, self.step, self._output, self._said = 0.0, 'reading', output, ''
        self._process: Any = subprocess.Popen(
            [sys.executable, '-m', 'friction_comp', 'refine', str(recording), '--output',
             str(output), *options], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE, env={**os.environ, PROGRESS: '1'},
            # The keyboard interrupts all processes of a session; the node decides what becomes of
            # this one, which leaves the processor to the control loop.
            start_new_session=True)
        os.setpriority(os.PRIO_PROCESS, self._process.pid, 10)
        assert self._process.stderr is not None
        os.set_blocking(self._process.stderr.fileno(), False)

    def poll(self) -> bool:
        """Update the progress, and return whether the tool is done."""
        done = self._process.poll() is not None
        self._said += (self._process.stderr.read() or b'').decode(errors='replace')
        for share, step in re.findall(r'^([01]\.\d+) (.+)\n', self._said, re.MULTILINE):
            self.share, self.step = max(self.share, float(share)), step
        return done

    def cancel(self) -> None:
        """Stop the tool, which leaves nothing half-written behind."""
        self._process.terminate()
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def report(self) -> dict[str, Any]:
        """Return the report of a tool that is done; raise InputError if it failed."""
        if self._process.returncode:
            raise InputError(self._said.strip().rpartition('\n')[2].removeprefix('refine: ')
                             or 'refinement ended without a result')
        report: dict[str, Any] = read_json(self._output / 'report.json')
        return report


class RefinementNode(Node):
    """Serves one goal at a time; commands no motor.

    It subscribes to the topics of the recorder, keeps the last minutes, and compares the measured
    current with the model of each joint: that of the compensator, as its diagnostics say.
    """

    # Nothing waits for this node: messages are processed in batches.
    batch_time = 0.01

    def __init__(self) -> None:
        super().__init__('refinement')
        settings = self._settings = parts.Settings(self, 'refinement')
        self._joints = settings.joints
        models = parts.load_models(settings['model_files'], self._joints)
        self._files = dict(zip(self._joints, parts.names_in(settings['model_files'])))
        self._residuals = {joint: LiveResidual(model, settings['tolerance'])
                           for joint, model in zip(self._joints, models)}
        self._past, self._memory = deque[Message](), settings['memory']
        self._in_ampere = settings['effort_holds'] == 'current'
        self._gains = {joint: 1.0 if self._in_ampere else model.drive.torque_per_current
                       for joint, model in zip(self._joints, models)}
        # What arrived since the last comparison: topic, stamp, ns, and content.
        self._fresh: list[tuple[str, int, bytes]] = []
        self._rate = parts.Rate()
        # Model files of the compensator's joints, and when it was heard last to be active, real s.
        self._compensators: dict[str, str] = {}
        self._active = -math.inf
        self._set = self.create_client(
            SetParameters, f'{settings["compensator"]}/set_parameters')
        self._job: RefineTool | None = None
        self._stopped = self._error = ''
        self._fits = dict.fromkeys(self._joints, True)
        self._topics = DatedTopics(self, self._keep, ('reference',)).topics
        steady_timer(self, 1.0, self._monitor)
        self._goals = parts.GoalServer(self)
        self._goals.serve(RefineModel, 'refine_model', self._accept, self._execute)
        parts.Diagnostics(self, self._report, self._joints, 'refinement')

    def _keep(self, topic: str, stamp: int, cdr: bytes) -> None:
        cdr = bytes(cdr)
        if topic == '/diagnostics':
            self._hear_compensator(deserialize_message(cdr, DiagnosticArray))
            return
        self._rate.count += topic == STATES
        now = time.monotonic()
        self._past.append(Message(now, stamp, self._topics[topic].name, RECORDED[topic], cdr))
        while self._past[0].arrived < now - self._memory:
            self._past.popleft()
        if topic in (STATES, *_AGES):
            self._fresh.append((topic, stamp, cdr))

    def _hear_compensator(self, message: Any) -> None:
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            if status.name.partition(':')[0] == self._settings['compensator'].lstrip('/') and (
                    'model_files' in values):
                self._compensators = dict(zip(
                    status.hardware_id.split(', '), ast.literal_eval(values['model_files'])))
                if values.get('state') == 'active':
                    self._active = time.monotonic()
                self._use(self._compensators)

    def _use(self, files: dict[str, str]) -> None:
        """Compare the motion of joints with the models of files, unless they are in use already."""
        self._error = ''
        for joint in set(files) & set(self._joints):
            try:
                if self._files[joint] != files[joint]:
                    self._residuals[joint] = LiveResidual(
                        FrictionModel.load(files[joint], joint), self._settings['tolerance'])
                    self._files[joint] = files[joint]
            except InputError as error:
                # It may be on another machine.
                self._error = str(error)

    def _monitor(self) -> None:
        # It reports once a second.
        compensated = time.monotonic() - self._active < 3.0
        tracks, now = tracks_of(self._fresh), self._fresh[-1][1] if self._fresh else 0
        # A load, or temperature, may count for the states of the next second, too.
        self._fresh = [(topic, stamp, cdr) for topic, stamp, cdr in self._fresh
                       if abs(now - stamp) <= _AGES.get(topic, -1)]
        for joint, residual in self._residuals.items():
            rows = live_rows(tracks, joint, self._gains[joint])
            if compensated:
                # The compensator's own current says nothing without the load that it helps.
                rows = rows[np.isfinite(rows[:, 4])]
            residual.add(rows)
            if compensated and not len(rows):
                residual.blind = ('the compensator feeds the model itself forward, and the load of '
                                  'a person is not measured')
            verdict = residual.verdict()
            if verdict.fits != self._fits[joint]:
                self._fits[joint] = verdict.fits
                log = self.get_logger().info if verdict.fits else self.get_logger().warning
                log(f'{joint}: {verdict.text}')

    def _accept(self, request: RefineModel.Goal) -> None:
        if request.joint and request.joint not in self._joints:
            raise InputError(f'unknown joint {request.joint!r}; known: {", ".join(self._joints)}')

    async def _execute(self, goal_handle: Any, result: RefineModel.Result) -> str:
        request = goal_handle.request
        joint = request.joint or self._joints[0]
        output = Path(self._settings['output_folder']).absolute() / (
            f'{file_names([joint])[0]}_{datetime.now():%Y-%m-%d_%H-%M-%S.%f}')
        try:
            report = await self._refine(joint, request, goal_handle, output)
        finally:
            self._job = None
        result.verdict, noise = report['verdict'], report['noise_floor']
        result.noise_floor = math.nan if noise is None else noise
        result.error_before, result.error_after = (
            report[one]['held_out_rmse'] for one in ('before', 'after'))
        result.effects = [effect['name'] for effect in report['effects']]
        result.variables = [effect['variable'] for effect in report['effects']]
        result.model_file, result.report = (
            str(output / name) for name in ('model.yaml', 'report.html'))
        return (f'{joint}: found {", ".join(result.effects) or "no effect"}; error '
                f'{1e3 * result.error_before:.3g} mA before, {1e3 * result.error_after:.3g} mA '
                f'after; verdict: {result.verdict}'
                + ''.join(f'; {reason.rstrip(".")}' for reason in report['reasons'])
                + (await self._load(joint, result) if request.load else ''))

    async def _refine(self, joint: str, request: RefineModel.Goal, goal_handle: Any, output: Path
                      ) -> dict[str, Any]:
        recording = Path(request.recording or output / 'recording')
        if not request.recording:
            if blind := self._residuals[joint].blind:
                raise InputError(f'{joint}: the messages kept do not show the friction: {blind}')
            await self._write(recording, request.seconds, goal_handle)
        job = self._job = RefineTool(recording, output, '--model', self._files[joint], '--joint',
                                     joint, *('--unit', 'effort=A') * self._in_ampere)
        while not job.poll():
            if self._ended(goal_handle):
                job.cancel()
                raise InputError(self._ended(goal_handle))
            goal_handle.publish_feedback(RefineModel.Feedback(progress=job.share, step=job.step))
            end = time.monotonic() + 0.2
            while time.monotonic() < end and not self._stopped:
                # The executor does not sleep while a coroutine is pending.
                time.sleep(self.batch_time)
                await yield_to_executor()
        return job.report()

    def _ended(self, goal_handle: Any) -> str:
        return self._stopped or 'cancelled on request' * goal_handle.is_cancel_requested

    async def _write(self, path: Path, seconds: float, goal_handle: Any) -> None:
        """Write the messages of the last s, 0 for all, while others go on to arrive."""
        messages = sorted(self._past, key=lambda one: one.stamp)
        if not messages:
            raise InputError('no messages are kept')
        since = messages[-1].stamp - seconds * NANO if seconds > 0.0 else 0.0
        with RecordingWriter(path, {'recorded_by': 'friction_comp refinement'}) as writer:
            for number, message in enumerate(one for one in messages if one.stamp >= since):
                writer.write(message.topic, message.kind, message.stamp, message.cdr)
                if number % 500 == 0:
                    await yield_to_executor()
                    if why := self._ended(goal_handle):
                        raise InputError(why)

    async def _load(self, joint: str, result: RefineModel.Result) -> str:
        """Give the compensator the refined model if that may be; return what came of it."""
        for refused, why in (
                (result.verdict == 'record again', 'the data do not support it: record again'),
                (not result.error_after < result.error_before,
                 'it is not better than the initial model'),
                (FrictionModel.load(result.model_file, joint).drive
                 != self._residuals[joint].model.drive,
                 "it has another drive's torque constant, gear ratio or current limit"),
                (joint not in self._compensators,
                 f'no compensator of {joint} is running as {self._settings["compensator"]}')):
            if refused:
                return f'; not loaded: {why}'
        files = {**self._compensators, joint: result.model_file}
        future = self._set.call_async(SetParameters.Request(parameters=[
            Parameter('model_files', value=list(files.values())).to_parameter_msg()]))
        # Real s in which the compensator validates and takes a new model.
        end = time.monotonic() + 20.0
        while not future.done() and time.monotonic() < end:
            await yield_to_executor()
        answer = future.result().results[0] if future.done() else None
        if answer is None or not answer.successful:
            return f'; not loaded: {answer.reason if answer else "the compensator does not answer"}'
        result.loaded = True
        return '; loaded'

    def _report(self) -> tuple[Any, ...]:
        values = {'joint_states per second of real time': self._rate.per_second(),
                  'kept messages': len(self._past),
                  'last goal': self._goals.last, 'last refusal': self._goals.refused}
        misfits = []
        for joint, residual in self._residuals.items():
            verdict = residual.verdict()
            text = residual.blind or verdict.text
            values.update({f'{joint}: residual': text,
                           f'{joint}: error as a share of the friction': float(verdict.share),
                           f'{joint}: model file': self._files[joint]})
            if not verdict.fits and not residual.blind:
                misfits.append(f'{joint}: {text}: refine it')
        job = self._job
        return parts.first_of(
            values, (self._error, parts.ERROR, self._error),
            (misfits, parts.WARN, '; '.join(misfits)),
            (job, parts.OK, f'refines: {job.step if job else ""}'),
            (self._rate.count, parts.OK, 'watching'), (True, parts.WARN, 'no joint_states yet'))

    def leave(self) -> None:
        """End a running refinement."""
        self._stopped = 'the node was stopped'
