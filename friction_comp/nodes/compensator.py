# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Feeds a joint's friction forward to its motor, in the direction announced by the exercise."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
import traceback
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from std_srvs.srv import Trigger

from friction_comp.compensation.law import GRAVITY, LAWS
from friction_comp.control.faults import Faults
from friction_comp.control.model_trial import load_compiled_code, Loaded, try_model
from friction_comp.errors import InputError
from friction_comp.model.motor_check import doubts, is_to_be_recorded_again, TORQUE, unit_of
from friction_comp.nodes.configured_compensator import ConfiguredCompensator, SETTINGS
from friction_comp.ros.diagnostics import Diagnostics, ERROR, OK, WARN
from friction_comp.ros.joint_io import command_interface, input_qos
from friction_comp.ros.model_loading import Loading, PatientParameterService
from friction_comp.ros.parameters import (
    declare,
    declare_choice,
    declare_joints,
    LARGE,
    load_models,
    names_in,
)
from friction_comp.ros.ros_start import steady_timer

# Real s between checks for other commanders and for faults that have ended.
_CHECK_PERIOD = 0.1


class CompensatorNode(LifecycleNode):
    """Publishes one current command per joint state while active; zero in case of doubt."""

    def __init__(self) -> None:
        super().__init__('compensator', start_parameter_services=False)
        # Before anything can ask the node to drive: it would stop the process for a moment.
        load_compiled_code()
        self._parameter_services = PatientParameterService(self)
        self._state = 'unconfigured'
        self._ending = False    # the motor is not driven any more
        self._configured: ConfiguredCompensator | None = None
        # Models of the request whose parameters are being set.
        self.loaded: Loading | None = None
        self._candidates: list[Loaded] | None = None
        self._failure = ''
        self._faults = Faults(self.get_logger())
        self._joints = declare_joints(self)
        self._qos = input_qos(self)
        self._declare()
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        self.create_service(Trigger, '~/reset_faults', self._on_reset)
        self._diagnostics = Diagnostics(self, self._report, self._joints, 'compensation')
        steady_timer(self, _CHECK_PERIOD, self._check)
        if declare(self, 'autostart', True, 'configure and activate at start'):
            self._start()

    def _declare(self) -> None:
        declare(self, 'model_files', [],
                'model file of each joint; a new one is validated, then activated, while the node '
                'runs', changes=True)
        declare(self, 'accept_record_again', False,
                'also take models of which refine says `record again`', changes=True)
        declare(self, 'law', 'continuous',
                'continuous; desired: friction of the reference of another controller, which moves '
                'the joint; paper: the note as printed; kinetic: its case without breakaway term, '
                'which leaves no friction: a joint that is let go runs on; none: zero current',
                changes=True,
                constraints=f'one of {", ".join(LAWS)}')
        declare(self, 'breakaway_gain', SETTINGS['breakaway_gain'],
                'share of the mean breakaway current that is fed forward [1]', 0.0, 1.0,
                changes=True)
        declare_choice(self, 'gravity', GRAVITY, 'feed_forward, or left_to_robot: its own '
                       "controller holds the limb's weight")
        command_interface(self)
        declare(self, 'current_limit', SETTINGS['current_limit'],
                'largest current [A]; the limit of the model file applies if it is smaller; 0 '
                'blocks all current', 0.0, LARGE, changes=True)
        declare(self, 'direction_timeout', 0.5,
                'age or silence after which the direction counts as 0 [s]', 0.001, 3600.0,
                changes=True)
        declare(self, 'wait_for_direction', False,
                'in simulated time, answer a joint state only when the direction_stamped of its '
                'tick has come, from the first one on: the middleware may lose one and repeat it')
        declare(self, 'joint_state_timeout', 0.05,
                'age or silence of joint_states that leads to zero current; silence is measured in '
                'real time [s]', 0.001, 10.0)

    def _start(self) -> None:
        for trigger in (self.trigger_configure, self.trigger_activate):
            if trigger() != TransitionCallbackReturn.SUCCESS:
                raise InputError(self._failure or 'the node could not be configured and activated')

    def prepare(self, parameters: list[Any]) -> Loading | None:
        """Start loading the models that are about to be set."""
        given = {parameter.name: parameter.value for parameter in parameters}
        files, accepts = given.get('model_files'), given.get('accept_record_again')
        if self._configured is None or not isinstance(files, (list, tuple)):
            return None
        return Loading(names_in(files), partial(self._load, accepts=accepts))

    def _load(self, files: Sequence[str], accepts: bool | None = None) -> list[Loaded]:
        """Return validated models: checked, and run in a separate law.

        `accepts` is what `accept_record_again` will be, by default what it is.
        """
        accepts = self._value('accept_record_again') if accepts is None else accepts
        loaded = []
        for model, path in zip(load_models(files, self._joints, for_motor=True), files):
            if unit_of(model) == TORQUE and self._value('command_interface') == 'current':
                raise InputError(
                    f'{path}: its figures are in N·m, the commands in A: set command_interface to '
                    'effort, or refine it with --torque-constant and --gear-ratio')
            if is_to_be_recorded_again(model) and not accepts:
                raise InputError(f'{path}: {"; ".join(doubts(model))}. Set accept_record_again to '
                                 'drive the motor with it all the same')
            loaded.append(try_model(model, self._value('gravity'), path))
        return loaded

    def _check_parameters(self, parameters: list[Any]) -> SetParametersResult:
        """Refuse unusable values; the node continues with the present ones."""
        models = None
        try:
            for parameter in parameters:
                if parameter.name == 'law':
                    _check_law(parameter.value)
                if parameter.name == 'model_files' and self.loaded is not None:
                    models = self.loaded.result()
        except InputError as error:
            self.get_logger().warning(f'parameter refused: {error}')
            return SetParametersResult(successful=False, reason=str(error))
        self._candidates = models
        told = [] if models is None or self._configured is None else self._configured.told(models)
        return SetParametersResult(successful=True, reason='; '.join(told))

    def _apply_parameters(self, parameters: list[Any]) -> None:
        models, self._candidates = self._candidates, None
        if self._configured is not None:
            self._configured.apply({parameter.name for parameter in parameters}, models)
            self._diagnostics.publish()

    def _value(self, name: str) -> Any:
        return self.get_parameter(name).value

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Load the models and connect the topics."""
        self._failure = ''
        if self._ending:
            return TransitionCallbackReturn.FAILURE
        try:
            _check_law(self._value('law'))
            self._configured = ConfiguredCompensator(
                self, self._joints, self._load(names_in(self._value('model_files'))), self._qos,
                self._faults)
        except InputError as error:
            self._failure = str(error)
            self.get_logger().error(self._failure)
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            # rclpy would hide it.
            self._failure = f'configuration failed: {error!r}'
            self.get_logger().error(traceback.format_exc())
            return TransitionCallbackReturn.FAILURE
        self._configured.warn_unusual()
        self._set_state('inactive', 'configured')
        return super().on_configure(state)

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Start to answer joint states."""
        if self._configured is None or self._ending:
            return TransitionCallbackReturn.FAILURE
        self._configured.open()
        self._set_state('active', 'active: commands ' + (
            'nothing while another node may command the motor' if self._configured.yields
            else 'the motor'))
        return super().on_activate(state)

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """Command zero current and stop publishing."""
        if self._configured is not None:
            self._configured.deactivate()
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

    def _set_state(self, state: str, text: str) -> None:
        self._state = state
        self.get_logger().info(text)
        self._diagnostics.publish()

    def _disconnect(self) -> None:
        if self._configured is not None:
            # Until the end, a signal must still find the motor to stop.
            self._configured.close()
            self._configured = None

    def stop_motor(self) -> None:
        """Command zero current until `resume`; may be called from any thread."""
        # First, since the main thread may activate the node meanwhile.
        self._ending = True
        if (configured := self._configured) is not None:
            configured.stop_motor()

    def resume(self, seconds: float) -> None:
        """Begin anew after the process was stopped for some s."""
        self._ending = False
        self.get_logger().warning(f'was stopped for {seconds:.3g} s and begins anew')
        if self._configured is not None:
            self._configured.resume(seconds)

    def leave(self) -> None:
        """Command zero current, however the node ends."""
        self._ending = True
        self._disconnect()
        self._state = 'finalized'

    def _on_reset(self, _: Any, response: Any) -> Any:
        texts = [] if self._configured is None else self._configured.reset_faults()
        response.success = True
        response.message = '; '.join(texts) or 'nothing was latched'
        return response

    def _check(self) -> None:
        if self._configured is not None and self._configured.active:
            self._configured.check()
        else:
            self._faults.expire()

    def _report(self) -> tuple[Any, ...]:
        configured = self._configured
        values = {'state': self._state, 'joint_states rate [Hz]': 0.0}
        if configured is not None:
            values.update(configured.values())
        fault = self._faults.worst
        if fault:
            return (*fault, values)
        if self._failure:
            return ERROR, self._failure, values
        if configured is None or not configured.active:
            return OK, self._state, values
        well, text = configured.status()
        return OK if well else WARN, text, values


def _check_law(law: Any) -> None:
    if law not in LAWS:
        raise InputError(f'parameter law: must be one of {", ".join(LAWS)}, not {law!r}')
