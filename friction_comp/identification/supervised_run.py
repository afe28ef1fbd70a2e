# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Moves a joint sample by sample under supervision, and ends with zero current.

A motion is a generator that yields currents in A and receives samples. An unknown joint is first
broken free by a current ramp and pushed briefly: this shows the current that overcomes friction,
the acceleration per current, and whether the measured current is the commanded one. The velocity
controller (note, section 2.3) is a PI controller of ``e = (ω_ref - ω) + λ·(φ_ref - φ)``, which
keeps the joint in its range; its velocity is the filtered difference of encoder positions.

Measurements are compared with commands at every sample: the measured current is the commanded one,
with little delay; the position changes as the measured velocity says; a current well above
breakaway accelerates the joint; the joint stays in its range and near its reference. Anything else
(wiring, encoder, units, machine, a person) ends the run before a model is written: **zero current
whenever the joint does not respond as a joint should**. Until the measured current is confirmed,
only the first ramp is commanded, which ends when the joint moves.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Sequence
from itertools import chain
import math
from typing import NamedTuple, NoReturn

from numba import njit
import numpy as np

from friction_comp.drive import Drive
from friction_comp.facts.current import ALIKE, Answer, CurrentCheck, FOLLOWS, gain_fault, LATEST
from friction_comp.facts.motion import VelocityCheck
from friction_comp.identification.goal import IdentificationError, MotionGoal

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
PATIENCE, STILL_TIME = 10.0, 0.2
"""Longest time to come to rest, and standstill before each ramp, s."""
GAINS = (1.0, 0.4, 0.16, 0.064)
"""Factors of the controller's bandwidth: one is dropped when the joint oscillates with it."""
# Smallest commanded current that is compared, as a share of one that breaks the joint free; longest
# step between samples that is integrated, s. A joint oscillates if large currents change their sign
# so often within so many s; it is not said to be blocked while it does.
_LEAST_SHARE, _STEP, _SWINGS, _SWING_TIME = 0.02, 0.02, 4, 0.5
# Speed at which the short push ends, rad/s. Beyond this share of the drive's limit, a current grows
# only if the encoder has counted: a joint winds up before it breaks free, a dead encoder never
# counts. Share of the expected motion that a joint must have made.
_PUSH_SPEED, _BLIND_SHARE, _ANSWERED = 0.3, 0.1, 0.1


class Sample(NamedTuple):
    """What a motion is told of its joint at a time: s, rad and A; current is NaN if unknown."""

    time: float
    position: float
    current: float


Motion = Generator[float, Sample, None]


class NotFollowedError(IdentificationError):
    """The joint did not follow its reference: it oscillated, or the controller is too slow."""


