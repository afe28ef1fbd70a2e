# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Feeds a joint's friction forward to its motor, in the direction that the exercise announces."""

from __future__ import annotations

import traceback

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Int8MultiArray

from friction_comp.compensation.law import CompensationLaw, GRAVITY, LAWS
from friction_comp.errors import InputError
from friction_comp.nodes.diagnostics import Diagnostics, ERROR, OK, Rate, WARN
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
from friction_comp.nodes.slow_inputs import Direction, MotorTemperature


class CompensatorNode(LifecycleNode):
    """One current command for every joint state, while active; zero whenever in doubt."""

    finished = False
    fast_timers = ()

    def __init__(self):
        super().__init__('compensator')
        self._active = False
        self._port = None
        self._law = None
        self._candidates = None
        self._fault = ''
        self._rate = Rate()
        self._joints = declare_joints(self)
        self._qos = input_qos(self)
        self._declare()
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        Diagnostics(self, self._report, ', '.join(self._joints))
        if declare(self, 'autostart', True, 'configure and activate without being asked',
                   read_only=True):
            self._start()

    def _declare(self):
        declare(self, 'model_files', [],
                'model file of each joint; a new one is taken over while the node runs')
        declare(self, 'law', 'continuous',
                'continuous; paper: the note as printed; kinetic: its case without breakaway term; '
                'none: zero current', constraints=f'one of {", ".join(LAWS)}')
        declare(self, 'breakaway_gain', 0.9,
                'share of the mean breakaway current that is fed forward [1]', 0.0, 1.0)
        declare(self, 'gravity', 'feed_forward',
                "feed_forward, or left_to_robot: its own controller holds the limb's weight",
                read_only=True, constraints=f'one of {", ".join(GRAVITY)}')
        declare(self, 'current_limit', 0.0,
                "largest current [A]; 0, or more than the model file's, leaves that one", 0.0)
        declare(self, 'direction_timeout', 0.5,
                'silence after which the direction counts as 0 [s]', 0.001, 3600.0)
        self._timeout = round(NANO * declare(
            self, 'joint_state_timeout', 0.05,
            'age or silence of joint_states that gives zero current [s]', 0.001, 10.0,
            read_only=True))

    def _start(self):
        if self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
            raise InputError(self._fault or 'the node could not be configured')
        if self.trigger_activate() != TransitionCallbackReturn.SUCCESS:
            raise InputError(self._fault or 'the node could not be activated')

    # Parameters.

    def _check_parameters(self, parameters):
        """Refuse what cannot be used; the node then goes on with what it has."""
        models = None
        for parameter in parameters:
            if parameter.name == 'law' and parameter.value not in LAWS:
                return SetParametersResult(
                    successful=False,
                    reason=f'law must be one of {", ".join(LAWS)}, not {parameter.value!r}')
            if parameter.name == 'model_files' and self._law is not None:
                try:
                    models = load_models(parameter.value, self._joints)
                except InputError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        self._candidates = models
        return SetParametersResult(successful=True)

    def _apply_parameters(self, parameters):
        names = {parameter.name for parameter in parameters}
        if self._law is None:
            return
        if 'direction_timeout' in names:
            self._direction.timeout = self._of('direction_timeout')
        if 'model_files' in names and self._candidates is not None:
            models, self._candidates = self._candidates, None
            for number, model in enumerate(models):
                self._law.set_model(number, model)
            self._say_left_out()
        if names & {'law', 'breakaway_gain', 'current_limit'}:
            self._law = self._make_law(self._law.models)

    def _of(self, name):
        return self.get_parameter(name).value

    def _make_law(self, models):
        return CompensationLaw(
            models, self._of('law'), self._of('breakaway_gain'), self._of('current_limit') or None,
            gravity=self._of('gravity'))

    def _say_left_out(self):
        for number, effect, why in self._law.never_applied:
            self.get_logger().warning(f'{self._joints[number]}: {effect} is not fed back: {why}')

    def _missing(self):
        """Return joint, effect and reason for what the last joint state could not feed back."""
        found = []
        for number, effect, signals in self._law.missing:
            reasons = [
                self._temperature.why_unknown(number, self._stamp) if signal == 'temperature' else
                f'the {signal} is not measured here: the torque sensor is for evaluation only'
                for signal in signals]
            found.append((self._joints[number], effect, reasons or ['its value is not finite']))
        return [(joint, effect, ', '.join(reasons)) for joint, effect, reasons in found]

    # Transitions.

    def on_configure(self, state):
        """Load the models and connect the topics."""
        self._fault = ''
        try:
            if self._of('law') not in LAWS:
                raise InputError(
                    f'parameter law: must be one of {", ".join(LAWS)}, not {self._of("law")!r}')
            self._law = self._make_law(load_models(self._of('model_files'), self._joints))
            self._warm_up()
        except InputError as error:
            self._fault = str(error)
            self.get_logger().error(self._fault)
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            # rclpy would swallow it.
            self._fault = f'configuration failed: {error!r}'
            self.get_logger().error(traceback.format_exc())
            return TransitionCallbackReturn.FAILURE
        self._say_left_out()
        size = len(self._joints)
        self._direction = Direction(size, self._of('direction_timeout'))
        self._temperature = MotorTemperature(self._joints)
        self._columns = JointColumns(self._joints)
        self._port = CommandPort(self, self._joints)
        self._forget()
        # The direction comes first: where both wait, the executor takes it before the states.
        self._inputs = [
            self.create_subscription(
                Int8MultiArray, 'direction', self._on_direction, self._qos),
            self.create_subscription(
                Temperature, 'motor_temperature', self._on_temperature, self._qos),
            self.create_subscription(
                JointState, 'joint_states', self._on_joint_states, self._qos)]
        # The node's clock, so that a simulation that rests starves nobody.
        self._watchdog = self.create_timer(self._timeout / 2 / NANO, self._watch)
        return super().on_configure(state)

    def _warm_up(self):
        """Have everything compiled before the first sample."""
        zeros = np.zeros(len(self._joints))
        self._law.update(0.0, zeros, zeros, zeros)
        self._law.update(0.0, zeros, None, zeros)
        self._law.reset()

    def _forget(self):
        self._stamp = 0
        self._first = None
        self._heard = None

    def on_activate(self, state):
        """Answer joint states from now on."""
        self._law.reset()
        self._direction.forget()
        self._temperature.forget()
        self._port.forget()
        self._forget()
        self._fault = ''
        self._active = True
        return super().on_activate(state)

    def on_deactivate(self, state):
        """Command zero current and fall silent."""
        self._rest()
        return super().on_deactivate(state)

    def on_cleanup(self, state):
        """Let go of topics and models."""
        self._disconnect()
        return super().on_cleanup(state)

    def on_shutdown(self, state):
        """Command zero current if the node was active, and let go of everything."""
        self._disconnect()
        return super().on_shutdown(state)

    def on_error(self, state):
        """Command zero current; the node can be configured anew."""
        self._disconnect()
        return TransitionCallbackReturn.SUCCESS

    def _rest(self):
        if self._active:
            self._active = False
            self._port.zero()

    def _disconnect(self):
        self._rest()
        if self._port is None:
            return
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        self.destroy_timer(self._watchdog)
        self._port.destroy()
        self._port = self._law = None

    def leave(self):
        """Command zero current, however the node ends."""
        if self._active:
            self._rest()
            self._port.wait()

    # Topics.

    def _on_direction(self, message):
        # The time of the states, not of arrival: a simulation's direction must not age while it
        # rests, and is to age alike in every run.
        self._direction.take(message.data, self._stamp or self.get_clock().now().nanoseconds)

    def _on_temperature(self, message):
        self._temperature.take(
            message.header.frame_id, message.temperature, nanoseconds(message.header.stamp))

    def _on_joint_states(self, message, info):
        self._rate.tick()
        now = self._heard = self.get_clock().now().nanoseconds
        if not self._active:
            return
        stamp = nanoseconds(message.header.stamp)
        fate = self._port.judge(stamp, info['source_timestamp'])
        if fate == AGAIN:
            self._port.repeat()
        if fate != NEW:
            return
        try:
            current = self._compensate(message, stamp or now, now)
        except Exception:
            self._port.answer(stamp, np.zeros(len(self._joints)))
            self.get_logger().error(f'deactivated by an error:\n{traceback.format_exc()}')
            self.trigger_deactivate()
            self._fault = 'deactivated by an error, see the log'
            return
        self._port.answer(stamp, current)

    def _compensate(self, message, stamp, now):
        """Return the currents for one message and set the fault that it shows, if any."""
        position, velocity, _ = self._columns.read(message)
        self._fault = self._fault_of(message, stamp, now, position, velocity)
        if now - stamp > self._timeout:
            self._law.reset()
            return np.zeros(len(self._joints))
        if stamp < self._stamp:
            # Time began anew: the history belongs to another run.
            self._law.reset()
            self._direction.forget()
            self._first = stamp
        self._stamp = stamp
        if self._first is None:
            self._first = stamp
        # From the first state: seconds since 1970 are too many for a float to hold their step.
        return self._law.update(
            (stamp - self._first) / NANO, position, velocity, self._direction.at(stamp),
            self._temperature.before(stamp))

    def _fault_of(self, message, stamp, now, position, velocity):
        if now - stamp > self._timeout:
            return (f'joint_states are {(now - stamp) / NANO:.3g} s old'
                    ' (clocks differ, or use_sim_time is not set alike?)')
        if self._columns.missing:
            return f'joint_states lack {", ".join(self._columns.missing)}'
        if not np.isfinite(position).all() or not (
                velocity is None or np.isfinite(velocity).all()):
            return 'joint_states hold values that are not finite, or too few'
        return ''

    def _watch(self):
        """Command zero current when joint states have fallen silent."""
        if not self._active or self._heard is None:
            return
        if self.get_clock().now().nanoseconds - self._heard > self._timeout:
            self._fault = 'no joint_states'
            self._law.reset()
            self._port.zero()

    # Diagnostics.

    def _report(self):
        values = {'state': self._state_machine_label(),
                  'joint_states per second of real time': self._rate.per_second()}
        if self._law is not None:
            direction = self._direction
            values.update({
                'law': self._of('law'), 'model_files': list(self._of('model_files')),
                'command [A]': [round(v, 6) for v in self._port.last],
                **{f'{name} [A]': np.round(term, 6).tolist()
                   for name, term in self._law.terms.items()},
                'direction': direction.at(self._stamp).tolist(),
                'directions refused': direction.refused,
                'listeners to current_command': self._port.listeners,
                'left_out': '; '.join(f'{joint}: {effect} ({why})' for joint, effect, why in [
                    *((self._joints[j], *rest) for j, *rest in self._law.never_applied),
                    *self._missing()])})
        if self._fault:
            return ERROR, self._fault, values
        if not self._active:
            return OK, values['state'], values
        if self._heard is None:
            return WARN, 'no joint_states yet', values
        if self._direction.refused:
            return WARN, 'directions of wrong length or value counted as 0', values
        return OK, 'compensating', values

    def _state_machine_label(self):
        if self._active:
            return 'active'
        return 'unconfigured' if self._law is None else 'inactive'


def main(argv=None):
    """Start the node and return its exit code."""
    return run('compensator', __doc__, CompensatorNode, argv)
