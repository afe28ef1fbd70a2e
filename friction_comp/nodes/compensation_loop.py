# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Computes a current command from each joint state, without the ROS 2 node around it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
import time
import traceback
from typing import Any

import numpy as np

from friction_comp.nodes import joint_states
from friction_comp.nodes.faults import Faults, WARN
from friction_comp.nodes.joint_io import CommandPort
from friction_comp.nodes.joint_states import are_finite, JointStateInput, NANO, within
from friction_comp.nodes.slow_inputs import Direction, MotorTemperature
from friction_comp.nodes.watchdog import Watchdog
from friction_comp.signal_checks import beyond, LIMITS, VelocityCheck

# A current that is computed in another way from now on goes on from where it is and fades to the
# new one within a few of these, s.
_FADE = 0.05
# A current this near has faded, A.
_FADED = 1e-7
# Silence of the driver after which it may have been restarted, and count from another place, s.
GONE = 1.0
# Real s that a compensator must have been alone for another commander to be a newcomer.
ALONE = 3.0
# Velocity and rate of position may differ by this factor, a smoothed or late velocity does, in most
# of so many tenths of a second of motion.
_VELOCITY_FACTOR, _VELOCITY_BLOCKS = 3.0, 5
# Share of the compensation that is taken back, from which on it is told.
_LOST = 0.1
_FARTHEST, _FASTEST = LIMITS['position'][0], LIMITS['velocity'][0]