class Supervision:
    """Compares measurements with commands, sample by sample; `peak` confirms currents, A."""

    def __init__(self, drive: Drive, peak: float, torque: bool = False) -> None:
        self._drive, self._torque = drive, torque
        self.least = _LEAST_SHARE * peak    # smallest current that is compared, A
        self.delay, self.step = 0.0, 1e-3   # of the measured current; mean between samples, s
        self.bounds = -math.inf, math.inf   # lowest and highest position, rad
        self.aim = math.nan                 # place that is followed at present, rad
        # Largest friction current known so far in either direction, signed, A.
        self.friction: tuple[float, float] | None = None
        self.acceleration = math.nan        # k_t·n/J once it is known, rad/s² per A
        self._late = LONGEST_DELAY  # delay in s that explains why a joint does not respond
        self._first, self._count = math.nan, 0
        self._resolution = drive.position_resolution or 1e-6
        self._last: tuple[float, float] | None = None
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
        self._last = time, position
        self._count += 1
        if self._count > 20:
            self.step = (time - self._first) / self._count
        command, current = (one - carried for one in currents)
        if math.isfinite(current):
            self._currents.take(time, min(step, _STEP), command, current)
            gain = self._currents.gain(self.least)
            if math.isfinite(gain) and not _follows(gain):
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
        share = 1.0 - math.exp(-step / 0.05)
        self._held += share * (np.array([measured, carried]) - self._held)
        given, wanted = self._held.tolist()
        moves = abs(self._currents.commanded) > 0.1 * abs(wanted)
        # Smaller ones are lost in noise.
        least = 0.05 * self._drive.current_limit
        if self._confirmed or moves or abs(wanted) < least:
            return
        if not _follows(given / wanted):
            raise IdentificationError(
                f'the measured current is {given / wanted:.2g} times the {self.say(wanted)} that '
                f'carry the joint by its model: {gain_fault(given / wanted, self._drive)}')

    def is_current_confirmed(self) -> bool:
        """Return whether the measured current is confirmed to be the commanded one."""
        answer = self._currents.answer()
        self._confirmed = _follows(answer.gain) and answer.error <= 0.25 * answer.gain
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
        gain, error = answer.gain, 3.0 * answer.error
        if 1.0 / FOLLOWS - error <= gain <= FOLLOWS + error:
            return
        commanded = self.say(self._currents.commanded)
        if self._confirmed and abs(gain) < 1.0:
            # A unit or a sign that is wrong would have been so before.
            raise IdentificationError(
                f'the measured current stays at {self.say(self._currents.measured)} while '
                f'{commanded} are commanded, although it followed smaller ones: the drive limits '
                'its current, which current_limit must say, or it was switched off')
        answers = abs(gain) > max(error, 0.05)
        cause = (gain_fault(gain, self._drive) if answers else
                 'effort is not measured, or the drive is not enabled')
        if not answers or 0.0 < gain < 1.0:
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
        if answer.delay <= self._late or answer.correlation <= ALIKE or not _follows(answer.gain):
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
        self._drift = self._speed = self._expected = 0.0
        if self._window and time > self._window[0][0]:
            self._drift = (position - self._window[0][1]) / (time - self._window[0][0])

    def _expect_motion(self, step: float, time: float, position: float, command: float,
                       measured: float) -> None:
        """Raise IdentificationError if the joint does not move as Newton's law says.

        Expected is the motion by the commanded or measured current, A, beyond friction.
        """
        assert self.friction is not None
        self._window.append((time, position))
        sign = math.copysign(1.0, command)
        enough = 1.5 * abs(self.friction[0] if sign > 0.0 else self.friction[1])
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
        # Delay, current loop and filter take time, and a moving joint is hardly slowed down.
        least = max(30.0 * self._resolution, _ANSWERED * abs(self._drift) * duration)
        if self._expected < least or duration < 0.01 + self.delay:
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


def _follows(gain: float) -> bool:
    return 1.0 / FOLLOWS <= gain <= FOLLOWS


def sample_rows(samples: Sequence[Sample]) -> np.ndarray:
    """Return samples as rows of s, rad and A, shape (N, 3).

    With ``np.array`` a control loop would be late after a motion of 20 s.
    """
    return np.fromiter(chain.from_iterable(samples), float, 3 * len(samples)).reshape(-1, 3)


def speed_over(samples: Sequence[Sample], sign: int, window: float) -> float:
    """Return the speed in direction `sign` over the last `window` s; 0 with too few samples."""
    last = samples[-1]
    for k in range(len(samples) - 2, -1, -1):
        elapsed = last.time - samples[k].time
        if elapsed >= 0.999 * window:
            return sign * (last.position - samples[k].position) / elapsed
    return 0.0


def acceleration_of_push(pushed: Sequence[Sample], coasted: Sequence[Sample], strength: float,
                         sign: int) -> float:
    """Estimate k_t·n/J in rad/s² per A from a push at constant current and the coasting after it.

    Friction is about the same in both, so the difference of accelerations is k_t·n/J times the
    current `strength`, A. The controller tolerates errors of tens of percent. NaN if it cannot be
    estimated.
    """
    time, position, _ = np.array(pushed).T
    # The current controller takes a moment.
    chosen = time >= time[0] + 2.5e-3
    if np.sum(chosen) < 5:
        chosen[:] = True
    if time.size < 3:
        return math.nan
    bend, top, _ = np.polyfit(time[chosen] - time[-1], sign * position[chosen], 2)
    ways = sign * np.array([sample.position for sample in coasted])
    stopped = coasted[int(np.argmax(ways))].time - coasted[0].time
    rate = float(2.0 * bend + top / max(stopped, 1e-4)) / strength
    return rate if top > 0.0 and math.isfinite(rate) and rate > 0.0 else math.nan


