# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Moves a joint sample by sample under its supervision, and ends with zero current.

A motion is a generator that yields currents in A and receives samples. An unknown joint is first
broken free by a current ramp and pushed briefly. This measures the current that overcomes friction
and the acceleration per current, which the velocity controller needs, and shows whether the
measured current is the commanded one.

The controller (note, section 2.3) is a PI controller that acts on ``e = (ω_ref - ω) + λ·(φ_ref -
φ)``. The position term keeps the joint in its range during long cycles, and compensates for the
coarse velocity of the encoder. The velocity is the difference of encoder positions, filtered by a
first-order low pass.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Sequence
from itertools import chain
import math
from typing import NamedTuple

from numba import njit
import numpy as np

from friction_comp.drive import Drive
from friction_comp.facts.current import LATEST
from friction_comp.identification.goal import IdentificationError, MotionGoal
from friction_comp.identification.supervision import (
    BANDWIDTH,
    DELAY_SHARE,
    LEAST_BANDWIDTH,
    LEAST_SHARE,
    PATIENCE,
    PHASE,
    Supervision,
)
from friction_comp.low_pass import low_pass_weight

STILL_TIME = 0.2
"""s of standstill before each ramp."""
GAINS = (1.0, 0.4, 0.16, 0.064)
"""Factors of the controller's bandwidth: one is dropped when the joint oscillates with it."""
# A joint is at rest if it moves by at most this many counts or this angle in rad.
_STILL_COUNTS, _STILL_ANGLE = 2.5, 1e-5
# Speed at which the short push ends, rad/s; fewest counts from which that speed, and the inertia,
# are computed. A joint's own breakaway torque accelerates it typically so much, rad/s².
_PUSH_SPEED, _SPEED_COUNTS, _PUSH_COUNTS, _TYPICAL = 0.3, 4.0, 20.0, 10.0
# Without a slope, the first current grows by a factor of e in so many s, from this share of the
# drive's limit; ramps reach what broke the joint free within so many s, and at most so many times
# that. Beyond the last share of the limit it grows only if the encoder has counted: a joint winds
# up before it breaks free, a dead encoder never counts.
_GROWTH, _FIRST_SHARE, _RISE_TIME, _BEYOND, _BLIND_SHARE = 0.7, 1.0 / 300.0, 1.2, 2.0, 0.1
# s that the current controller takes after a step of current; rad/s of reference velocity over
# which the controller's push fades in.
_TRANSIENT, _BLEND_VELOCITY = 2.5e-3, 0.002


class Sample(NamedTuple):
    """What a motion is told of its joint at a time: s, rad and A; current is NaN if unknown."""

    time: float
    position: float
    current: float


class NotFollowedError(IdentificationError):
    """The joint did not follow its reference: it oscillated, or the controller is too slow."""


