# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Computes a current command from each joint state, independently of the ROS 2 node."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
import time
import traceback
from typing import Any

import numpy as np

from friction_comp.control import joint_states
from friction_comp.control.faults import Faults, WARN
from friction_comp.control.joint_states import are_finite, JointStateInput, within
from friction_comp.control.port import NEGLIGIBLE, Port
from friction_comp.control.slow_inputs import Direction, MotorTemperature
from friction_comp.control.watchdog import Watchdog
from friction_comp.signal_checks import beyond, LIMITS, VelocityCheck
from friction_comp.stamps import NANO

# Time constant of the transition to the new current after a change of law or model, s.
_FADE = 0.05
# The transition ends at this difference of current, A.
_FADE_END = 1e-7
# Silence after which the driver may have been restarted, with another zero position, s.
RESTART_SILENCE = 1.0
# Real s without another commander after which a new one is a latched fault.
ALONE = 3.0
# Largest ratio of velocity and rate of position, which smoothing and delay change too, and number
# of blocks of 0.1 s of motion that are checked.
_VELOCITY_FACTOR, _VELOCITY_BLOCKS = 3.0, 5
# Share of the compensation withdrawn by guards above which a warning is given.
_REPORTED_LOSS = 0.1
_MAX_POSITION, _MAX_VELOCITY = LIMITS['position'][0], LIMITS['velocity'][0]