class Controller(NamedTuple):
    """Parameters of the velocity controller.

    An acceleration per current that is wrong by a factor of two is harmless. The push, about
    friction, is fed forward with the sign of the reference velocity, so that the integrator need
    not change at reversals; the measured mean does not depend on it.
    """

    acceleration_per_current: float     # k_t·n/J, rad/s² per A
    limit: float                        # A
    push_positive: float = 0.0          # A
    push_negative: float = 0.0          # A, negative
    bandwidth: float = BANDWIDTH        # rad/s


@njit(cache=True)
def controller_step(parameters: Controller, state: np.ndarray, reference_position: float,
                    reference_velocity: float, position: float, time_step: float) -> float:
    """Return the current in A for one sample (rad, rad/s, s), and advance the state in place.

    The state is position (NaN at first), velocity, integral and reference velocity.
    """
    if np.isnan(state[0]):
        state[0], state[3] = position, reference_velocity
    bandwidth = parameters.bandwidth
    gain = bandwidth / parameters.acceleration_per_current
    share = 1.0 - math.exp(-5.0 * bandwidth * time_step)
    state[1] += share * ((position - state[0]) / time_step - state[1])
    acceleration = (reference_velocity - state[3]) / time_step
    state[0], state[3] = position, reference_velocity
    blend = min(1.0, abs(reference_velocity) / 0.002)
    push = parameters.push_positive if reference_velocity > 0.0 else parameters.push_negative
    error = ((reference_velocity - state[1])
             + bandwidth / 6.0 * (reference_position - position))
    current = (blend * push + acceleration / parameters.acceleration_per_current
               + gain * error + state[2])
    if abs(current) > parameters.limit:
        return parameters.limit if current > 0.0 else -parameters.limit
    # The integrator stops at the limit, to avoid windup.
    state[2] += gain * bandwidth / 5.0 * error * time_step
    return current


