# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Feeds a joint's friction forward to its motor, in the direction announced by the exercise."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial, partialmethod
import time
import traceback
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Int8MultiArray
from std_srvs.srv import Trigger

from friction_comp.compensation.law import CompensationLaw
from friction_comp.control.compensation_loop import CompensationLoop
from friction_comp.control.faults import Faults
from friction_comp.control.model_trial import load_compiled_code, Loaded, try_model
from friction_comp.errors import InputError
from friction_comp.messages import NANO, nanoseconds
from friction_comp.model.motor_check import doubts, is_to_be_recorded_again, TORQUE
from friction_comp.ros import node_parts as parts
from friction_comp.ros.joint_io import CommandPort, competing_publishers, QOS
from friction_comp.ros.ros_start import steady_timer

STAMPED = 'direction_stamped'
# Real s between checks for other commanders and for faults that have ended.
_CHECK_PERIOD = 0.1
# What changes what a law commands: diagnostics show it where it is not the default, so that a
# recording says under which settings its movements were made.
_TUNING = [one for one in parts.described('compensator')
           if one.name in ('breakaway_gain', 'gravity', 'current_limit')]


class ConfiguredCompensator(CompensationLoop):
    """A loop with its topics, while it is configured; it answers while it is `active`."""

    def __init__(self, node: Any, settings: parts.Settings, loaded: Sequence[Loaded],
                 faults: Faults) -> None:
        self._node, self._settings = node, settings
        self._joints, self._rate = settings.joints, parts.Rate()
        self._feeds: list[Any] = [None] * len(self._joints)
        self._tell(loaded)
        self.active = False
        law = CompensationLaw([one.model for one in loaded], *self._tuning(),
                              gravity=settings['gravity'])
        zeros, simulated = [0.0] * len(self._joints), settings['use_sim_time']
        self._commands = CommandPort(node, zeros, zeros, settings['command_interface'])
        # Equal to the node's clock without simulated time, at a third of the cost.
        now = (lambda: node.get_clock().now().nanoseconds) if simulated else time.time_ns
        super().__init__(
            self._joints, law, self._commands, faults,
            round(NANO * settings['joint_state_timeout']), settings['direction_timeout'],
            simulated, now=now)
        self.inputs.watchdog.start()
        waits = simulated and settings['wait_for_direction']
        # The direction comes first: the executor takes its messages before the states.
        self._subscriptions = [node.create_subscription(*topic, QOS[settings['input_reliability']])
                               for topic in (
            (Int8MultiArray, 'direction', self._on_direction),
            (JointState, STAMPED, self._on_stamped_direction),
            (Temperature, 'motor_temperature', self._on_temperature),
            (JointState, 'joint_states', self._hear_in_step if waits else self.hear))]
        self._warn_unusual()

    def _hear_in_step(self, message: Any, info: dict[str, Any]) -> None:
        """Answer a joint state, or wait for its direction: a plant in lockstep repeats it."""
        if not (self.inputs.directions.outlived(self._now())
                and self._node.count_publishers(self._node.resolve_topic_name(STAMPED))):
            self.hear(message, info)

    def _tuning(self) -> tuple[str, float, float]:
        return (self._settings['law'], self._settings['breakaway_gain'],
                self._settings['current_limit'])

    def open(self) -> None:
        """Start to answer joint states."""
        self._find_publishers()
        self.activate(self._commands.others())
        self._commands.open()
        self.active = True

    def deactivate(self) -> None:
        """Command zero current and stop publishing."""
        self.active = False
        self.stop()
        self._commands.close()

    def close(self) -> None:
        """Command zero current, and release topics and models."""
        self.deactivate()
        self.inputs.watchdog.close()
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def stop_motor(self) -> None:
        """Command zero current for good; may be called from any thread."""
        self._commands.zero(permanent=True)

    def told(self, loaded: Sequence[Loaded]) -> list[str]:
        """Return what these models' files say against them, and what feeds forward otherwise."""
        return [f'{joint} {text}' for joint, one, before in zip(self._joints, loaded, self._feeds)
                for text in one.told(before)]

    def _tell(self, loaded: Sequence[Loaded]) -> None:
        self._told, self._feeds = self.told(loaded), [one.feed for one in loaded]
        self._doubts = [f'{joint}: {text}' for joint, one in zip(self._joints, loaded)
                        for text in doubts(one.model)]
        for text in self._told:
            self._node.get_logger().warning(text)

    def apply(self, names: set[str], loaded: Sequence[Loaded] | None) -> None:
        """Apply parameters that have changed; `loaded` if `model_files` is one of them."""
        logger = self._node.get_logger()
        if 'direction_timeout' in names:
            self.inputs.directions.timeout = self._settings['direction_timeout']
        if loaded is not None:
            # Before they are used.
            self._tell(loaded)
            self.set_models([one.model for one in loaded])
            logger.info(f'activated {", ".join(self._settings["model_files"])}')
            self._warn_unusual()
        if names & {'law', 'breakaway_gain', 'current_limit'}:
            self.retune(*self._tuning())
            logger.info("{}, breakaway_gain {:g}, at most {:g} A or the drive's limit".format(
                *self._tuning()))

    def _warn_unusual(self) -> None:
        logger = self._node.get_logger()
        for text in self.unusual():
            logger.warning(text)
        # Most models have some: a reason to know, none to look after.
        for text in self.left_out():
            logger.info(text)

    def _on_direction(self, message: Any) -> None:
        self.inputs.take_direction(message.data, self._now())

    def _on_stamped_direction(self, message: Any) -> None:
        self.inputs.take_stamped_direction(
            message.name, message.velocity, nanoseconds(message.header.stamp), self._now(),
            message.position, message.effort)

    def _on_temperature(self, message: Any) -> None:
        self.inputs.take_temperature(message.header.frame_id, message.temperature,
                                     nanoseconds(message.header.stamp), self._now())

    def check(self) -> None:
        """Check for other publishers of states, directions and commands."""
        self._find_publishers()
        self.supervise(self._commands.others())

    def _find_publishers(self) -> None:
        self.inputs.set_sources(
            competing_publishers(self._node, 'joint_states'),
            competing_publishers(self._node, 'direction', STAMPED))

    def status(self) -> tuple[bool, str]:
        """Return whether all is well, and a message, while no fault is present."""
        well, text = super().status()
        return well and not self._doubts, '; '.join((text, *self._doubts))

    def values(self) -> dict[str, Any]:
        """Return the values for diagnostics."""
        self._rate.count = self.heard
        return {
            'joint_states rate [Hz]': self._rate.per_second(),
            'law': self._settings['law'],
            'settings': ', '.join(f'{one.name} {value}' for one in _TUNING
                                  if (value := self._settings[one.name]) != one.default),
            'said of the models': '; '.join(self._told),
            'listeners to the command': self._commands.listeners,
            **super().values()}