class CompensationLoop:
    """Answers joint states with currents, or with zero in case of doubt.

    Age or silence of joint states beyond `timeout` (ns) leads to zero current; `direction_timeout`
    is in s. If `simulated`, time may stop: silence then does not mean that the driver is gone.
    """

    def __init__(self, joints: list[str], law: Any, port: Port, faults: Faults,
                 timeout: int, direction_timeout: float, simulated: bool = False,
                 clock: Callable[[], float] = time.monotonic) -> None:
        self._joints = joints
        self.law, self.port, self.faults = law, port, faults
        self.simulated, self._clock = simulated, clock
        self.states = JointStateInput(joints, timeout)
        self.direction = Direction(joints, direction_timeout)
        self.temperature = MotorTemperature(joints)
        self.watchdog = Watchdog(timeout / NANO, self._on_silence, clock)
        self._zeros = np.zeros(len(joints))
        self.activate()

    def activate(self, others: Sequence[str] = ()) -> None:
        """Start without history and faults; `others` are nodes that may command already."""
        self.watchdog.rest()
        self._begin_anew()
        self._forget_inputs()
        self.faults.clear()
        self._first = 0
        self._silent_since: float | None = None
        self._computed: Any = ()
        self._alone_since: float | None = None
        self.yields = False
        self._velocities = [VelocityCheck(
            _VELOCITY_FACTOR, _VELOCITY_BLOCKS, model.drive.position_resolution or 0.0)
            for model in self.law.models]
        if others:
            self.supervise(others)

    def _begin_anew(self) -> None:
        """Forget the history of the current: what follows does not continue it."""
        self.law.reset()
        self._fade: Any = None

    def _forget_inputs(self) -> None:
        self.states.forget()
        self.direction.forget()
        self.temperature.forget()

    def changed(self) -> None:
        """Continue from the present current after a change of law or model."""
        if self._first:
            self._fade = 'begin'

    def reset_faults(self) -> list[str]:
        """Clear latched faults and history; return the texts of the faults."""
        texts = self.faults.reset()
        if texts:
            self._begin_anew()
            self.direction.forget()
            self._alone_since = None
        return texts

    # Inputs.

    def take(self, message: Any, now: int, received: int = 0, sent: int = 0,
             sequence: int = 0) -> None:
        """Answer a joint state; `sent` is the system time in ns of its publication.

        The other arguments are those of `JointStateInput.take`.
        """
        if self.yields or not self.port.ready:
            return
        states = self.states
        ticket = self.port.ticket
        verdict = states.take(message, now, received, sequence)
        if verdict == joint_states.NEW:
            if self._silent_since is not None:
                self._end_silence(self._clock() - self._silent_since)
            self.watchdog.feed()
            currents = self._currents()
            self.port.answer(currents, ticket, states.stamp if self.simulated else 0)
            # Not what the port holds at a silence: faulty states may come before it.
            self._computed = currents
            self._compare_velocities()
        elif verdict == joint_states.AGAIN:
            self.port.repeat(sent)
        elif verdict == joint_states.PART:
            if states.overdue:
                self._report_missing()
        elif verdict != joint_states.LATE:
            self.faults.report(verdict, states.wrong)
            self.port.answer(self._zeros, ticket)

    def take_direction(self, values: Any, now: int) -> None:
        """Take a plain direction; it is as old as the newest joint state."""
        # By the time of the states, not of arrival: in a simulation, a direction must not age while
        # time stops, and its age must be reproducible.
        if not self.direction.take(values, self.states.stamp or now):
            self._refuse_direction()

    def take_stamped_direction(self, names: Any, velocities: Any, stamp: int, now: int,
                               ends: Any = ()) -> None:
        """Take a direction with the stamp of its announcement, and where the movement ends."""
        at = self.states.stamp or now
        if not self.direction.take_stamped(names, velocities, stamp or at, max(at, now), ends):
            self._refuse_direction()

    def take_temperature(self, joint: str, value: float, stamp: int, now: int) -> None:
        """Take a temperature in degrees Celsius with the stamp of its measurement."""
        if not self.temperature.take(joint, value, stamp or self.states.stamp or now):
            self.faults.report('temperature', f'{joint}: a motor temperature of {value:.4g} °C is '
                               'impossible and was passed over', WARN)

    def _refuse_direction(self) -> None:
        self.faults.report(
            'direction', f'a direction was counted as 0: {self.direction.why}', WARN)

    # The current.

    def _currents(self) -> Any:
        try:
            return self._compute()
        except Exception as error:
            self.faults.latch('law', f'an error in the law: {error!r}\n{traceback.format_exc()}')
            return self._zeros

    def _compute(self) -> Any:
        states, law, stamp = self.states, self.law, self.states.stamp
        if states.restarted or states.gap:
            self._begin_anew()
        if states.restarted:
            self.direction.forget()
            self.temperature.forget()
        if states.restarted or not self._first:
            self._first = stamp
            self.direction.begin(stamp)
        position = states.position
        usable: Any = True
        if not (within(position, _MAX_POSITION)
                and (states.velocity is None or within(states.velocity, _MAX_VELOCITY))):
            usable = self._report_unusable()
            position = np.where(usable, position, np.nan)
        # Without a velocity there is no contradiction: the position is used alone.
        wrong = [] if states.velocity is None else [
            j for j, check in enumerate(self._velocities) if check.fault]
        if wrong:
            usable = np.broadcast_to(usable, len(position)).copy()
            usable[wrong] = False
            self.faults.report('velocity', '; '.join(
                f'{self._joints[j]}: {self._velocities[j].fault}' for j in wrong))
        if self.faults.latched:
            return self._zeros
        # Relative to the first state: seconds since 1970 have too little resolution as a float.
        currents = law.update(
            (stamp - self._first) / NANO, position, states.velocity,
            self.direction.at(stamp), self.temperature.before(stamp), end=self.direction.ends)
        if self._fade is not None:
            currents = self._apply_fade(currents, stamp)
        if usable is not True:
            currents = np.where(usable, currents, 0.0)
        if not are_finite(currents):
            self.faults.latch('law', 'the law gave a current that is not finite')
            return self._zeros
        return currents

    def _report_missing(self) -> None:
        self.faults.report('missing', f'joint_states lack {", ".join(self.states.missing)}')

    def _report_unusable(self) -> np.ndarray:
        """Report why joints cannot be used; return which can, bool, shape (J,)."""
        states, joints = self.states, self._joints
        signals = {'position': states.position}
        if states.velocity is not None:
            signals['velocity'] = states.velocity
        usable = np.all(np.isfinite(list(signals.values())), axis=0)
        if states.missing:
            self._report_missing()
        elif not usable.all():
            self.faults.report('values', 'joint_states hold values that are not finite, or too few')
        for signal, values in signals.items():
            for j in np.flatnonzero(usable & beyond(signal, values)):
                usable[j] = False
                self.faults.report(f'{signal} of {joints[j]}', f'{joints[j]}: a {signal} of '
                                   f'{values[j]:.3g} {LIMITS[signal][1]} is impossible')
        return usable

    def _compare_velocities(self) -> None:
        """Compare velocity and position, after the answer was published."""
        states = self.states
        at, velocity = (states.stamp - self._first) / NANO, states.velocity
        due = None
        for j, check in enumerate(self._velocities):
            if states.restarted or states.gap or velocity is None:
                check.interrupt()
            elif math.isfinite(velocity[j]) and math.isfinite(states.position[j]):
                if check.add(at, float(states.position[j]), float(velocity[j])):
                    due = check
        # One joint per answer, so that the next answer is not delayed.
        if due is not None:
            due.judge()

    def _apply_fade(self, currents: Any, stamp: int) -> Any:
        if self._fade == 'begin':
            self._fade = np.asarray(self.port.last) - currents, stamp
        offset, begin = self._fade
        remaining = offset * math.exp(-max(0, stamp - begin) / NANO / _FADE)
        if np.abs(remaining).max() < _FADE_END:
            self._fade = None
        return currents + remaining

    # Supervision.

    def _on_silence(self) -> None:
        """Command zero; called by the watchdog, in its thread."""
        self.port.zero()
        self._silent_since = self._clock()
        self._report_silence()

    def _report_silence(self) -> None:
        self.faults.report('silence', 'no joint_states, or none that are new')

    def _end_silence(self, silence: float) -> None:
        self._silent_since = None
        self._doubt_driver(f'joint_states were silent for {silence:.3g} s', silence)

    def _doubt_driver(self, what: str, seconds: float) -> None:
        """Latch a fault if joint states were not followed for long while the motor was driven."""
        was_driving = (np.abs(self._computed) >= NEGLIGIBLE).any()
        if was_driving and seconds > RESTART_SILENCE and not self.simulated:
            self.faults.latch('driver', f'{what} while the motor was driven: the driver may have '
                              'been restarted')

    def resume(self, seconds: float) -> None:
        """Begin anew after the process was stopped for some s, without earlier inputs."""
        self._silent_since = None
        self.watchdog.rest()
        self._begin_anew()
        self._forget_inputs()
        self._doubt_driver(f'the node was stopped for {seconds:.3g} s', seconds)
        self._computed = ()

    def supervise(self, others: Sequence[str]) -> None:
        """Report what is in doubt, and check for `others` that publish commands; call it often.

        A publisher that appears while this node commands is a latched fault. If it was there
        before, the node waits, since discovery may report it for some time after it is gone.
        """
        now = self._clock()
        if self._silent_since is not None:
            self._report_silence()
        self._report_doubt()
        self.faults.expire()
        if not others:
            self._alone_since = self._alone_since or now
            self.yields = False
            return
        text = f'{", ".join(others)} may command the motor too'
        if self._alone_since is not None and now - self._alone_since > ALONE:
            self.faults.latch('commander', text)
        self.faults.report('commander', text)
        self._alone_since = None
        if not self.yields:
            self.yields = True
            self.watchdog.rest()
            self.port.zero()
            self._begin_anew()

    def _report_doubt(self) -> None:
        guards = self.law.guards
        doubtful = [joint for joint, doubt in zip(self._joints, guards['in doubt']) if doubt]
        if doubtful and self._silent_since is None:
            self.faults.report('doubt', f'{", ".join(doubtful)}: no current, since '
                               'the position jumps or the velocity contradicts it')
        reduced = [joint for joint, share in zip(self._joints, guards['taken back'])
                   if share > _REPORTED_LOSS]
        if reduced:
            self.faults.report('lost friction', f'{", ".join(reduced)}: less current, since the '
                               'drive slipped under its preload or was faster than identified: its '
                               'friction may have decreased; identify it again', WARN)

        limited = [f'{self._joints[j]}: {effects} {why}' for j, effects, why in self.law.limited]
        if limited:
            self.faults.report('limit', '; '.join(limited), WARN)
        disputed = self.direction.disputed(self.states.stamp)
        if disputed:
            self.faults.report('planners', f'the direction of {", ".join(disputed)} counts as 0: '
                               f'{", ".join(self.direction.planners)} contradict each other')
        silent = self.direction.silent(self.states.stamp)
        if silent:
            self.faults.report('direction silent', f'the direction of {", ".join(silent)} was not '
                               f'renewed for {self.direction.timeout:g} s and counts as 0', WARN)

    def stop(self) -> None:
        """Command zero current and stop watching."""
        self.watchdog.rest()
        self.port.zero()