class SupervisedRun(ABC):
    """One run of a motion, from standstill to zero current.

    Call `update` with every sample and apply the current that it returns, until `finished`.
    """

    def __init__(self, goal: MotionGoal, drive: Drive, torque: bool = False) -> None:
        goal.check(drive, torque)
        self.goal, self.drive = goal, drive
        self.error, self.finished = '', False   # why the run failed; whether it is complete
        self.phase = 'standstill'   # present step of the run; 'done' or 'failed' after it
        # Slope of the ramps in A/s and their largest current in A.
        self.ramp_slope = goal.ramp_slope or math.nan
        self.ramp_peak = goal.ramp_peak or drive.current_limit
        # Has to confirm that the measured current is the commanded one before the first push.
        self.supervision = Supervision(
            drive, goal.ramp_peak or _BLIND_SHARE * drive.current_limit, torque)
        self.sample = Sample(math.nan, math.nan, math.nan)  # the latest one
        self.start = math.nan       # position at the start, rad
        # Speeds in rad/s and commanded currents in A, magnitudes, of each direction: what broke the
        # joint free, at zero, and what cycles took. The controller relies on them, and on nothing
        # measured: measurements in a wrong unit must not drive the joint.
        self.known: dict[int, list[tuple[float, float]]] = {1: [], -1: []}
        self.gains = list(GAINS)            # those with which the joint did not oscillate
        self.warnings: list[str] = []
        self._resolution = drive.position_resolution or 1e-6
        self._slid, self._counted = 0, False    # latest slide's direction; encoder ever changed
        self._run = self._motion()
        next(self._run)
        self._begin, self._progress = math.nan, 0.0
        self._command = self._carried = 0.0     # of the latest sample, A

    @abstractmethod
    def _movements(self) -> Motion:
        """Yield currents and receive samples, once friction and inertia are known."""

    @abstractmethod
    def _bounds(self) -> tuple[float, float]:
        """Return the lowest and highest position in rad that the joint may have."""

    @abstractmethod
    def _time_left(self) -> float:
        """Return the estimated time to the end in s."""

    @property
    def remaining(self) -> float:
        """Estimated time to the end, s."""
        return 0.0 if self.finished or self.error else self._time_left()

    @property
    def progress(self) -> float:
        """Share of the run that is over, 0 to 1, never falling."""
        elapsed = self.sample.time - self._begin
        if self.finished:
            self._progress = 1.0
        elif elapsed > 0.0:
            self._progress = max(self._progress, min(
                0.999, elapsed / max(elapsed + self.remaining, 1e-9)))
        return self._progress

    def update(self, time: float, position: float, velocity: float | None = None,
               current: float = 0.0, carried: float = 0.0) -> float:
        """Take one sample of the joint and return the current to apply, A; zero when finished.

        Time is in s on any base (a sample that is not newer changes nothing), position in rad,
        velocity, which is only compared, in rad/s, the measured current in A, of which the joint's
        model says that `carried` holds it here: see `Carried`. Raises IdentificationError if the
        joint does not respond as it should; from then on every call returns zero.
        """
        if self.finished or self.error:
            return 0.0
        try:
            current = float(current) if math.isfinite(current) else math.nan
            if not self.supervision.check(float(time), float(position), velocity,
                                          (self._command, current), self._carried):
                return self._command
            command = self._run.send(Sample(float(time), float(position), current - carried))
        except StopIteration:
            self.finished, self.phase, self._command = True, 'done', 0.0
            return 0.0
        except Exception as error:
            self.abort(str(error))
            raise
        limit, self._carried = self.drive.current_limit, float(carried)
        self._command = min(max(command + self._carried, -limit), limit)
        return self._command

    def abort(self, reason: str = 'cancelled') -> None:
        """End the run: every later `update` returns zero current."""
        if not self.finished:
            self.error, self._command, self.phase = reason or 'cancelled', 0.0, 'failed'
            self._run.close()

    def _motion(self) -> Motion:
        self.sample = yield 0.0
        self.start, self._begin = self.sample.position, self.sample.time
        self.supervision.bounds = self._bounds()
        yield from self._standstill(STILL_TIME)
        yield from self._first_motion()
        yield from self._movements()
        yield from self._standstill(STILL_TIME)

    def _step(self, command: float) -> Generator[float, Sample, Sample]:
        self.sample = yield command
        return self.sample

    def _standstill(self, duration: float) -> Motion:
        """Wait at zero current until the joint has been at rest for a duration in s."""
        sample, self.supervision.aim = self.sample, math.nan
        begin, still_since, stood_at = sample.time, sample.time, sample.position
        while sample.time - still_since < duration:
            if sample.time - begin > PATIENCE + duration:
                raise IdentificationError('the joint does not come to rest at zero current: it is '
                                          'driven by gravity, pushed, or oscillates')
            sample = yield from self._step(0.0)
            if abs(sample.position - stood_at) > max(2.5 * self._resolution, 1e-5):
                still_since, stood_at = sample.time, sample.position

    # The first motion.

    def _first_motion(self) -> Motion:
        self.phase = 'push'
        rates = [(yield from self._short_push(1)), (yield from self._short_push(-1))]
        push = self.push
        if self.goal.ramp_slope is None:
            # Ramps reach what broke the joint free within so many s, and at most twice that.
            self.ramp_slope = push / 1.2
            self.ramp_peak = min(2.0 * push, self.drive.current_limit)
        self.supervision.require_controllable()
        # A joint's own breakaway torque accelerates it typically by 10 rad/s².
        typical = 10.0 / push
        rates = [rate for rate in rates if math.isfinite(rate) and rate > typical / 100.0]
        self.supervision.acceleration = max(rates, default=typical)

    def _short_push(self, sign: int) -> Generator[float, Sample, float]:
        """Break the joint free, push it briefly, let it coast; return k_t·n/J or NaN."""
        yield from self._standstill(STILL_TIME)
        sample = self.sample
        begin, home = sample.time, sample.position
        recent = deque([sample], maxlen=200)
        while speed_over(recent, sign, 0.01) <= _PUSH_SPEED / 10.0 or (
                sign * (sample.position - home) <= 8.0 * self._resolution):
            current = self._first_current(sample.time - begin)
            if current > self.ramp_peak:
                self._refuse_blocked(sign)
            sample = yield from self._step(sign * current)
            recent.append(sample)
            self._counted = self._counted or sample.position != home
        if not self.supervision.is_current_confirmed():
            # The response may still be on its way.
            yield from self._standstill(STILL_TIME + LATEST)
            self.supervision.require_confirmed_current()
            sample = self.sample
        if self.goal.ramp_slope is None:
            self.supervision.least = _LEAST_SHARE * current
        self.learn(sign, 0.0, current)
        strong = min(1.3 * current, self.drive.current_limit)
        room = sample.position + sign * 0.04 * self.goal.motion_range
        pushed, begin = [sample], sample.time
        # A single count is no speed.
        window = max(0.004, 4.0 * self._resolution / _PUSH_SPEED)
        while (sign * (sample.position - room) < 0.0 and sample.time - begin < 1.0
               and speed_over(pushed, sign, window) < _PUSH_SPEED):
            sample = yield from self._step(sign * strong)
            pushed.append(sample)
        coasted = [sample]
        while sample.time - coasted[0].time <= 2.0 and (
                len(coasted) < 25 or speed_over(coasted, sign, 0.02) > 0.0):
            sample = yield from self._step(0.0)
            coasted.append(sample)
        yield from self._standstill(STILL_TIME)
        self.supervision.measure_delay()
        way = sign * (sample.position - pushed[0].position)
        return (acceleration_of_push(pushed, coasted, strong, sign)
                if way >= 20.0 * self._resolution else math.nan)

    def _first_current(self, elapsed: float) -> float:
        """Return the current in A that breaks the joint free, a time in s after its beginning."""
        if self.goal.ramp_slope is not None:
            return self.ramp_peak * elapsed / 3.0
        limit = self.drive.current_limit
        # By a factor of e in 0.7 s.
        current = limit / 300.0 * math.expm1(elapsed / 0.7)
        if current > _BLIND_SHARE * limit and not self._counted:
            raise IdentificationError(
                f'the encoder has not counted once up to {self.supervision.say(current)}: it is '
                'stuck, or the joint is blocked; if its counts are coarse, request a ramp_slope')
        return current

    def _refuse_blocked(self, sign: int) -> NoReturn:
        raise IdentificationError(
            f'the joint did not break free in the {"positive" if sign > 0 else "negative"} '
            f'direction up to {self.supervision.say(self.ramp_peak)}: it is blocked, its encoder '
            'is stuck, or ' + ('it takes a steeper ramp_slope or a longer ramp_period, or no '
                               'ramp_slope' if self.goal.ramp_slope is not None else
                               "the drive's current_limit is too low"))

    def learn(self, sign: int, speed: float, current: float) -> None:
        """Take note of the current in A that a speed in rad/s took in one direction."""
        self.known[sign].append((speed, abs(current)))
        positive, negative = (max((level for _, level in own), default=math.nan)
                              for own in self.known.values())
        if positive > 0.0 and negative > 0.0:
            self.supervision.friction = positive, -negative

    @property
    def push(self) -> float:
        """Largest current in A that broke the joint free."""
        return max(own[0][1] for own in self.known.values())

    # The controller, from what has been measured so far.

    def bandwidth(self, gain: float) -> float:
        """Return the controller's bandwidth in rad/s with a gain that delay and encoder allow."""
        supervision = self.supervision
        # Holding a current and computing the velocity from two positions delay by half a sample
        # each.
        late = max(supervision.step + supervision.delay, 1e-6)
        stable = min(BANDWIDTH, DELAY_SHARE * PHASE / late)
        # An encoder count shall hardly change the current.
        least = min(own[0][1] for own in self.known.values())
        quiet = math.sqrt(0.06 * least * supervision.acceleration / self._resolution)
        return max(min(gain * stable, quiet), 0.5 * LEAST_BANDWIDTH)

    def _expected_current(self, sign: int, speed: float) -> float:
        """Return the magnitude in A of the current expected at a speed, by the last two."""
        (slow, low), (fast, high) = [*self.known[sign][:1], *self.known[sign]][-2:]
        rise = max(high - low, 0.0) / (fast - slow) if fast > slow else 0.0
        return high + rise * (speed - fast)

    def _plausible_current(self, speed: float) -> float:
        """Return the largest plausible current in A at a speed.

        It leaves room for gravity and control; a blocked joint or a stuck encoder exceeds it.
        """
        expected = max(self._expected_current(sign, speed) for sign in (1, -1))
        return min(self.drive.current_limit, max(3.0 * self.push, 2.0 * expected)
                   + 2.0 * self._accelerating_current(speed))

    def _accelerating_current(self, speed: float) -> float:
        return 10.0 * speed / self.goal.cycle(speed)[0] / self.supervision.acceleration

    # Following a reference.

    def _follow(self, reference: Callable[[float], tuple[float, float]], duration: float,
                allowance: float, speed: float, gain: float
                ) -> Generator[float, Sample, tuple[float, np.ndarray, list[float]]]:
        """Follow reference(t) -> (position, velocity); return start, sample rows, and commands.

        Raises NotFollowedError, after coming to rest, where a lower gain or nothing helps.
        """
        bandwidth, supervision = self.bandwidth(gain), self.supervision
        parameters = Controller(
            supervision.acceleration, self._plausible_current(speed),
            self._expected_current(1, speed), -self._expected_current(-1, speed), bandwidth)
        supervision.control(bandwidth)
        state = np.array([np.nan, 0.0, 0.0, 0.0])
        begin, last = self.sample.time, self.sample.time - 1e-3
        samples, commands, sample = [], [], self.sample
        while sample.time - begin < duration:
            position, velocity = reference(sample.time - begin)
            supervision.aim, off = position, abs(position - sample.position)
            command = controller_step(
                parameters, state, position, velocity, sample.position, sample.time - last)
            if supervision.oscillates():
                yield from self._calm(gain)
            if off > allowance:
                yield from self._stop_lagging(off, command, parameters)
            last = sample.time
            sample = yield from self._step(command)
            samples.append(sample)
            commands.append(command)
        return begin, sample_rows(samples), commands

    def _stop_lagging(self, off: float, command: float, parameters: Controller) -> Motion:
        lag = (f'the joint lags {off:.3g} rad behind its reference at '
               f'{self.supervision.say(abs(command))}')
        if parameters.bandwidth > 0.4 * BANDWIDTH or abs(command) >= 0.9 * parameters.limit:
            raise IdentificationError(
                f'{lag}: blocked, encoder stuck, or current limit '
                f'({self.supervision.say(parameters.limit)}, or what was plausible so far) too low')
        yield from self._standstill(STILL_TIME)
        raise NotFollowedError(
            f'{lag}: the velocity controller is slow ({parameters.bandwidth:.0f} rad/s), since '
            'currents or positions come late or seldom, counts are coarse, or the joint oscillates')

    def _calm(self, gain: float) -> Motion:
        """Come to rest after an oscillation, and use lower gains from now on."""
        error = NotFollowedError('the joint oscillates under its velocity controller: current or '
                                 'position come late, or its link is elastic')
        if self.gains == list(GAINS):
            self.warnings.append(f'{error}; it was slowed')
        self.gains = [lower for lower in self.gains if lower < gain]
        if not self.gains:
            raise IdentificationError(str(error))
        yield from self._standstill(STILL_TIME)
        self.supervision.forget_oscillation()
        raise error

    def _travel(self, target: float) -> Motion:
        start = self.sample.position
        distance = target - start
        if abs(distance) > 0.01 * self.goal.motion_range:
            self.phase = 'travel'
            duration = self._travel_time(distance)

            def reference(t: float) -> tuple[float, float]:
                # A quintic from rest to rest.
                share = min(max(t / duration, 0.0), 1.0)
                moved = distance * share ** 3 * (10.0 - 15.0 * share + 6.0 * share ** 2)
                return start + moved, distance / duration * 30.0 * (share * (1.0 - share)) ** 2

            gain = self.gains[0]
            try:
                yield from self._follow(
                    reference, duration, max(0.5 * abs(distance), 0.05 * self.goal.motion_range),
                    0.5 * self.goal.speeds[0], gain)
            except NotFollowedError:
                if gain in self.gains:
                    raise
                yield from self._travel(target)
                return
            self._slid = 1 if distance > 0.0 else -1
        yield from self._standstill(STILL_TIME)

    def _travel_time(self, distance: float) -> float:
        return max(1.875 * abs(distance) / min(0.5, self.goal.speeds[-1]), 0.5)