def sample_rows(samples: Sequence[Sample]) -> np.ndarray:
    """Return samples as rows of s, rad and A, shape (N, 3).

    Four to forty times as fast as ``np.array``, with which a control loop would be late after a
    motion of 20 s.
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
    chosen = time >= time[0] + _TRANSIENT
    if np.sum(chosen) < 5:
        chosen[:] = True
    if time.size < 3:
        return math.nan
    bend, top, _ = np.polyfit(time[chosen] - time[-1], sign * position[chosen], 2)
    ways = sign * np.array([sample.position for sample in coasted])
    stopped = coasted[int(np.argmax(ways))].time - coasted[0].time
    rate = float(2.0 * bend + top / max(stopped, 1e-4)) / strength
    return rate if top > 0.0 and math.isfinite(rate) and rate > 0.0 else math.nan


def travel_state(time: float, distance: float, duration: float) -> tuple[float, float]:
    """Return position (rad) and velocity (rad/s) of a quintic from rest to rest."""
    share = min(max(time / duration, 0.0), 1.0)
    position = distance * share ** 3 * (10.0 - 15.0 * share + 6.0 * share ** 2)
    return position, distance / duration * 30.0 * (share * (1.0 - share)) ** 2


class Controller(NamedTuple):
    """Parameters of the velocity controller.

    An acceleration per current that is wrong by a factor of two is harmless: the phase margin stays
    near 40 degrees. The push, about friction, is fed forward with the sign of the reference
    velocity, so that the integrator need not change at reversals; the measured mean does not depend
    on it.
    """

    acceleration_per_current: float     # k_t·n/J, rad/s² per A
    limit: float                        # A
    push_positive: float = 0.0          # A
    push_negative: float = 0.0          # A, negative
    bandwidth: float = BANDWIDTH        # rad/s


def controller_state() -> np.ndarray:
    """Return a controller at rest: position, velocity, integral, reference velocity."""
    return np.array([np.nan, 0.0, 0.0, 0.0])


@njit(cache=True)
def controller_step(parameters: Controller, state: np.ndarray, reference_position: float,
                    reference_velocity: float, position: float, time_step: float) -> float:
    """Return the current in A for one sample (rad, rad/s, s), and advance the state in place."""
    if np.isnan(state[0]):
        state[0], state[3] = position, reference_velocity
    bandwidth = parameters.bandwidth
    gain = bandwidth / parameters.acceleration_per_current
    share = low_pass_weight(time_step, 1.0 / (5.0 * bandwidth))
    state[1] += share * ((position - state[0]) / time_step - state[1])
    acceleration = (reference_velocity - state[3]) / time_step
    state[0], state[3] = position, reference_velocity
    blend = min(1.0, abs(reference_velocity) / _BLEND_VELOCITY)
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
        self.error = ''             # why the run failed; empty if it did not
        self.finished = False       # whether the run is complete
        self.phase = 'standstill'   # present step of the run; 'done' or 'failed' after it
        # Slope of the ramps in A/s and their largest current in A.
        self.ramp_slope = goal.ramp_slope or math.nan
        self.ramp_peak = goal.ramp_peak or drive.current_limit
        # Has to confirm that the measured current is the commanded one before the first push.
        self.supervision = Supervision(
            drive, goal.ramp_peak or _BLIND_SHARE * drive.current_limit, torque)
        self.sample = Sample(math.nan, math.nan, math.nan)  # the latest one
        self.start = math.nan               # position at the start, rad
        # Speeds in rad/s and commanded currents in A, magnitudes, of each direction: what broke the
        # joint free, at zero, and what cycles took. The controller relies on them, and on nothing
        # measured: measurements in a wrong unit must not drive the joint.
        self.known: dict[int, list[tuple[float, float]]] = {1: [], -1: []}
        self.gains = list(GAINS)            # those with which the joint did not oscillate
        self.warnings: list[str] = []
        self._resolution = drive.position_resolution or 1e-6
        self._slid = 0                     # direction of the latest slide
        self._counted = False              # whether the encoder has ever changed
        self._inertia_is_typical = False   # whether the push did not show it
        self._run = self._motion()
        next(self._run)
        self._begin, self._progress = math.nan, 0.0
        self._command = self._carried = 0.0     # of the latest sample, A

    @abstractmethod
    def _movements(self) -> Generator[float, Sample, None]:
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

        Time is in s on any base (a sample that is not newer changes nothing), position in rad, the
        velocity in rad/s is only compared with the change of position, the measured current is in
        A. What the joint's model says is `carried` here, A, is part of the current to apply, and is
        subtracted from what is measured: see `Carried`. Raises IdentificationError if the joint
        leaves its range, the encoder fails, or the drive does not respond as expected; from then on
        every call returns zero.
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

    def _motion(self) -> Generator[float, Sample, None]:
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

    def _standstill(self, duration: float) -> Generator[float, Sample, None]:
        """Wait at zero current until the joint has been at rest for a duration in s."""
        sample, self.supervision.aim = self.sample, math.nan
        begin, still_since, stood_at = sample.time, sample.time, sample.position
        while sample.time - still_since < duration:
            if sample.time - begin > PATIENCE + duration:
                self.supervision.refuse_restless()
            sample = yield from self._step(0.0)
            if abs(sample.position - stood_at) > max(
                    _STILL_COUNTS * self._resolution, _STILL_ANGLE):
                still_since, stood_at = sample.time, sample.position

    # The first motion.

    def _first_motion(self) -> Generator[float, Sample, None]:
        self.phase = 'push'
        rates = []
        for sign in (1, -1):
            rates.append((yield from self._short_push(sign)))
        push = self.push
        if self.goal.ramp_slope is None:
            self.ramp_slope = push / _RISE_TIME
            self.ramp_peak = min(_BEYOND * push, self.drive.current_limit)
        self.supervision.require_controllable()
        typical = _TYPICAL / push
        rates = [rate for rate in rates if math.isfinite(rate) and rate > typical / 100.0]
        self._inertia_is_typical = not rates
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
                self.supervision.refuse_blocked(
                    sign, self.ramp_peak, self.goal.ramp_slope is not None)
            sample = yield from self._step(sign * current)
            recent.append(sample)
            self._counted = self._counted or sample.position != home
        if not self.supervision.is_current_confirmed():
            # The response may still be on its way.
            yield from self._standstill(STILL_TIME + LATEST)
            self.supervision.require_confirmed_current()
            sample = self.sample
        if self.goal.ramp_slope is None:
            self.supervision.least = LEAST_SHARE * current
        self.learn(sign, 0.0, current)
        strong = min(1.3 * current, self.drive.current_limit)
        room = sample.position + sign * 0.04 * self.goal.motion_range
        pushed, begin = [sample], sample.time
        # A single count is no speed.
        window = max(0.004, _SPEED_COUNTS * self._resolution / _PUSH_SPEED)
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
                if way >= _PUSH_COUNTS * self._resolution else math.nan)

    def _first_current(self, elapsed: float) -> float:
        """Return the current in A that breaks the joint free, a time in s after its beginning."""
        if self.goal.ramp_slope is not None:
            return self.ramp_peak * elapsed / 3.0
        limit = self.drive.current_limit
        current = _FIRST_SHARE * limit * math.expm1(elapsed / _GROWTH)
        if current > _BLIND_SHARE * limit and not self._counted:
            self.supervision.refuse_unseen(current)
        return current

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

        Twice what is expected, plus twice the profile's acceleration, leaves room for gravity and
        control; a blocked joint or a stuck encoder exceeds it.
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
        state = controller_state()
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

    def _stop_lagging(self, off: float, command: float, parameters: Controller
                      ) -> Generator[float, Sample, None]:
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

    def _calm(self, gain: float) -> Generator[float, Sample, None]:
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

    def _travel(self, target: float) -> Generator[float, Sample, None]:
        start = self.sample.position
        distance = target - start
        if abs(distance) > 0.01 * self.goal.motion_range:
            self.phase = 'travel'
            duration = self._travel_time(distance)

            def reference(t: float) -> tuple[float, float]:
                position, velocity = travel_state(t, distance, duration)
                return start + position, velocity

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