class CompensationLoop:
    """Answers joint states with currents, and with zero whenever in doubt.

    Parameters
    ----------
    joints : list of str
    law : CompensationLaw
    port : CommandPort
    faults : Faults
    timeout : int
        Age or silence of joint states that gives zero current, ns.
    direction_timeout : float
        s.
    rests : bool
        Whether time itself may rest, as in a simulation: silence is then no sign of a driver
        that went.
    clock : callable
        Returns s that nobody sets.
    """

    def __init__(self, joints: list[str], law: Any, port: CommandPort, faults: Faults,
                 timeout: int, direction_timeout: float, rests: bool = False,
                 clock: Callable[[], float] = time.monotonic) -> None:
        self._joints = joints
        self.law, self.port, self.faults = law, port, faults
        self.rests, self._clock = rests, clock
        self.states = JointStateInput(joints, timeout)
        self.direction = Direction(joints, direction_timeout)
        self.temperature = MotorTemperature(joints)
        self.watchdog = Watchdog(timeout / NANO, self._on_silence, clock)
        self._zeros = np.zeros(len(joints))
        self.activate()

    def activate(self, others: Sequence[str] = ()) -> None:
        """Begin without history and without faults; `others` may command the motor already."""
        self.watchdog.rest()
        self.law.reset()
        self.states.forget()
        self.direction.forget()
        self.temperature.forget()
        self.faults.clear()
        self._first = 0
        self._silent_since: float | None = None
        self._drove = False
        self._alone_since: float | None = None
        self.yields = False
        self._fade: Any = None
        self._velocities = [VelocityCheck(
            _VELOCITY_FACTOR, _VELOCITY_BLOCKS, model.drive.position_resolution or 0.0)
            for model in self.law.models]
        if others:
            self.look_around(others)

    def changed(self) -> None:
        """Continue from the present current after a change of law or model."""
        if self._first:
            self._fade = 'begin'

    def reset_faults(self) -> list[str]:
        """Clear what is latched, begin without history, and return what it was."""
        texts = self.faults.reset()
        if texts:
            self.law.reset()
            self.direction.forget()
            self._alone_since = None
        return texts

    # Inputs.

    def take(self, message: Any, now: int, received: int = 0, sent: int = 0,
             sequence: int = 0) -> None:
        """Answer a joint state.

        Parameters
        ----------
        message : sensor_msgs.msg.JointState
        now : int
            The node's clock, ns.
        received, sent : int
            When the middleware received and sent it, system time in ns.
        sequence : int
            Its publisher's number of it; 0 where the middleware gives none.
        """
        if self.yields or not self.port.ready:
            return
        states = self.states
        ticket = self.port.ticket
        verdict = states.take(message, now, received, sequence)
        if verdict == joint_states.NEW:
            if self._silent_since is not None:
                self._hear_again()
            self.watchdog.feed()
            self.port.answer(self._currents(), ticket, states.stamp if self.rests else 0)
            self._compare_velocities()
        elif verdict == joint_states.AGAIN:
            if self.port.is_lost(sent):
                self.port.repeat()
        elif verdict == joint_states.PART:
            if not states.stamp:
                self.faults.seen('missing', f'joint_states lack {", ".join(states.missing)}')
        elif verdict != joint_states.LATE:
            self.faults.seen(verdict, states.wrong)
            self.port.answer(self._zeros, ticket)

    def take_direction(self, values: Any, now: int) -> None:
        """Take a plain direction; it is as old as the newest joint state."""
        # The time of the states, not of arrival: a simulation's direction must not age while it
        # rests, and is to age alike in every run.
        if not self.direction.take(values, self.states.stamp or now):
            self._refuse_direction()

    def take_stamped_direction(self, names: Any, velocities: Any, stamp: int, now: int) -> None:
        """Take a direction that says itself when it was announced."""
        at = self.states.stamp or now
        if not self.direction.take_stamped(names, velocities, stamp or at, max(at, now)):
            self._refuse_direction()

    def _refuse_direction(self) -> None:
        self.faults.seen(
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
            law.reset()
        if states.restarted:
            self.direction.forget()
            self.temperature.forget()
        if states.restarted or not self._first:
            self._first = stamp
            self.direction.begin(stamp)
        position = states.position
        usable: Any = True
        if not (within(position, _FARTHEST)
                and (states.velocity is None or within(states.velocity, _FASTEST))):
            usable = self._tell_unusable()
            position = np.where(usable, position, np.nan)
        wrong = [j for j, check in enumerate(self._velocities) if check.fault]
        if wrong:
            usable = np.broadcast_to(usable, len(position)).copy()
            usable[wrong] = False
            self.faults.seen('velocity', '; '.join(
                f'{self._joints[j]}: {self._velocities[j].fault}' for j in wrong))
        if self.faults.latched:
            return self._zeros
        # From the first state: seconds since 1970 are too many for a float to hold their step.
        currents = law.update(
            (stamp - self._first) / NANO, position, states.velocity, self.direction.at(stamp),
            self.temperature.before(stamp))
        if self._fade is not None:
            currents = self._faded(currents, stamp)
        if usable is not True:
            currents = np.where(usable, currents, 0.0)
        if not are_finite(currents):
            self.faults.latch('law', 'the law gave a current that is not finite')
            return self._zeros
        return currents

    def _tell_unusable(self) -> np.ndarray:
        """Report why joints cannot be used; return which can, bool, shape (J,)."""
        states, joints = self.states, self._joints
        usable = np.isfinite(states.position)
        if states.velocity is not None:
            usable &= np.isfinite(states.velocity)
        if states.missing:
            self.faults.seen('missing', f'joint_states lack {", ".join(states.missing)}')
        elif not usable.all():
            self.faults.seen('values', 'joint_states hold values that are not finite, or too few')
        for signal, values in (('position', states.position), ('velocity', states.velocity)):
            for j in () if values is None else np.flatnonzero(usable & beyond(signal, values)):
                usable[j] = False
                self.faults.seen(f'{signal} of {joints[j]}', f'{joints[j]}: a {signal} of '
                                 f'{values[j]:.3g} {LIMITS[signal][1]} cannot be')
        return usable

    def _compare_velocities(self) -> None:
        """Compare the velocity with the position, when the answer has gone out."""
        states = self.states
        at, velocity = (states.stamp - self._first) / NANO, states.velocity
        due = None
        for j, check in enumerate(self._velocities):
            if states.restarted or states.gap or velocity is None:
                check.interrupt()
            elif math.isfinite(velocity[j]) and math.isfinite(states.position[j]):
                if check.add(at, float(states.position[j]), float(velocity[j])):
                    due = check
        # One joint after each answer: the next one is not to wait for all of them.
        if due is not None:
            due.judge()

    def _faded(self, currents: Any, stamp: int) -> Any:
        if self._fade == 'begin':
            self._fade = np.asarray(self.port.last) - currents, stamp
        offset, since = self._fade
        left = offset * math.exp(-max(0, stamp - since) / NANO / _FADE)
        if np.abs(left).max() < _FADED:
            self._fade = None
        return currents + left

    # Watching.

    def _on_silence(self) -> None:
        """Command zero; called by the watchdog, in its thread."""
        drove = any(self.port.last)
        self.port.zero()
        self._drove = drove
        self._silent_since = self._clock()
        self.faults.seen('silence', 'no joint_states, or none that are new', lasting=True)

    def _hear_again(self) -> None:
        silence = self._clock() - self._silent_since
        self._silent_since = None
        self.faults.gone('silence')
        if self._drove and silence > GONE and not self.rests:
            self.faults.latch('driver', f'joint_states were silent for {silence:.3g} s while the '
                              'motor was driven: the driver may have been restarted')

    def look_around(self, others: Sequence[str]) -> None:
        """Take note of who else has a publisher of the command; to be called often.

        One that comes while this one commands is a fault that latches. One that was there first
        is waited for: it may be gone already, and only not yet be missed.
        """
        now = self._clock()
        self._tell_doubt()
        self._tell_dispute()
        self.faults.look()
        if not others:
            self._alone_since = self._alone_since or now
            self.yields = False
            return
        text = f'{", ".join(others)} may command the motor too'
        if self._alone_since is not None and now - self._alone_since > ALONE:
            self.faults.latch('commander', text)
        self.faults.seen('commander', text)
        self._alone_since = None
        if not self.yields:
            self.yields = True
            self.watchdog.rest()
            self.port.zero()
            self.law.reset()

    def _tell_doubt(self) -> None:
        """Report which joints get no current, or less, and why."""
        guards = self.law.guards
        doubtful = [joint for joint, doubt in zip(self._joints, guards['in doubt']) if doubt]
        if doubtful and self._silent_since is None:
            self.faults.seen('doubt', f'{", ".join(doubtful)}: no current, for the position jumps '
                             'or the velocity contradicts it')
        weak = [joint for joint, share in zip(self._joints, guards['taken back'])
                if share > _LOST]
        if weak:
            self.faults.seen('lost friction', f'{", ".join(weak)}: less current, for the drive '
                             'slipped under its preload or was faster than identified: its '
                             'friction may have fallen; identify it again', WARN)

    def _tell_dispute(self) -> None:
        disputed = self.direction.disputed(self.states.stamp)
        if disputed:
            self.faults.seen('planners', f'the direction of {", ".join(disputed)} counts as 0: '
                             f'{", ".join(self.direction.planners)} contradict each other')

    def leave(self) -> None:
        """Command zero current and stop watching."""
        self.watchdog.rest()
        self.port.zero()
