# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulates joints in real time, or in lockstep with the nodes that command them."""

from __future__ import annotations

from array import array
import time
from typing import Any

from geometry_msgs.msg import WrenchStamped
import numpy as np
from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Float64MultiArray, Header

from friction_comp.control.joint_states import JointColumns
from friction_comp.errors import InputError
from friction_comp.messages import NANO, nanoseconds, set_stamp
from friction_comp.ros.joint_io import command_unit, RELIABLE, UNASKED, UNIT_OF
from friction_comp.ros.node_parts import Diagnostics, load_models, OK, Rate, Settings, WARN
from friction_comp.ros.ros_start import steady_timer
from friction_comp.simulation.joint import Plant, ReferenceHold
from friction_comp.simulation.undeclared import Undeclared

# Real s between checks of a waiting plant in lockstep. It repeats its request at the second check
# without an answer: by then, everything that had arrived has been processed. And s between motor
# temperatures, which change slowly.
_CHECK_PERIOD = _TEMPERATURE_PERIOD = 0.1


class PlantNode(Node):
    """Simulated geared joints with their sensors and the person who moves them.

    In lockstep, the order of events within a sample does not depend on the machine's load: at a
    tick, publish `/clock` and wait for its `reference` (if requested); then publish `joint_states`,
    wait for one `current_command`, and step. Time starts when all `wait_for_listeners` are there,
    so that a recording contains the first state.
    """

    def __init__(self) -> None:
        super().__init__('plant')
        settings = self._settings = Settings(self, 'plant')
        self._joints = settings.joints
        models = load_models(settings['model_files'], self._joints)
        self._lockstep = settings['clock'] == 'lockstep'
        sample_time = settings['sample_time']
        self._clock_every, self._wrench_every, self._temperature_every = (
            max(1, round(period / sample_time)) for period in (
                settings['clock_period'], settings['wrench_period'], _TEMPERATURE_PERIOD))
        self._hold = ReferenceHold(settings['reference_timeout'])
        self._command_timeout = round(NANO * settings['command_timeout'])

        self._plant = self._make_plant(models)
        self._torque_per_current = np.array([m.drive.torque_per_current for m in models])
        self._sample = round(sample_time * NANO)
        self._samples = self._commanded_at = self._bad_commands = 0
        self._command = np.zeros(len(self._joints))
        self._columns, self._rate = JointColumns(self._joints), Rate()
        self._state_message = JointState(name=list(self._joints))
        self._wrench_messages, self._temperature_messages = (
            [kind(header=Header(frame_id=joint)) for joint in self._joints]
            for kind in (WrenchStamped, Temperature))
        self._states, self._wrench, self._temperature = (
            self.create_publisher(kind, topic, RELIABLE) for kind, topic in (
                (JointState, 'joint_states'), (WrenchStamped, 'interaction_wrench'),
                (Temperature, 'motor_temperature')))
        self.create_subscription(JointState, 'reference', self._on_reference, RELIABLE)
        interface = settings['command_interface']
        self._unit = UNIT_OF[interface]
        self._per_current = self._torque_per_current if interface == 'effort' else 1.0
        self.create_subscription(
            Float64MultiArray, 'current_command', self._on_command, RELIABLE)
        Diagnostics(self, self._report, self._joints, 'simulation')
        if self._lockstep:
            # In ROS, a stamp of zero means that there is none.
            self._origin = NANO
            self._ticks = self.create_publisher(ClockMessage, '/clock', RELIABLE)
            self._answered = self._published = self._nobody_holds = False
            self._reference_stamp: int | None = None
            self._ticked_sample, self._checks = -1, 0
            steady_timer(self, _CHECK_PERIOD, self._repeat_requests)
            self._advance()
        else:
            self._started, self._overruns = time.monotonic_ns(), 0
            self._origin = self.get_clock().now().nanoseconds
            steady_timer(self, sample_time, self._on_time)

    def _make_plant(self, models: Any) -> Plant:
        file, files = self._settings['arm_file'], self._settings['undeclared_effect_files']
        seed, sample_time = self._settings['seed'], self._settings['sample_time']
        if any(files) and len(files) != len(self._joints):
            raise InputError('parameter undeclared_effect_files: one per joint is needed (empty '
                             f'for none), not {len(files)}')
        undeclared = [Undeclared.from_file(path) if path else None
                      for path in files] if any(files) else None
        if not file:
            return Plant(models, seed, undeclared, sample_time)
        # Imported here: MuJoCo is optional.
        from friction_comp.simulation.mujoco_plant import MujocoPlant

        return MujocoPlant(file, self._joints, models, seed, undeclared, sample_time)

    @property
    def _stamp(self) -> Any:
        """Of the present state, ns."""
        return self._origin + self._samples * self._sample

    def _step(self) -> None:
        position, velocity = self._hold.at((self._stamp - self._origin) / NANO)
        active = None
        if position is not None and velocity is not None:
            active = np.isfinite(position) & np.isfinite(velocity)
        self._plant.step(self._command, position, velocity, active)
        self._samples += 1
        self._rate.count += 1

    def _publish(self) -> None:
        """Publish the sensor values: joint states last, since a command answers them."""
        state, stamp = self._plant.state, self._stamp
        if self._samples % self._wrench_every == 0:
            for wrench, torque in zip(self._wrench_messages, state.interaction_torque.tolist()):
                set_stamp(wrench.header.stamp, stamp)
                wrench.wrench.torque.z = torque
                self._wrench.publish(wrench)
        if self._samples % self._temperature_every == 0:
            for reading, value in zip(self._temperature_messages, state.temperature.tolist()):
                set_stamp(reading.header.stamp, stamp)
                reading.temperature = value
                self._temperature.publish(reading)
        message = self._state_message
        set_stamp(message.header.stamp, stamp)
        message.position = array('d', state.position.tobytes())
        message.velocity = array('d', state.velocity.tobytes())
        message.effort = array('d', (state.current * self._torque_per_current).tobytes())
        self._states.publish(message)

    def _take_command(self, message: Any) -> None:
        values = np.array(message.data)
        if (values.shape != self._command.shape or not np.isfinite(values).all()
                or command_unit(message) not in ('', self._unit)):
            self._bad_commands += 1
            values = np.zeros_like(self._command)
        self._command = values / self._per_current

    def _on_reference(self, message: Any) -> None:
        """Move the person as a message says; one without joints says that nobody holds them."""
        stamp = nanoseconds(message.header.stamp)
        position, velocity, _ = self._columns.read(message)
        if velocity is not None and message.name:
            self._hold.update((stamp - self._origin) / NANO, position, velocity)
        if self._lockstep:
            self._nobody_holds = not message.name
            self._reference_stamp = stamp
            self._advance()

    def _on_command(self, message: Any) -> None:
        if not self._lockstep:
            self._take_command(message)
            self._commanded_at = time.monotonic_ns()
            return
        # A label of digits is the stamp of the state that is answered.
        label = message.layout.dim[0].label if message.layout.dim else ''
        answers = label != UNASKED and (not label.isdecimal() or int(label) == self._stamp)
        if answers and self._published and not self._answered:
            self._take_command(message)
            self._answered = True
            self._advance()

    def _advance(self) -> None:
        """Publish states and step, again and again, until an input is missing."""
        while self._published or self._may_publish():
            if not self._published:
                self._published = True
                self._publish()
            if not self._answered:
                return
            self._answered = self._published = False
            self._checks = 0
            self._step()

    def _may_publish(self) -> bool:
        """Return whether the present states may be published; a tick that is due comes first."""
        if self._samples % self._clock_every == 0:
            if self._ticked_sample != self._samples:
                self._ticked_sample = self._samples
                self._tick()
            if self._reference_stamp != self._stamp and self._settings['wait_for_reference']:
                return False
        return bool(self._samples or self._states.get_subscription_count()
                    >= self._settings['wait_for_listeners'])

    def _tick(self) -> None:
        """Publish the present tick, possibly again."""
        message, since = ClockMessage(), self._samples % self._clock_every
        set_stamp(message.clock, self._stamp - since * self._sample)
        self._ticks.publish(message)

    def _repeat_requests(self) -> None:
        """Repeat requests without an answer, since discovery takes time."""
        self._advance()
        self._checks += 1
        if self._checks < 2:
            return
        self._checks = 0
        self._tick()
        if self._published and self._states.get_subscription_count():
            self._publish()
        elif self._samples and self._nobody_holds:
            # The exercise has not received the positions yet.
            self._states.publish(self._state_message)

    def _on_time(self) -> None:
        now = time.monotonic_ns()
        due = (now - self._started) // self._sample
        # More samples are not made up for: time is skipped.
        if (lost := due - self._samples) > 50:
            self._overruns += 1
            self._started += lost * self._sample
            self._origin += lost * self._sample
            due = self._samples
        if now - self._commanded_at > self._command_timeout:
            self._command = np.zeros_like(self._command)
        while self._samples < due:
            self._step()
            self._publish()

    def _report(self) -> Any:
        values = {
            'clock': 'lockstep' if self._lockstep else 'real_time',
            'time [s]': self._plant.state.time,
            'samples per second of real time': self._rate.per_second(),
            'command [A]': self._command,
            'commands not usable': self._bad_commands}
        if self._lockstep:
            waits = not self._samples and (
                self._states.get_subscription_count() < self._settings['wait_for_listeners'])
            values['waits for'] = ('current_command' if self._published else
                                   'listeners to joint_states' if waits else 'reference')
        else:
            values['overruns'] = self._overruns
        if self._bad_commands:
            return (WARN, 'commands of wrong length, of another unit or not finite were taken as '
                    'zero', values)
        return OK, 'running', values
