# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is known of the joints at a joint state; what is in doubt is reported and counts as missing.

Every check of an input stands here or in the class of that input, and only there: the law takes
what it gets.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
import time
from typing import Any

import numpy as np

from friction_comp.control import joint_states
from friction_comp.control.faults import Faults, WARN
from friction_comp.control.joint_states import JointStateInput, within
from friction_comp.control.slow_inputs import Direction, MotorTemperature
from friction_comp.control.watchdog import Watchdog
from friction_comp.facts.motion import BLOCK, FEWEST_BLOCKS, VelocityCheck
from friction_comp.samples import beyond, LIMITS
from friction_comp.stamps import NANO

_MAX_POSITION, _MAX_VELOCITY = LIMITS['position'][0], LIMITS['velocity'][0]


class Inputs:
    """Joint states, directions and temperatures of a compensator, validated.

    Age or silence of joint states beyond `timeout` (ns) is a fault: `on_silence` is then called, in
    the watchdog's thread. `direction_timeout` is in s, and that of `directions`.

    Of the last new joint state are: `time`, s since the first one (seconds since 1970 have too
    little resolution as a float); `position`, `direction` and `ends` (of announced movements),
    shape (J,), rad, NaN where in doubt or unknown; `is_pushed`, bool, where a sensor feels the
    person push in that direction, if any; `velocity`, rad/s, and `temperature`, degrees Celsius,
    shape (J,) or None where nobody sent any; whether it begins `anew` rather than continues the
    state before; and how long joint states were silent before it, `silence` in s.
    """

    def __init__(self, joints: Sequence[str], timeout: int, direction_timeout: float,
                 faults: Faults, on_silence: Callable[[], None],
                 clock: Callable[[], float] = time.monotonic) -> None:
        self._joints, self._faults = list(joints), faults
        self._on_silence, self._clock = on_silence, clock
        self.states = JointStateInput(joints, timeout)
        self.directions = Direction(joints, direction_timeout)
        self._temperature = MotorTemperature(joints)
        self.watchdog = Watchdog(timeout / NANO, self._fall_silent, clock)
        self.forget()

    def forget(self, resolutions: Sequence[float] = ()) -> None:
        """Forget all inputs; `resolutions` are those of the encoders, rad, if they change."""
        self.watchdog.rest()
        self.states.forget()
        self.directions.forget()
        self._temperature.forget()
        self._silent_since: float | None = None
        self.silence = 0.0
        if resolutions:
            self._first = 0
            self._velocities = [VelocityCheck(FEWEST_BLOCKS, resolution)
                                for resolution in resolutions]
            self._block: list[tuple[float, np.ndarray, np.ndarray]] = []
            self._due: list[tuple[VelocityCheck, tuple[np.ndarray, ...]]] = []

    def take(self, message: Any, now: int, received: int = 0, sequence: int = 0) -> str:
        """Read a joint state and return the verdict; arguments of `JointStateInput.take`."""
        verdict = self.states.take(message, now, received, sequence)
        if verdict == joint_states.NEW:
            self.silence = 0.0
            if self._silent_since is not None:
                self.silence = self._clock() - self._silent_since
                self._silent_since = None
            self.watchdog.feed()
            self._read()
        elif verdict == joint_states.PART:
            if self.states.overdue:
                self._report_missing()
        elif verdict not in (joint_states.AGAIN, joint_states.LATE):
            self._faults.report(verdict, self.states.wrong)
        return verdict

    def take_direction(self, values: Any, now: int) -> None:
        """Take a plain direction; it is as old as the newest joint state."""
        # By the time of the states, not of arrival: in a simulation, a direction must not age while
        # time stops, and its age must be reproducible.
        if not self.directions.take(values, self.states.stamp or now):
            self._refuse_direction()

    def take_stamped_direction(self, names: Any, velocities: Any, stamp: int, now: int,
                               ends: Any = (), pushes: Any = ()) -> None:
        """Take a direction with its stamp, where the movement ends, and whether a push is felt."""
        at = self.states.stamp or now
        if not self.directions.take_stamped(names, velocities, stamp or at, max(at, now), ends,
                                            pushes):
            self._refuse_direction()

    def _refuse_direction(self) -> None:
        self._faults.report(
            'direction', f'a direction was counted as 0: {self.directions.why}', WARN)

    def take_temperature(self, joint: str, value: float, stamp: int, now: int) -> None:
        """Take a temperature in degrees Celsius with the stamp of its measurement."""
        if not self._temperature.take(joint, value, stamp or self.states.stamp or now):
            self._faults.report('temperature', f'{joint}: a motor temperature of {value:.4g} °C is '
                                'impossible and was passed over', WARN)

    def set_sources(self, states: list[str], planners: list[str]) -> None:
        """Tell who publishes joint states, and directions, if there are several."""
        self.states.publishers, self.directions.planners = states, planners

    def _read(self) -> None:
        states, stamp = self.states, self.states.stamp
        self.anew = states.restarted or states.gap
        if states.restarted:
            self.directions.forget()
            self._temperature.forget()
        if states.restarted or not self._first:
            self._first = stamp
            self.directions.begin(stamp)
        self.time = (stamp - self._first) / NANO
        self.position, self.velocity = states.position, states.velocity
        if not (within(states.position, _MAX_POSITION) and (
                states.velocity is None or within(states.velocity, _MAX_VELOCITY))):
            self.position = np.where(self._possible(), states.position, np.nan)
        # Without a velocity there is no contradiction: the position is used alone.
        wrong = [] if states.velocity is None else [
            j for j, check in enumerate(self._velocities) if check.fault]
        if wrong:
            self.position = self.position.copy()
            self.position[wrong] = np.nan
            self._faults.report('velocity', '; '.join(
                f'{self._joints[j]}: {self._velocities[j].fault}' for j in wrong))
        self.direction, self.ends = self.directions.at(stamp), self.directions.ends
        self.is_pushed = self.directions.is_pushed
        self.temperature = self._temperature.before(stamp)

    def _possible(self) -> np.ndarray:
        """Report values that cannot be; return whose can, bool, shape (J,)."""
        states, joints = self.states, self._joints
        signals = {'position': states.position}
        if states.velocity is not None:
            signals['velocity'] = states.velocity
        possible = np.all(np.isfinite(list(signals.values())), axis=0)
        if states.missing:
            self._report_missing()
        elif not possible.all():
            self._faults.report(
                'values', 'joint_states hold values that are not finite, or too few')
        for signal, values in signals.items():
            for j in np.flatnonzero(possible & beyond(signal, values)):
                possible[j] = False
                self._faults.report(f'{signal} of {joints[j]}', f'{joints[j]}: a {signal} of '
                                    f'{values[j]:.3g} {LIMITS[signal][1]} is impossible')
        return possible

    def _report_missing(self) -> None:
        self._faults.report('missing', f'joint_states lack {", ".join(self.states.missing)}')

    def compare_velocities(self) -> None:
        """Collect blocks of velocity and position, or compare those of one joint.

        To be called after an answer. One joint each time, so that the next answer is not delayed.
        """
        states, block = self.states, self._block
        if self.anew or states.velocity is None:
            block.clear()
        if states.velocity is not None:
            block.append((self.time, states.position, states.velocity))
        if self._due:
            check, signals = self._due.pop()
            check.judge(*signals)
        elif block and self.time - block[0][0] >= BLOCK:
            time, position, velocity = map(np.array, zip(*block))
            self._due = [(check, (time, position[:, j], velocity[:, j]))
                         for j, check in enumerate(self._velocities)]
            # A block begins where the one before ends.
            del block[:-1]

    def _fall_silent(self) -> None:
        self._on_silence()
        self._silent_since = self._clock()
        self._report_silence()

    def _report_silence(self) -> None:
        self._faults.report('silence', 'no joint_states, or none that are new')

    def report(self) -> None:
        """Report what is in doubt now."""
        if self._silent_since is not None:
            self._report_silence()
        direction, stamp = self.directions, self.states.stamp
        disputed, silent = direction.disputed(stamp), direction.silent(stamp)
        if disputed:
            self._faults.report('planners', f'the direction of {", ".join(disputed)} counts as 0: '
                                f'{", ".join(direction.planners)} contradict each other')
        if silent:
            self._faults.report('direction silent', f'the direction of {", ".join(silent)} was not '
                                f'renewed for {direction.timeout:g} s and counts as 0', WARN)

    def in_use(self, joint: int) -> bool:
        """Return whether states come, and no value of a joint is in doubt."""
        return (self._silent_since is None and self.states.stamp != 0
                and math.isfinite(self.position[joint]))

    def why_missing(self, joint: int, signal: str) -> str:
        """Return why a joint lacks a signal at the last state."""
        if signal == 'temperature':
            return self._temperature.why_unknown(joint, self.states.stamp)
        return f'the {signal} is not measured here: the torque sensor is for evaluation only'

    def direction_values(self) -> tuple[np.ndarray, list[float]]:
        """Return directions at the last state, and their ages in s, NaN where there is none."""
        stamp = self.states.stamp
        return self.directions.at(stamp), [
            self.directions.age(joint, stamp) for joint in range(len(self._joints))]

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of messages that were not used, for diagnostics."""
        return {'directions refused': self.directions.refused,
                'joint_states passed over': self.states.passed_over}
