# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A compensator from its configuration to its clean-up: its topics, and what is behind them."""

from __future__ import annotations

from collections.abc import Sequence
import time
from typing import Any

from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Int8MultiArray

from friction_comp.compensation.law import CompensationLaw, GRAVITY
from friction_comp.control.compensation_loop import CompensationLoop
from friction_comp.control.faults import Faults
from friction_comp.control.model_trial import Loaded
from friction_comp.model.motor_check import doubts
from friction_comp.ros.diagnostics import Rate
from friction_comp.ros.joint_io import CommandPort, competing_publishers
from friction_comp.stamps import NANO, nanoseconds

STAMPED = 'direction_stamped'
SETTINGS: dict[str, Any] = {
    'breakaway_gain': 0.9, 'gravity': GRAVITY[0], 'current_limit': 1000.0}
"""The parameters that change what a law commands, with their defaults."""
_UNUSUAL_LAWS = {
    'desired': ("law: 'desired' pushes in the announced direction however the joint moves: it is "
                'for joints that another controller moves along a reference',),
    'paper': ("law: 'paper' is the note's, as printed, for comparison: it has no guards, and an "
              'over-estimate of friction drives the joint',)}


class ConfiguredCompensator(CompensationLoop):
    """A loop with its topics, while it is configured; it answers while it is `active`."""

    def __init__(self, node: Any, joints: list[str], loaded: Sequence[Loaded], qos: Any,
                 faults: Faults) -> None:
        self._node, self._joints, self._rate = node, joints, Rate()
        self._feeds: list[Any] = [None] * len(joints)
        self._tell(loaded)
        self.active = False
        law = CompensationLaw([one.model for one in loaded], *self._tuning(),
                              gravity=self._value('gravity'))
        zeros, simulated = [0.0] * len(joints), self._value('use_sim_time')
        self._commands = CommandPort(node, zeros, zeros, self._value('command_interface'))
        # Equal to the node's clock without simulated time, at a third of the cost.
        waits = simulated and self._value('wait_for_direction')
        now = (lambda: node.get_clock().now().nanoseconds) if simulated else time.time_ns
        super().__init__(
            joints, law, self._commands, faults, round(NANO * self._value('joint_state_timeout')),
            self._value('direction_timeout'), simulated, now=now)
        self.inputs.watchdog.start()
        # The direction comes first: the executor takes its messages before the states.
        self._subscriptions = [node.create_subscription(*topic, qos) for topic in (
            (Int8MultiArray, 'direction', self._on_direction),
            (JointState, STAMPED, self._on_stamped_direction),
            (Temperature, 'motor_temperature', self._on_temperature),
            (JointState, 'joint_states', self._hear_in_step if waits else self.hear))]

    def _hear_in_step(self, message: Any, info: dict[str, Any]) -> None:
        """Answer a joint state, or wait for its direction: a plant in lockstep repeats it."""
        if not (self.inputs.directions.outlived(self._now())
                and self._node.count_publishers(self._node.resolve_topic_name(STAMPED))):
            self.hear(message, info)

    def _value(self, name: str) -> Any:
        return self._node.get_parameter(name).value

    def _tuning(self) -> tuple[str, float, float]:
        return self._value('law'), self._value('breakaway_gain'), self._value('current_limit')

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
        """Command zero current until `resume`; may be called from any thread."""
        self._commands.zero(permanent=True)

    def resume(self, seconds: float) -> None:
        """Begin anew after the process was stopped for some s."""
        super().resume(seconds)
        self._commands.release()

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
            self.inputs.directions.timeout = self._value('direction_timeout')
        if loaded is not None:
            # Before they are used.
            self._tell(loaded)
            self.set_models([one.model for one in loaded])
            logger.info(f'activated {", ".join(self._value("model_files"))}')
            self.warn_unusual()
        if names & {'law', 'breakaway_gain', 'current_limit'}:
            self.retune(*self._tuning())
            logger.info('{}, breakaway_gain {:g}, current_limit {:g} A'.format(*self._tuning()))

    def warn_unusual(self) -> None:
        """Log what is unusual about the law and the models, and which effects are not fed back."""
        logger = self._node.get_logger()
        for text in (*_UNUSUAL_LAWS.get(self._value('law'), ()), *self.unusual()):
            logger.warning(text)
        # Most models have some: a reason to know, none to look after.
        for text in self.left_out():
            logger.info(text)

    def status(self) -> tuple[bool, str]:
        """Return whether all is well, and a message, while no fault is present."""
        well, text = super().status()
        return well and not self._doubts, '; '.join((text, *self._doubts))

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

    def values(self) -> dict[str, Any]:
        """Return the values for diagnostics."""
        self._rate.count = self.heard
        return {
            'joint_states rate [Hz]': self._rate.per_second(),
            'law': self._value('law'), 'model_files': str(list(self._value('model_files'))),
            'settings': ', '.join(f'{name} {value}' for name, default in SETTINGS.items()
                                  if (value := self._value(name)) != default),
            'said of the models': '; '.join(self._told),
            'listeners to the command': self._commands.listeners,
            **{f'fed forward, {place} [A]': [max(getattr(feed, place)) for feed in self._feeds]
               for place in ('rest', 'sliding')}, **super().values()}
