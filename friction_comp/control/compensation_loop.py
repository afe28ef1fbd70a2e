# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Answers each joint state with the law's currents, or with zero in case of doubt.

A joint state goes through inputs, law and port, in this order, and through each once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
import time
import traceback
from typing import Any

import numpy as np

from friction_comp.control import joint_states
from friction_comp.control.faults import Faults, WARN
from friction_comp.control.inputs import Inputs
from friction_comp.control.port import NEGLIGIBLE, Port
from friction_comp.model.friction_model import FrictionModel

# Real s without another commander after which a new one is a latched fault.
ALONE = 3.0


class CompensationLoop:
    """Answers joint states with currents.

    Age or silence of joint states beyond `timeout` (ns) leads to zero current; `direction_timeout`
    is in s. If `now`, the node's clock in ns, is `simulated`, time may stop: silence then does not
    mean that the driver is gone. Messages but joint states go to its `inputs`.
    """

    def __init__(self, joints: Sequence[str], law: Any, port: Port, faults: Faults,
                 timeout: int, direction_timeout: float, simulated: bool = False,
                 clock: Callable[[], float] = time.monotonic,
                 now: Callable[[], int] = time.time_ns) -> None:
        self._joints, self._law, self._port, self._faults = list(joints), law, port, faults
        self._simulated, self._clock, self._now = simulated, clock, now
        self.heard = 0    # joint states so far
        self.inputs = Inputs(joints, timeout, direction_timeout, faults, port.zero, clock)
        self._zeros = np.zeros(len(joints))
        self._set_limits()
        self.activate()

    def activate(self, others: Sequence[str] = ()) -> None:
        """Start without history and faults; `others` are nodes that may command already."""
        self.inputs.forget(
            [model.drive.position_resolution or 0.0 for model in self._law.models])
        self._law.reset()
        self._faults.clear()
        self._computed = self._zeros
        self._alone_since: float | None = None
        self.yields = False
        if others:
            self.supervise(others)

    def stop(self) -> None:
        """Command zero current and stop watching."""
        self.inputs.watchdog.rest()
        self._port.zero()

    def retune(self, law: str, breakaway_gain: float, current_limit: float) -> None:
        """Change the options of the law, which itself changes its current gradually."""
        self._law.retune(law, breakaway_gain, current_limit)
        self._set_limits()

    def set_models(self, models: Iterable[FrictionModel]) -> None:
        """Exchange the models of all joints."""
        for joint, model in enumerate(models):
            self._law.set_model(joint, model)
        self._set_limits()

    def _set_limits(self) -> None:
        self._port.set_limits(self._law.parameters['limit'], [
            model.drive.torque_per_current for model in self._law.models])

    def hear(self, message: Any, info: dict[str, Any]) -> None:
        """Answer a joint state; `info` is what the middleware says of the message."""
        self.heard += 1
        self.take(message, self._now(), 0 if self._simulated else info['received_timestamp'],
                  info['source_timestamp'], info['publication_sequence_number'] or 0)

    def take(self, message: Any, now: int, received: int = 0, sent: int = 0,
             sequence: int = 0) -> None:
        """Answer a joint state, `sent` at a system time in ns; else as `JointStateInput.take`."""
        if self.yields or not self._port.ready:
            return
        if now == 0:
            # Simulated time before its first tick: the age of states is not known yet.
            self._faults.report('clock', 'no /clock, although use_sim_time is set', WARN)
            return
        inputs, ticket = self.inputs, self._port.ticket
        verdict = inputs.take(message, now, received, sequence)
        if verdict == joint_states.NEW:
            currents = self._currents()
            stamp = inputs.states.stamp if self._simulated else 0
            if not self._port.answer(currents, ticket, stamp):
                self._faults.latch('law', 'the law gave a current that is not finite')
            # The port's last currents may be those of faulty states, which came before a silence.
            self._computed = currents
            inputs.compare_velocities()
        elif verdict == joint_states.AGAIN:
            self._port.repeat(sent)
        elif verdict not in (joint_states.PART, joint_states.LATE):
            self._port.answer(self._zeros, ticket)

    def _currents(self) -> np.ndarray:
        inputs = self.inputs
        if inputs.anew:
            self._law.reset()
        # After a second, the driver may have been restarted, with another zero position.
        if (inputs.silence > 1.0 and not self._simulated
                and (np.abs(self._computed) >= NEGLIGIBLE).any()):
            self._faults.latch('driver', f'joint_states were silent for {inputs.silence:.3g} s '
                               'while the motor was driven: the driver may have been restarted')
        if self._faults.latched:
            return self._zeros
        try:
            return self._law.update(inputs.time, inputs.position, inputs.velocity,
                                    inputs.direction, inputs.temperature, end=inputs.ends,
                                    is_pushed=inputs.is_pushed)
        except Exception as error:
            self._faults.latch('law', f'an error in the law: {error!r}\n{traceback.format_exc()}')
            return self._zeros

    def reset_faults(self) -> list[str]:
        """Clear latched faults and history; return the texts of the faults."""
        texts = self._faults.reset()
        if texts:
            self._law.reset()
            self.inputs.directions.forget()
            self._alone_since = None
        return texts

    def supervise(self, others: Sequence[str]) -> None:
        """Report what is in doubt, and check for `others` that publish commands; call it often.

        A publisher that appears while this node commands is a latched fault. If it was there
        before, the node waits, since discovery may report it for some time after it is gone.
        """
        now = self._clock()
        self.inputs.report()
        self._report_doubt()
        self._faults.expire()
        if not others:
            self._alone_since = self._alone_since or now
            self.yields = False
            return
        text = f'{", ".join(others)} may command the motor too'
        if self._alone_since is not None and now - self._alone_since > ALONE:
            self._faults.latch('commander', text)
        self._faults.report('commander', text)
        self._alone_since = None
        if not self.yields:
            self.yields = True
            self.stop()
            self._law.reset()

    def _report_doubt(self) -> None:
        guards = self._law.guards
        if doubtful := [joint for j, joint in enumerate(self._joints)
                        if guards['in doubt'][j] and self.inputs.in_use(j)]:
            self._faults.report(
                'doubt', f'{", ".join(doubtful)}: no current, since the position jumps')
        if reduced := [joint for joint, share in zip(self._joints, guards['taken back'])
                       if share > 0.1]:
            self._faults.report('lost friction', f'{", ".join(reduced)}: less current, since the '
                                'drive slipped under its preload, or went on faster than '
                                'identified: its friction may have decreased; identify it again, '
                                'up to the fastest movement', WARN)
        if self._law.limited:
            self._faults.report('limit', '; '.join(
                f'{self._joints[j]}: {effects} {why}' for j, effects, why in self._law.limited),
                WARN)

    def unusual(self) -> list[str]:
        """Return what is unusual about the models, as text."""
        return [f"{joint}: its model file is for joint '{model.joint}'"
                for joint, model in zip(self._joints, self._law.models)
                if model.joint not in ('', joint)]

    def left_out(self) -> list[str]:
        """Return which effects of the models are not fed back, and why, as text."""
        return [f'{self._joints[j]}: {effect} is not fed back: {why}'
                for j, effect, why in self._law.never_applied]

    def values(self) -> dict[str, Any]:
        """Return what diagnostics show, a number for each joint or a single value."""
        law, (directions, ages) = self._law, self.inputs.direction_values()
        # At the last state, effects without a signal.
        missing = [
            (j, effect, ', '.join(self.inputs.why_missing(j, signal) for signal in signals)
             or 'its value is not finite') for j, effect, signals in law.missing]
        return {
            'command [A]': self._port.last,
            **{f'{name} [A]': term for name, term in law.terms.items()},
            **{f'guard: {name}': guarded for name, guarded in law.guards.items()},
            'direction': directions, 'direction age [s]': ages, **self.inputs.counts,
            'faults so far': self._faults.count,
            'left_out': '; '.join(f'{self._joints[j]}: {effect} ({why})' for j, effect, why in [
                *law.never_applied, *missing, *law.limited])}

    def status(self) -> tuple[bool, str]:
        """Return whether all is well, and a message, while no fault is present."""
        if not self.inputs.states.stamp:
            return False, 'no joint_states yet'
        return True, ('compensating' if np.any(self.inputs.direction_values()[0])
                      else 'compensating; no direction')
