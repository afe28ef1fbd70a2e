# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""When a run ends before its time: every limit of a joint that is moved, and every reason.

Measurements are compared with commands, sample by sample. The measured current is the commanded
one, with little delay; the position changes as the measured velocity says; a current well above
breakaway accelerates the joint; the joint stays in its range and near its reference. Anything else
(wiring, encoder, units, machine, a person) ends the run before a model is written: **zero current
whenever the joint does not respond as a joint should**. Until the measured current is confirmed,
only the first ramp is commanded, which ends when the joint moves.
"""

from __future__ import annotations

from collections import deque
import math
from typing import NoReturn

import numpy as np

from friction_comp.drive import Drive
from friction_comp.facts.current import ALIKE, Answer, CurrentCheck, FOLLOWS, gain_fault
from friction_comp.facts.motion import encoder_fault, VelocityCheck
from friction_comp.identification.goal import IdentificationError
from friction_comp.low_pass import low_pass_weight

LONGEST_GAP = 0.25
"""Longest time without a sample, s."""
LEAST_RATE = 100.0
"""Lowest rate of joint states in Hz at which a joint is moved."""
BANDWIDTH, LEAST_BANDWIDTH = 100.0, 10.0
"""Crossover frequency of the velocity controller, rad/s: far below the sampling frequency of 1 kHz,
far above that of the profile; it falls with rate and delay. Below the second, slow constant
velocities are not held."""
PHASE, DELAY_SHARE = 1.0, 0.4
"""Its phase margin in rad without any delay: a quarter turn less filter, integrator and position,
0.2 + 0.2 + 0.16 rad; and the share that sampling and delay may take: 34 degrees then remain."""
LONGEST_DELAY = DELAY_SHARE * PHASE / LEAST_BANDWIDTH - 1.0 / LEAST_RATE
"""Longest delay in s between command and measured current at which a joint is moved, 0.03 s."""
PATIENCE = 10.0
"""Longest time to come to rest, s."""
LEAST_SHARE = 0.02
"""Smallest commanded current that is compared, as a share of one that breaks the joint free."""
# A current that carries is compared from this share of the drive's limit on, smoothed over s.
_HELD_SHARE, _HELD_TIME = 0.05, 0.05
# Standard errors by which a wrong gain is outside; largest one of a confirmed gain, a share of it;
# gain that is no answer at all.
_ERRORS, _CONFIRMED, _NO_ANSWER = 3.0, 0.25, 0.05
# Samples from which the time between them is known; different positions, the first ones, that are
# compared with the encoder; longest step between samples that is integrated, s.
_SAMPLES, _PLACES, _STEP = 20, 400, 0.02
# A current of this multiple of breakaway must accelerate the joint visibly: when so many counts of
# movement are expected, it must have moved this share; but not before this time in s, since delay,
# current loop and filter take time, nor while a moving joint would hardly be slowed down.
_SURPLUS, _EXPECTED_COUNTS, _ANSWERED, _ANSWER_TIME = 1.5, 30.0, 0.1, 0.01
# A joint oscillates if such currents change their sign so often within so many s; a joint is not
# said to be blocked while they do.
_SWINGS, _SWING_TIME = 4, 0.5


class Supervision:
    """Compares measurements with commands, sample by sample.

    Attributes
    ----------
    delay, step : float
        Of the measured current, and mean time between samples, s.
    least : float
        The smallest current in A that is compared.
    bounds : tuple of float
        Lowest and highest position in rad.
    aim : float
        Place that is followed at present, rad; NaN if none is.
    friction : tuple of float, optional
        Largest friction current known so far in either direction, signed, A.
    acceleration : float
        k_t·n/J, rad/s² per A; NaN before it is known.
    """

    def __init__(self, drive: Drive, peak: float, torque: bool = False) -> None:
        self._drive, self._torque = drive, torque
        self.least = LEAST_SHARE * peak
        self.delay, self.step = 0.0, 1e-3
        self.bounds, self.aim = (-math.inf, math.inf), math.nan
        self.friction: tuple[float, float] | None = None
        self.acceleration = math.nan
        self._late = LONGEST_DELAY  # delay in s that explains why a joint does not respond
        self._first, self._count = math.nan, 0
        self._resolution = drive.position_resolution or 1e-6
        self._last: tuple[float, float] | None = None
        self._places = [math.nan]   # rad, each other than that before
        self._currents = CurrentCheck()
        self._held = np.zeros(2)    # measured current, and that which carries, smoothed, A
        self._velocities = VelocityCheck(resolution=self._resolution, zeros=True)
        self._window: deque[tuple[float, float]] = deque(maxlen=10)
        self._confirmed = False     # whether the measured current has been the commanded one
        self._swings: deque[float] = deque(maxlen=_SWINGS)  # when that sign changed, s
        self._pushed = 0.0          # sign of the latest current well above friction
        self._begin_answer(0.0, 0.0, 0.0)

    def say(self, current: float) -> str:
        """Return a motor current in A as text, in the unit of messages."""
        return self._drive.in_words(current, self._torque)

    def check(self, time: float, position: float, velocity: float | None,
              currents: tuple[float, float], carried: float = 0.0) -> bool:
        """Check a sample against the current before it; raise IdentificationError on fault.

        `currents` are the commanded and the measured one, A, of which `carried` holds the joint.
        Returns whether the sample is newer than the last one.
        """
        self._check_sample(time, position)
        if self._last is None:
            self._last, self._first = (time, position), time
            return True
        step = time - self._last[0]
        if step <= 0.0:
            return False
        if position != self._places[-1] and len(self._places) < _PLACES:
            self._places.append(position)
        self._last = time, position
        self._count += 1
        if self._count > _SAMPLES:
            self.step = (time - self._first) / self._count
        command, current = (one - carried for one in currents)
        if math.isfinite(current):
            self._currents.take(time, min(step, _STEP), command, current)
            gain = self._currents.gain(self.least)
            if math.isfinite(gain) and not 1.0 / FOLLOWS <= gain <= FOLLOWS:
                answer = self._currents.answer()
                self._refuse_late(answer)
                # Do not compare yet while the current has had no time to take effect.
                if answer.old_command > self.least:
                    self._refuse_gain(answer)
            self._compare_carried(min(step, _STEP), currents[1], carried)
        # The position must change as the velocity says.
        if velocity is None or not math.isfinite(velocity) or step > _STEP:
            self._velocities.interrupt()
        elif fault := self._velocities.take(time, position, velocity):
            raise IdentificationError(fault)
        if self.friction is not None and math.isfinite(self.acceleration):
            self._expect_motion(step, time, position, command, current)
        return True

    def encoder_fault(self) -> str:
        """Return what is wrong with the drive's `encoder_counts`, '' if nothing is."""
        return encoder_fault(self._drive, np.array(self._places)[1:])

    def _check_sample(self, time: float, position: float) -> None:
        if not math.isfinite(time):
            raise IdentificationError('the time of a sample is not finite')
        if not math.isfinite(position):
            raise IdentificationError('the joint position is not finite: encoder failure')
        if self._last is None:
            return
        gap, (low, high) = time - self._last[0], self.bounds
        if abs(gap) > LONGEST_GAP:
            what = 'no sample for' if gap > 0.0 else 'time went back by'
            raise IdentificationError(f'{what} {abs(gap):.2g} s; the limit is {LONGEST_GAP} s')
        if not low <= position <= high:
            why = ('a weight, a spring or a person moves it' if math.isnan(self.aim) else
                   f'{abs(position - self.aim):.2g} rad from its reference: somebody pushed it, '
                   'its controller is too slow, or it swings, as one with an elastic or heavy '
                   'link: request lower speeds')
            raise IdentificationError(
                f'the joint left its motion range of {high - low:.4g} rad: {why}')

    # The measured current must be the commanded one.

    def _compare_carried(self, step: float, measured: float, carried: float) -> None:
        """Raise if the current that holds the joint at rest is measured otherwise."""
        share = low_pass_weight(step, _HELD_TIME)
        self._held += share * (np.array([measured, carried]) - self._held)
        given, wanted = self._held.tolist()
        moves = abs(self._currents.commanded) > 0.1 * abs(wanted)
        if self._confirmed or moves or abs(wanted) < _HELD_SHARE * self._drive.current_limit:
            return
        if not 1.0 / FOLLOWS <= given / wanted <= FOLLOWS:
            raise IdentificationError(
                f'the measured current is {given / wanted:.2g} times the {self.say(wanted)} that '
                f'carry the joint by its model: {gain_fault(given / wanted, self._drive)}')

    def is_current_confirmed(self) -> bool:
        """Return whether the measured current is confirmed to be the commanded one."""
        answer = self._currents.answer()
        self._confirmed = (1.0 / FOLLOWS <= answer.gain <= FOLLOWS
                           and answer.error <= _CONFIRMED * answer.gain)
        return self._confirmed

    def require_confirmed_current(self) -> None:
        """Raise unless the measured current is confirmed; call it after the drive had time."""
        if self.is_current_confirmed():
            return
        answer = self._currents.answer()
        self._refuse_late(answer)
        self._refuse_gain(answer)
        raise IdentificationError(
            'the measured current cannot be confirmed to be the commanded one: its ratio is '
            f'{answer.gain:.2g} ± {answer.error:.2g}: effort is too noisy, or not measured')

    def _refuse_gain(self, answer: Answer) -> None:
        """Raise IdentificationError if the measured current is not the commanded one."""
        gain, error = answer.gain, _ERRORS * answer.error
        if 1.0 / FOLLOWS - error <= gain <= FOLLOWS + error:
            return
        commanded = self.say(self._currents.commanded)
        if self._confirmed and abs(gain) < 1.0:
            # A unit or a sign that is wrong would have been so before.
            raise IdentificationError(
                f'the measured current stays at {self.say(self._currents.measured)} while '
                f'{commanded} are commanded, although it followed smaller ones: the drive limits '
                'its current, which current_limit must say, or it was switched off')
        cause = ('effort is not measured, the drive is not enabled, or it ignores small currents '
                 '(a dead band)')
        if abs(gain) > max(error, _NO_ANSWER):
            cause = gain_fault(gain, self._drive)
            if 0.0 < gain < 1.0:
                cause += '; or the drive ignores small currents (a dead band)'
        raise IdentificationError(
            f'the measured current is {gain:.2g} times the commanded one of {commanded}: {cause}')

    # The drive must answer in time.

    def measure_delay(self) -> None:
        """Measure `delay`; call it within half a second after a current was switched off."""
        answer = self._currents.answer()
        if answer.correlation > ALIKE:
            self.delay = max(self.delay, answer.delay)

    def control(self, bandwidth: float) -> None:
        """Take note of the controller's bandwidth, rad/s, which limits the delay from now on."""
        self._late = min(LONGEST_DELAY, max(PHASE / bandwidth - self.step, 0.0))

    def require_controllable(self) -> None:
        """Raise if samples are too far apart or the measured current is too late, s."""
        # Time stamps jitter by some percent.
        if self.step > 1.05 / LEAST_RATE:
            raise IdentificationError(
                f'joint_states come {1.0 / self.step:.3g} times per second; to move a joint by '
                f'currents takes {LEAST_RATE:g}')
        if self.delay > LONGEST_DELAY:
            self._late = LONGEST_DELAY
            self._refuse_late(self._currents.answer()._replace(delay=self.delay))

    def _refuse_late(self, answer: Answer) -> None:
        """Raise if the measured current is the commanded one, but too late for the controller."""
        if (answer.delay <= self._late or answer.correlation <= ALIKE
                or not 1.0 / FOLLOWS <= answer.gain <= FOLLOWS):
            return
        cause = ('Machine or network are overloaded, or the driver delays currents or states: '
                 'shorten its filters and cycles')
        # While a current grows, a dead band or a limit looks like a delay.
        if not self._confirmed:
            cause += '. Or the drive ignores small currents (a dead band)'
        elif abs(self._currents.measured) < 0.8 * abs(self._currents.commanded):
            cause += f'. Or the drive limits its current, to {self.say(self._currents.measured)}'
        raise IdentificationError(
            f'the measured current follows the commanded one {answer.delay:.2g} s late, with the '
            f'right size (ratio {answer.gain:.2g}): too late to control a joint, the limit is '
            f'{self._late:.2g} s at {1.0 / self.step:.3g} Hz. {cause}')

    # The joint must move as its current says.

    def refuse_blocked(self, sign: int, reached: float, has_slope: bool) -> NoReturn:
        """Raise since the joint did not break free up to a current in A."""
        raise IdentificationError(
            f'the joint did not break free in the {"positive" if sign > 0 else "negative"} '
            f'direction up to {self.say(reached)}: it is blocked, its encoder is stuck, or ' + (
                'it takes a steeper ramp_slope or a longer ramp_period, or no ramp_slope'
                if has_slope else "the drive's current_limit is too low"))

    def refuse_unseen(self, reached: float) -> NoReturn:
        """Raise since the encoder has not counted up to a current in A."""
        raise IdentificationError(
            f'the encoder has not counted once up to {self.say(reached)}: it is stuck, or the '
            'joint is blocked; if its counts are coarse, request a ramp_slope')

    def refuse_unreliable(self, level: float) -> NoReturn:
        """Raise since the joint slid again and again at currents in A that had held it."""
        raise IdentificationError(
            f'no current holds the joint reliably: it slid at {self.say(level)}, although more '
            'held it before: it is pushed, or its friction varies with place or time')

    def refuse_restless(self) -> NoReturn:
        """Raise since the joint did not come to rest within `PATIENCE`."""
        raise IdentificationError(
            'the joint does not come to rest at zero current: it is driven by gravity, pushed, or '
            'oscillates')

    def oscillates(self) -> bool:
        """Return whether large currents of both signs alternate quickly."""
        return (len(self._swings) == _SWINGS and self._last is not None
                and self._last[0] - self._swings[0] < _SWING_TIME)

    def forget_oscillation(self) -> None:
        """Count from now on."""
        self._swings.clear()
        self._pushed = 0.0

    def _begin_answer(self, time: float, position: float, sign: float) -> None:
        self._sign, self._since, self._from = sign, time, position
        self._drift = 0.0
        if self._window and time > self._window[0][0]:
            self._drift = (position - self._window[0][1]) / (time - self._window[0][0])
        self._speed = self._expected = 0.0

    def _expect_motion(self, step: float, time: float, position: float, command: float,
                       measured: float) -> None:
        """Raise IdentificationError if the joint does not move as Newton's law says.

        Expected is the motion by the commanded or measured current, A, beyond friction.
        """
        assert self.friction is not None
        self._window.append((time, position))
        sign = math.copysign(1.0, command)
        enough = _SURPLUS * abs(self.friction[0] if sign > 0.0 else self.friction[1])
        surplus = sign * command - enough
        if surplus > 0.0 and sign != self._pushed:
            self._swings.append(time)
            self._pushed = sign
        if surplus <= 0.0 or sign != self._sign or step > _STEP:
            self._begin_answer(time, position, sign)
            return
        # A drive may be slow to give what is commanded.
        given = surplus if math.isnan(measured) else min(surplus, sign * measured - enough)
        self._speed += max(given, 0.0) * self.acceleration * step
        self._expected += self._speed * step
        duration = time - self._since
        least = max(_EXPECTED_COUNTS * self._resolution, _ANSWERED * abs(self._drift) * duration)
        if self._expected < least or duration < _ANSWER_TIME + self.delay:
            return
        # Accept a joint that keeps moving, and one whose motion changes, for instance brakes.
        moved = position - self._from
        gained = moved - self._drift * duration
        if max(sign * moved, sign * gained) < _ANSWERED * self._expected and not (
                len(self._swings) > 2 and time - self._swings[-2] < _SWING_TIME):
            self._refuse_late(self._currents.answer())
            raise IdentificationError(
                f'the joint does not move at {self.say(command)}, although less current broke it '
                'free before: it is blocked, at a stop, or held, as by a weight that its model '
                'does not carry; or the encoder is stuck, or coarser than encoder_counts')
        self._begin_answer(time, position, sign)