class CompensatorNode(LifecycleNode):
    """Publishes one current command per joint state while active; zero in case of doubt."""

    def __init__(self) -> None:
        super().__init__('compensator')
        # Before anything can ask the node to drive: it would stop the process for a moment.
        load_compiled_code()
        self._state = 'unconfigured'
        self._ending = False    # the motor is not driven any more
        self._configured: ConfiguredCompensator | None = None
        # Models of the request whose parameters are being set.
        self._candidates: list[Loaded] | None = None
        self._failure = ''
        self._faults = Faults(self.get_logger())
        self._settings = parts.Settings(self, 'compensator')
        self.add_on_set_parameters_callback(self._load_candidates)
        self.add_post_set_parameters_callback(self._apply_parameters)
        self.create_service(Trigger, '~/reset_faults', self._on_reset)
        self._diagnostics = parts.Diagnostics(
            self, self._report, self._settings.joints, 'compensation')
        steady_timer(self, _CHECK_PERIOD, self._check)
        for trigger in ((self.trigger_configure, self.trigger_activate)
                        if self._settings['autostart'] else ()):
            if trigger() != TransitionCallbackReturn.SUCCESS:
                raise InputError(
                    self._failure or 'the node could not be configured and activated')

    def _load(self, files: Sequence[str], accepts: bool) -> list[Loaded]:
        """Return validated models: checked, and run in a separate law.

        Those that refine wants to be recorded again only if `accepts` says so.
        """
        loaded, joints = [], self._settings.joints
        for model, path in zip(parts.load_models(files, joints, for_motor=True), files):
            if (model.notes.get('unit') == TORQUE
                    and self._settings['command_interface'] == 'current'):
                raise InputError(
                    f'{path}: its figures are in N·m, the commands in A: set command_interface to '
                    'effort, or refine it with --torque-constant and --gear-ratio')
            if is_to_be_recorded_again(model) and not accepts:
                raise InputError(f'{path}: {"; ".join(doubts(model))}. Set accept_record_again to '
                                 'drive the motor with it all the same')
            loaded.append(try_model(model, self._settings['gravity'], path))
        return loaded

    def _load_candidates(self, parameters: list[Any]) -> SetParametersResult:
        """Load the models that are about to be set, while the present ones go on."""
        given = {parameter.name: parameter.value for parameter in parameters}
        self._candidates, told = None, []
        try:
            if self._configured is not None and 'model_files' in given:
                files = parts.names_in(given['model_files'] or ())
                accepts = given.get('accept_record_again', self._settings['accept_record_again'])
                self._candidates = self.executor.do_beside(
                    partial(self._load, files, accepts), ', '.join(files))
                told = self._configured.told(self._candidates)
        except InputError as error:
            self.get_logger().warning(f'parameter refused: {error}')
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True, reason='; '.join(told))

    def _apply_parameters(self, parameters: list[Any]) -> None:
        models, self._candidates = self._candidates, None
        if self._configured is not None:
            self._configured.apply({parameter.name for parameter in parameters}, models)
            self._diagnostics.publish()

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Load the models and connect the topics."""
        self._failure = ''
        if self._ending:
            return TransitionCallbackReturn.FAILURE
        try:
            models = self._load(parts.names_in(self._settings['model_files']),
                                self._settings['accept_record_again'])
            self._configured = ConfiguredCompensator(self, self._settings, models, self._faults)
        except Exception as error:
            # rclpy would hide it.
            expected = isinstance(error, InputError)
            self._failure = str(error) if expected else f'configuration failed: {error!r}'
            self.get_logger().error(self._failure if expected else traceback.format_exc())
            return TransitionCallbackReturn.FAILURE
        self._set_state('inactive', 'configured')
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Start to answer joint states."""
        if self._configured is None or self._ending:
            return TransitionCallbackReturn.FAILURE
        self._configured.open()
        self._set_state('active', 'active: commands ' + (
            'nothing while another node may command the motor' if self._configured.yields
            else 'the motor'))
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """Command zero current and stop publishing."""
        if self._configured is not None:
            self._configured.deactivate()
        self._set_state('inactive', 'inactive: zero current')
        return TransitionCallbackReturn.SUCCESS

    def _release(self, reached: str, text: str, _: Any) -> TransitionCallbackReturn:
        """Command zero current if the node was active, and release topics and models."""
        self._disconnect()
        self._set_state(reached, text)
        return TransitionCallbackReturn.SUCCESS

    on_cleanup = partialmethod(_release, 'unconfigured', 'cleaned up')
    on_shutdown = partialmethod(_release, 'finalized', 'shut down')
    on_error = partialmethod(_release, 'unconfigured', 'an error in a transition')

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
        """Command zero current for good; may be called from any thread."""
        # First, since the main thread may activate the node meanwhile.
        self._ending = True
        if (configured := self._configured) is not None:
            configured.stop_motor()

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
        values = {'state': self._state, 'joint_states rate [Hz]': 0.0,
                  'model_files': str(list(self._settings['model_files']))}
        if configured is not None:
            values.update(configured.values())
        if self._faults.worst:
            return (*self._faults.worst, values)
        if self._failure:
            return parts.ERROR, self._failure, values
        well, text = (configured.status() if configured is not None and configured.active
                      else (True, self._state))
        return parts.OK if well else parts.WARN, text, values
