# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Feeds a joint's friction forward to its motor, in the direction announced by the exercise."""

from __future__ import annotations

from collections.abc import Sequence
import time
import traceback
from typing import Any

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Int8MultiArray
from std_srvs.srv import Trigger

from friction_comp.compensation.law import CompensationLaw, GRAVITY, LAWS
from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.nodes.compensation_loop import CompensationLoop
from friction_comp.nodes.diagnostics import Diagnostics, OK, per_joint, Rate, WARN
from friction_comp.nodes.faults import Faults
from friction_comp.nodes.joint_io import command_interface, CommandPort, input_qos, rivals
from friction_comp.nodes.joint_states import NANO, nanoseconds
from friction_comp.nodes.model_loading import (
    Loading,
    PatientParameterService,
    try_model,
    warm_up,
)
from friction_comp.nodes.node_main import run
from friction_comp.nodes.parameters import declare, declare_joints, LARGE, load_models, names_in

# Real s between checks for other commanders and for faults that have ended.
_LOOK = 0.1
# Why a compensator does not know its model's residual, without and with the law `none`.
_BLIND = (
    'not known here: the current follows the model itself, and the load of a person is not '
    'received; see node refinement where the load is measured',
    'not known here: no current is commanded, and the load is not received')


class CompensatorNode(LifecycleNode):
    """Publishes one current command per joint state while active; zero in case of doubt."""

    finished = False
    fast_timers = ()

    def __init__(self) -> None:
        super().__init__('compensator', start_parameter_services=False)
        self._parameter_services = PatientParameterService(self)
        self._state = 'unconfigured'
        self._loop: CompensationLoop | None = None
        self._loading: Loading | None = None
        self._candidates: list[FrictionModel] | None = None
        self._failure = ''
        self._rate = Rate()
        self._faults = Faults(self.get_logger())
        self._joints = declare_joints(self)
        self._qos = input_qos(self)
        self._declare()
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        self.create_service(Trigger, '~/reset_faults', self._on_reset)
        Diagnostics(self, self._report, ', '.join(self._joints), 'compensation')
        self.create_timer(_LOOK, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        if declare(self, 'autostart', True, 'configure and activate at start',
                   read_only=True):
            self._start()

    def _declare(self) -> None:
        declare(self, 'model_files', [],
                'model file of each joint; a new one is validated, then activated, while the node '
                'runs')
        declare(self, 'law', 'continuous',
                'continuous; paper: the note as printed; kinetic: its case without breakaway term; '
                'none: zero current', constraints=f'one of {", ".join(LAWS)}')
        declare(self, 'breakaway_gain', 0.9,
                'share of the mean breakaway current that is fed forward [1]', 0.0, 1.0)
        declare(self, 'gravity', 'feed_forward',
                "feed_forward, or left_to_robot: its own controller holds the limb's weight",
                read_only=True, constraints=f'one of {", ".join(GRAVITY)}')
        self._interface = command_interface(self)
        declare(self, 'current_limit', 1000.0,
                'largest current [A]; the limit of the model file applies if it is smaller; 0 '
                'blocks all current', 0.0, LARGE)
        declare(self, 'direction_timeout', 0.5,
                'age or silence after which the direction counts as 0 [s]', 0.001, 3600.0)
        self._timeout = round(NANO * declare(
            self, 'joint_state_timeout', 0.05,
            'age or silence of joint_states that leads to zero current; silence is measured in '
            'real time [s]', 0.001, 10.0, read_only=True))

    def _start(self) -> None:
        if self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
            raise InputError(self._failure or 'the node could not be configured')
        if self.trigger_activate() != TransitionCallbackReturn.SUCCESS:
            raise InputError(self._failure or 'the node could not be activated')

    # Parameters.

    def prepare(self, parameters: list[Any]) -> Loading | None:
        """Start loading the models that are about to be set."""
        for parameter in parameters:
            if parameter.name == 'model_files' and self._loop is not None and isinstance(
                    parameter.value, (list, tuple)):
                self._loading = Loading(names_in(parameter.value), self._load)
                return self._loading
        return None

    def _load(self, files: Sequence[str]) -> list[FrictionModel]:
        """Return validated models: checked, and run in a separate law."""
        models = load_models(files, self._joints, for_motor=True)
        for model, path in zip(models, files):
            try_model(model, self._value('gravity'), path)
        return models

    def _get_models(self, files: Sequence[str]) -> list[FrictionModel]:
        """Return the models of files; usually they are already loaded."""
        files, loading = tuple(names_in(files)), self._loading
        if loading is not None and loading.files == files:
            self._loading = None
            return loading.result()
        return self._load(files)

    def _check_parameters(self, parameters: list[Any]) -> SetParametersResult:
        """Refuse unusable values; the node continues with the present ones."""
        models = None
        for parameter in parameters:
            if parameter.name == 'law' and parameter.value not in LAWS:
                return self._refuse(
                    f'law must be one of {", ".join(LAWS)}, not {parameter.value!r}')
            if parameter.name == 'model_files' and self._loop is not None:
                try:
                    models = self._get_models(parameter.value)
                except InputError as error:
                    return self._refuse(str(error))
        self._candidates = models
        return SetParametersResult(successful=True)

    def _refuse(self, reason: str) -> SetParametersResult:
        self.get_logger().warning(f'parameter refused: {reason}')
        return SetParametersResult(successful=False, reason=reason)

    def _apply_parameters(self, parameters: list[Any]) -> None:
        names = {parameter.name for parameter in parameters}
        if self._loop is None:
            return
        if 'direction_timeout' in names:
            self._loop.direction.timeout = self._value('direction_timeout')
        if 'model_files' in names and self._candidates is not None:
            models, self._candidates = self._candidates, None
            for index, model in enumerate(models):
                self._loop.law.set_model(index, model)
            self._set_limits()
            self.get_logger().info(f'activated {", ".join(self._value("model_files"))}')
            self._warn_left_out()
        if names & {'law', 'breakaway_gain', 'current_limit'}:
            self._loop.law.retune(*self._tuning())
            self._set_limits()
            self._loop.changed()
            self.get_logger().info('{}, breakaway_gain {:g}, current_limit {:g} A'.format(
                *self._tuning()))

    def _value(self, name: str) -> Any:
        return self.get_parameter(name).value

    def _tuning(self) -> tuple[str, float, float]:
        return self._value('law'), self._value('breakaway_gain'), self._value('current_limit')

    def _set_limits(self) -> None:
        drives = [model.drive for model in self._loop.law.models]
        self._loop.port.limits = [min(drive.current_limit, self._value('current_limit'))
                                  for drive in drives]
        self._loop.port.torques = [drive.torque_per_current for drive in drives]

    def _warn_left_out(self) -> None:
        if self._value('law') == 'paper':
            self.get_logger().warning(
                "law: 'paper' is the note's, as printed, for comparison: it has no guards, and an "
                'over-estimate of friction drives the joint')
        for joint, model in zip(self._joints, self._loop.law.models):
            if model.joint not in ('', joint):
                self.get_logger().warning(f"{joint}: its model file is for joint '{model.joint}'")
        for index, effect, why in self._loop.law.never_applied:
            self.get_logger().warning(f'{self._joints[index]}: {effect} is not fed back: {why}')

    # Transitions.

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Load the models and connect the topics."""
        self._failure = ''
        try:
            self._configure()
        except InputError as error:
            self._failure = str(error)
            self.get_logger().error(self._failure)
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            # rclpy would hide it.
            self._failure = f'configuration failed: {error!r}'
            self.get_logger().error(traceback.format_exc())
            return TransitionCallbackReturn.FAILURE
        self._warn_left_out()
        self._set_state('inactive', 'configured')
        return super().on_configure(state)

    def _configure(self) -> None:
        if self._value('law') not in LAWS:
            raise InputError(
                f'parameter law: must be one of {", ".join(LAWS)}, not {self._value("law")!r}')
        models = self._load(names_in(self._value('model_files')))
        kind, gain, limit = self._tuning()
        law = CompensationLaw(models, kind, gain, limit, gravity=self._value('gravity'))
        warm_up(law, len(self._joints))
        simulated = self.get_parameter('use_sim_time').value
        self._loop = CompensationLoop(
            self._joints, law, CommandPort(self, [0.0] * len(models), [0.0] * len(models),
                                           self._interface), self._faults,
            self._timeout, self._value('direction_timeout'), rests=simulated)
        self._set_limits()
        self._loop.watchdog.start()
        # The direction comes first: the executor takes its messages before the states.
        self._inputs = [self.create_subscription(*which, self._qos) for which in (
            (Int8MultiArray, 'direction', self._on_direction),
            (JointState, 'direction_stamped', self._on_stamped_direction),
            (Temperature, 'motor_temperature', self._on_temperature),
            (JointState, 'joint_states', self._on_joint_states))]

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Start to answer joint states."""
        self._loop.activate(self._loop.port.others())
        self._loop.port.open()
        self._set_state('active', 'active: commands the motor')
        return super().on_activate(state)

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """Command zero current and stop publishing."""
        self._stop_commanding()
        self._set_state('inactive', 'inactive: zero current')
        return super().on_deactivate(state)

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        """Release topics and models."""
        self._disconnect()
        self._set_state('unconfigured', 'cleaned up')
        return super().on_cleanup(state)

    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:
        """Command zero current if the node was active, and release everything."""
        self._disconnect()
        self._set_state('finalized', 'shut down')
        return super().on_shutdown(state)

    def on_error(self, state: Any) -> TransitionCallbackReturn:
        """Command zero current; the node can be configured again."""
        self._disconnect()
        self._set_state('unconfigured', 'an error in a transition')
        return TransitionCallbackReturn.SUCCESS

    def _set_state(self, state: str, words: str) -> None:
        self._state = state
        self.get_logger().info(words)

    def _stop_commanding(self) -> None:
        if self._loop is not None:
            self._loop.leave()
            self._loop.port.close()

    def _disconnect(self) -> None:
        if self._loop is None:
            return
        self._stop_commanding()
        self._loop.watchdog.close()
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        self._loop = None

    def stop_motor(self) -> None:
        """Command zero current permanently; may be called from any thread."""
        loop = self._loop
        if loop is not None:
            loop.port.zero(permanent=True)

    def leave(self) -> None:
        """Command zero current, however the node ends."""
        self._disconnect()
        self._state = 'finalized'

    def _on_reset(self, request: Any, response: Any) -> Any:
        texts = [] if self._loop is None else self._loop.reset_faults()
        response.success = True
        response.message = '; '.join(texts) or 'nothing was latched'
        return response

    # Topics.

    def _on_direction(self, message: Any) -> None:
        self._loop.take_direction(message.data, self.get_clock().now().nanoseconds)

    def _on_stamped_direction(self, message: Any) -> None:
        self._loop.take_stamped_direction(
            message.name, message.velocity, nanoseconds(message.header.stamp),
            self.get_clock().now().nanoseconds)

    def _on_temperature(self, message: Any) -> None:
        self._loop.temperature.take(
            message.header.frame_id, message.temperature, nanoseconds(message.header.stamp))

    def _on_joint_states(self, message: Any, info: dict[str, Any]) -> None:
        self._rate.tick()
        if self._state != 'active':
            return
        # Equal to the node's clock without simulated time, at a third of the cost.
        simulated = self.get_clock().ros_time_is_active
        now = self.get_clock().now().nanoseconds if simulated else time.time_ns()
        if now == 0:
            # Simulated time before its first tick: the age of states is not known yet.
            self._faults.seen('clock', 'no /clock, although use_sim_time is set', WARN)
            return
        received = info['received_timestamp']
        self._loop.take(message, now, 0 if self._loop.rests else received,
                        info['source_timestamp'], info['publication_sequence_number'] or 0)

    def _look(self) -> None:
        if self._state == 'active':
            self._loop.states.publishers = rivals(self, 'joint_states')
            self._loop.direction.planners = rivals(self, 'direction', 'direction_stamped')
            self._loop.look_around(self._loop.port.others())
            silent = self._loop.direction.silent(self._loop.states.stamp)
            if silent:
                self._faults.seen(
                    'direction silent', f'the direction of {", ".join(silent)} was not renewed '
                    f'for {self._value("direction_timeout"):g} s and counts as 0', WARN)
        else:
            self._faults.look()

    # Diagnostics.

    def _report(self) -> tuple[Any, ...]:
        values = {'state': self._state, 'joint_states rate [Hz]': self._rate.per_second()}
        if self._loop is not None:
            values.update(self._values())
        fault = self._faults.worst
        if fault:
            return (*fault, values)
        if self._failure:
            return b'\x02', self._failure, values
        if self._state != 'active':
            return OK, self._state, values
        if not self._loop.states.stamp:
            return WARN, 'no joint_states yet', values
        return OK, ('compensating' if np.any(self._loop.direction.at(self._loop.states.stamp))
                    else 'compensating; no direction'), values

    def _values(self) -> dict[str, Any]:
        loop, joints = self._loop, self._joints
        stamp = loop.states.stamp
        values = {
            'law': self._value('law'), 'model_files': list(self._value('model_files')),
            **per_joint(joints, 'command [A]', loop.port.last)}
        for name, term in loop.law.terms.items():
            values.update(per_joint(joints, f'{name} [A]', term))
        for name, guarded in loop.law.guards.items():
            values.update(per_joint(joints, f'guard: {name}', guarded))
        values.update((f'{joint}: residual', _BLIND[values['law'] == 'none']) for joint in joints)
        values.update(per_joint(joints, 'direction', loop.direction.at(stamp)))
        values.update(per_joint(joints, 'direction age [s]', (
            loop.direction.age(index, stamp) for index in range(len(joints)))))
        values.update({
            'directions refused': loop.direction.refused,
            'joint_states passed over': loop.states.passed_over,
            'faults so far': self._faults.count,
            'listeners to the command': loop.port.listeners,
            'left_out': '; '.join(f'{joint}: {effect} ({why})' for joint, effect, why in [
                *((joints[j], *rest) for j, *rest in loop.law.never_applied),
                *self._missing_signals()])})
        return values

    def _missing_signals(self) -> list[tuple[str, str, str]]:
        """Return joint, effect and reason for what the last joint state could not feed back."""
        missing = []
        for index, effect, signals in self._loop.law.missing:
            reasons = [
                self._loop.temperature.why_unknown(index, self._loop.states.stamp)
                if signal == 'temperature' else
                f'the {signal} is not measured here: the torque sensor is for evaluation only'
                for signal in signals]
            missing.append((self._joints[index], effect, reasons or ['its value is not finite']))
        return [(joint, effect, ', '.join(reasons)) for joint, effect, reasons in missing]


def main(argv: list[str] | None = None) -> int:
    """Start the node and return its exit code."""
    return run('compensator', __doc__, CompensatorNode, argv)
