# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Law, command port and inputs of a compensator, from its configuration to its clean-up."""

from __future__ import annotations

from collections.abc import Sequence
import time
from typing import Any

import numpy as np
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Int8MultiArray

from friction_comp.compensation.law import CompensationLaw
from friction_comp.control.compensation_loop import CompensationLoop
from friction_comp.control.faults import Faults
from friction_comp.nodes.model_loading import Loaded, warm_up
from friction_comp.ros.diagnostics import OK, per_joint, Rate, WARN
from friction_comp.ros.joint_io import CommandPort, competing_publishers
from friction_comp.stamps import NANO, nanoseconds


class ConfiguredCompensator:
    """Law, command port and subscriptions of a compensator; exists only while it is configured.

    Joint states are answered while it is `active`.
    """

    def __init__(self, node: Any, joints: list[str], loaded: Sequence[Loaded], qos: Any,
                 faults: Faults, rate: Rate) -> None:
        self._node, self._joints, self._faults, self._rate = node, joints, faults, rate
        self._feeds = [one.feed for one in loaded]
        self._tell([f'{joint} {text}' for joint, one in zip(joints, loaded)
                    for text in one.told()])
        self.active = False
        law = CompensationLaw([one.model for one in loaded], *self._tuning(),
                              gravity=self._value('gravity'))
        warm_up(law)
        zeros = [0.0] * len(joints)
        self.port = CommandPort(node, zeros, zeros, self._value('command_interface'))
        self.loop = CompensationLoop(
            joints, law, self.port, faults, round(NANO * self._value('joint_state_timeout')),
            self._value('direction_timeout'), simulated=self._value('use_sim_time'))
        self._set_limits()
        self.loop.watchdog.start()
        # The direction comes first: the executor takes its messages before the states.
        self._inputs = [node.create_subscription(*topic, qos) for topic in (
            (Int8MultiArray, 'direction', self._on_direction),
            (JointState, 'direction_stamped', self._on_stamped_direction),
            (Temperature, 'motor_temperature', self._on_temperature),
            (JointState, 'joint_states', self._on_joint_states))]

    def _value(self, name: str) -> Any:
        return self._node.get_parameter(name).value

    def _tuning(self) -> tuple[str, float, float]:
        return self._value('law'), self._value('breakaway_gain'), self._value('current_limit')

    def _set_limits(self) -> None:
        drives = [model.drive for model in self.loop.law.models]
        self.port.limits = [min(drive.current_limit, self._value('current_limit'))
                                 for drive in drives]
        self.port.torques = [drive.torque_per_current for drive in drives]

    def activate(self) -> None:
        """Start to answer joint states."""
        self._find_publishers()
        self.loop.activate(self.port.others())
        self.port.open()
        self.active = True

    def deactivate(self) -> None:
        """Command zero current and stop publishing."""
        self.active = False
        self.loop.stop()
        self.port.close()

    def close(self) -> None:
        """Command zero current, and release topics and models."""
        self.deactivate()
        self.loop.watchdog.close()
        for subscription in self._inputs:
            self._node.destroy_subscription(subscription)

    # Parameters.

    def told(self, loaded: Sequence[Loaded]) -> list[str]:
        """Return what feeds forward otherwise with these models, as text."""
        return [f'{joint} {text}' for joint, one, before in zip(self._joints, loaded, self._feeds)
                for text in one.told(before)]

    def _tell(self, texts: list[str]) -> None:
        self._told = texts
        for text in texts:
            self._node.get_logger().warning(text)

    def apply(self, names: set[str], loaded: Sequence[Loaded] | None) -> None:
        """Apply parameters that have changed; `loaded` if `model_files` is one of them."""
        loop, logger = self.loop, self._node.get_logger()
        if 'direction_timeout' in names:
            loop.direction.timeout = self._value('direction_timeout')
        if loaded is not None:
            # Before they are used.
            self._tell(self.told(loaded))
            for index, one in enumerate(loaded):
                loop.law.set_model(index, one.model)
            self._feeds = [one.feed for one in loaded]
            self._set_limits()
            logger.info(f'activated {", ".join(self._value("model_files"))}')
            self.warn_left_out()
        if names & {'law', 'breakaway_gain', 'current_limit'}:
            loop.law.retune(*self._tuning())
            self._set_limits()
            loop.changed()
            logger.info('{}, breakaway_gain {:g}, current_limit {:g} A'.format(*self._tuning()))

    def warn_left_out(self) -> None:
        """Log what is unusual about the law and the models, and which effects are not fed back."""
        logger, law = self._node.get_logger(), self.loop.law
        if self._value('law') == 'desired':
            logger.warning(
                "law: 'desired' pushes in the announced direction however the joint moves: it is "
                'for joints that another controller moves along a reference')
        if self._value('law') == 'paper':
            logger.warning(
                "law: 'paper' is the note's, as printed, for comparison: it has no guards, and an "
                'over-estimate of friction drives the joint')
        for joint, model in zip(self._joints, law.models):
            if model.joint not in ('', joint):
                logger.warning(f"{joint}: its model file is for joint '{model.joint}'")
        for index, effect, why in law.never_applied:
            logger.warning(f'{self._joints[index]}: {effect} is not fed back: {why}')
        for joint, weight, limit in zip(self._joints, law.largest_weights, law.limits):
            if weight > limit:
                logger.warning(
                    f'{joint}: in some postures its weight takes up to {weight:.3g} A, more than '
                    f'the limit of {limit:.3g} A: it is not supported in full there')

    # Topics.

    def _on_direction(self, message: Any) -> None:
        self.loop.take_direction(message.data, self._node.get_clock().now().nanoseconds)

    def _on_stamped_direction(self, message: Any) -> None:
        self.loop.take_stamped_direction(
            message.name, message.velocity, nanoseconds(message.header.stamp),
            self._node.get_clock().now().nanoseconds, message.position)

    def _on_temperature(self, message: Any) -> None:
        self.loop.take_temperature(
            message.header.frame_id, message.temperature, nanoseconds(message.header.stamp),
            self._node.get_clock().now().nanoseconds)

    def _on_joint_states(self, message: Any, info: dict[str, Any]) -> None:
        self._rate.tick()
        if not self.active:
            return
        # Equal to the node's clock without simulated time, at a third of the cost.
        clock = self._node.get_clock()
        now = clock.now().nanoseconds if clock.ros_time_is_active else time.time_ns()
        if now == 0:
            # Simulated time before its first tick: the age of states is not known yet.
            self._faults.report('clock', 'no /clock, although use_sim_time is set', WARN)
            return
        received = info['received_timestamp']
        self.loop.take(message, now, 0 if self.loop.simulated else received,
                       info['source_timestamp'], info['publication_sequence_number'] or 0)

    def supervise(self) -> None:
        """Check for other publishers of states, directions and commands."""
        loop = self.loop
        self._find_publishers()
        loop.direction.planners = competing_publishers(self._node, 'direction', 'direction_stamped')
        loop.supervise(self.port.others())

    def _find_publishers(self) -> None:
        self.loop.states.publishers = competing_publishers(self._node, 'joint_states')

    # Diagnostics.

    def status(self) -> tuple[Any, str]:
        """Return level and message while active and without faults."""
        stamp = self.loop.states.stamp
        if not stamp:
            return WARN, 'no joint_states yet'
        if np.any(self.loop.direction.at(stamp)):
            return OK, 'compensating'
        return OK, 'compensating; no direction'

    def values(self) -> dict[str, Any]:
        """Return the values for diagnostics."""
        loop, joints = self.loop, self._joints
        stamp = loop.states.stamp
        values = {
            'law': self._value('law'), 'model_files': list(self._value('model_files')),
            **per_joint(joints, 'command [A]', self.port.last)}
        for name, term in loop.law.terms.items():
            values.update(per_joint(joints, f'{name} [A]', term))
        for name, guarded in loop.law.guards.items():
            values.update(per_joint(joints, f'guard: {name}', guarded))
        for place in ('rest', 'sliding'):
            values.update(per_joint(joints, f'fed forward, {place} [A]', (
                max(getattr(feed, place)) for feed in self._feeds)))
        values['fed forward otherwise'] = '; '.join(self._told)
        values.update(per_joint(joints, 'direction', loop.direction.at(stamp)))
        values.update(per_joint(joints, 'direction age [s]', (
            loop.direction.age(index, stamp) for index in range(len(joints)))))
        values.update({
            'directions refused': loop.direction.refused,
            'joint_states passed over': loop.states.passed_over,
            'faults so far': self._faults.count,
            'listeners to the command': self.port.listeners,
            'left_out': '; '.join(f'{joints[index]}: {effect} ({why})' for index, effect, why in [
                *loop.law.never_applied, *self._without_signals(), *loop.law.limited])})
        return values

    def _without_signals(self) -> list[tuple[int, str, str]]:
        """Return (joint index, effect, reason) of effects without a signal at the last state."""
        return [
            (index, effect, ', '.join(self._why_missing(index, signal) for signal in signals)
             or 'its value is not finite')
            for index, effect, signals in self.loop.law.missing]

    def _why_missing(self, index: int, signal: str) -> str:
        if signal == 'temperature':
            return self.loop.temperature.why_unknown(index, self.loop.states.stamp)
        return f'the {signal} is not measured here: the torque sensor is for evaluation only'
