# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs a motion sample by sample under its supervision, and ends it with zero current.

An unknown joint is first broken free by a current ramp and pushed briefly. This measures the
current that overcomes friction and the acceleration per current, which the velocity controller
needs, and shows whether the measured current is the commanded one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Sequence
from functools import partial
import math
from typing import NoReturn

import numpy as np

from friction_comp.drive import Drive
from friction_comp.facts.current import LATEST
from friction_comp.identification import velocity_control as control
from friction_comp.identification.goal import IdentificationError, MotionGoal
from friction_comp.identification.inertia import acceleration_of_push
from friction_comp.identification.profiles import KineticPoint, Sample, sample_rows, travel_state
from friction_comp.identification.supervision import LEAST_SHARE, LONGEST_GAP, Supervision

STILL_TIME = 0.2
"""s of standstill before each ramp."""
# Longest time to come to rest, s; a joint is at rest if it moves by at most this many counts or
# this angle in rad.
_PATIENCE, _STILL_COUNTS, _STILL_ANGLE = 10.0, 2.5, 1e-5
# Speed at which the short push ends, rad/s; fewest counts from which that speed, and the inertia,
# are computed. A joint's own breakaway torque accelerates it typically so much, rad/s².
_PUSH_SPEED, _SPEED_COUNTS, _PUSH_COUNTS, _TYPICAL = 0.3, 4.0, 20.0, 10.0
# Without a slope, the first current grows by a factor of e in so many s, from this share of the
# drive's limit; ramps reach what broke the joint free within so many s, and at most so many times
# that. Beyond the last share of the limit it grows only if the encoder has counted: a joint winds
# up before it breaks free, a dead encoder never counts.
_GROWTH, _FIRST_SHARE, _RISE_TIME, _BEYOND, _BLIND_SHARE = 0.7, 1.0 / 300.0, 1.2, 2.0, 0.1
# After an oscillation, the bandwidth falls by this factor, unless it is below that share.
_CALMER, _LEAST_CALMNESS = 0.4, 0.1


class TooSlowError(IdentificationError):
    """The velocity controller is too slow for what it has to follow."""


class OscillationError(IdentificationError):
    """The joint oscillates under its velocity controller."""


def speed_over(samples: Sequence[Sample], sign: int, window: float) -> float:
    """Return the speed in direction `sign` over the last `window` s; 0 with too few samples."""
    last = samples[-1]
    for k in range(len(samples) - 2, -1, -1):
        elapsed = last.time - samples[k].time
        if elapsed >= 0.999 * window:
            return sign * (last.position - samples[k].position) / elapsed
    return 0.0


class SupervisedRun(ABC):
    """One run of a motion, from standstill to zero current.

    Call `update` with every sample and apply the current that it returns, until `finished`. The
    motion is a generator that yields currents in A and receives samples.
    """

    def __init__(self, goal: MotionGoal, drive: Drive, torque: bool = False) -> None:
        goal.check(drive, torque)
        self.goal, self.drive = goal, drive
        self.error = ''             # why the run failed; empty if it did not
        self.finished = False       # whether the run is complete
        self.phase = 'standstill'   # present step of the run; 'done' or 'failed' after it
        self.progress = 0.0         # 0 to 1, never falling
        self.remaining = math.nan   # estimated time to the end, s
        self.say = partial(drive.in_words, torque=torque)   # a current as text
        # Slope of the ramps in A/s and their largest current in A.
        self.ramp_slope = goal.ramp_slope or math.nan
        self.ramp_peak = goal.ramp_peak or drive.current_limit
        # Has to confirm that the measured current is the commanded one before the first push.
        self.supervision = Supervision(
            drive, goal.ramp_peak or _BLIND_SHARE * drive.current_limit, self.say)
        # Largest friction current known so far in the positive and negative direction, signed, A.
        self.friction: tuple[float, float] | None = None
        self.acceleration = math.nan        # k_t·n/J, rad/s² per A; NaN before it is known
        self.sample = Sample(math.nan, math.nan, math.nan)  # the latest one
        self.start = math.nan               # position at the start, rad
        # Look-up table of commanded currents so far, for the controller's feedforward and limit:
        # measurements in a wrong unit must not drive the joint.
        self.commanded_points: list[KineticPoint] = []
        self.warnings: list[str] = []
        self._resolution = drive.position_resolution or 1e-6
        self._push = {1: 0.0, -1: 0.0}     # current that broke the joint free, magnitude in A
        self._slid = 0                     # direction of the latest slide
        self._counted = False              # whether the encoder has ever changed
        self._inertia_is_typical = False   # whether the push did not show it
        self._aim = math.nan               # place that is followed at present, rad
        self._calmness = 1.0               # factor of the controller's bandwidth
        self._run = self._motion()
        next(self._run)
        self._begin, self._last, self._estimated = math.nan, math.nan, -math.inf
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
            self._check(time, position)
            if time <= self._last:
                return self._command
            current = float(current) if math.isfinite(current) else math.nan
            self.supervision.check(
                float(time), float(position), velocity, (self._command, current), self._carried,
                self.friction, self.acceleration)
            command = self._run.send(Sample(float(time), float(position), current - carried))
        except StopIteration:
            self.finished, self.phase = True, 'done'
            self.progress, self.remaining, self._command = 1.0, 0.0, 0.0
            return 0.0
        except Exception as error:
            self.abort(str(error))
            raise
        self._last = float(time)
        self._estimate(self._last)
        limit, self._carried = self.drive.current_limit, float(carried)
        self._command = min(max(command + self._carried, -limit), limit)
        return self._command

    def abort(self, reason: str = 'cancelled') -> None:
        """End the run: every later `update` returns zero current."""
        if not self.finished:
            self.error, self._command, self.remaining = reason or 'cancelled', 0.0, 0.0
            self.phase = 'failed'
            self._run.close()

    def _check(self, time: float, position: float) -> None:
        if not math.isfinite(time):
            raise IdentificationError('the time of a sample is not finite')
        if not math.isfinite(position):
            raise IdentificationError('the joint position is not finite: encoder failure')
        if math.isnan(self._last):
            return
        if abs(time - self._last) > LONGEST_GAP:
            what = 'no sample for' if time > self._last else 'time went back by'
            raise IdentificationError(
                f'{what} {abs(time - self._last):.2g} s; the limit is {LONGEST_GAP} s')
        low, high = self._bounds()
        if not low <= position <= high:
            why = self._why_slow() or (
                ': a weight, a spring or a person moves it' if math.isnan(self._aim) else
                f', {abs(position - self._aim):.2g} rad from its reference: somebody pushed it, or '
                'it swings, as one with an elastic or heavy link: request lower speeds')
            raise IdentificationError(
                f'the joint left its motion range of {high - low:.4g} rad{why}')

    def _estimate(self, now: float) -> None:
        """Update `remaining` and `progress` ten times per second of the joint's time."""
        if math.isnan(self._begin):
            self._begin = now
        elif now - self._estimated < 0.1:
            return
        self._estimated, self.remaining = now, self._time_left()
        elapsed = now - self._begin
        self.progress = max(self.progress, min(
            0.999, elapsed / max(elapsed + self.remaining, 1e-9)))

    def _motion(self) -> Generator[float, Sample, None]:
        self.sample = yield 0.0
        self.start = self.sample.position
        yield from self._standstill(STILL_TIME)
        yield from self._first_motion()
        yield from self._movements()
        yield from self._standstill(STILL_TIME)

    def _step(self, command: float) -> Generator[float, Sample, Sample]:
        self.sample = yield command
        return self.sample

    def _standstill(self, duration: float) -> Generator[float, Sample, None]:
        """Wait at zero current until the joint has been at rest for a duration in s."""
        sample, self._aim = self.sample, math.nan
        begin, still_since, stood_at = sample.time, sample.time, sample.position
        while sample.time - still_since < duration:
            if sample.time - begin > _PATIENCE + duration:
                raise IdentificationError(
                    'the joint does not come to rest at zero current: it is driven by gravity, '
                    'pushed, or oscillates')
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
        push = max(self._push.values())
        if self.goal.ramp_slope is None:
            self.ramp_slope = push / _RISE_TIME
            self.ramp_peak = min(_BEYOND * push, self.drive.current_limit)
        self.supervision.require_controllable()
        typical = _TYPICAL / push
        rates = [rate for rate in rates if math.isfinite(rate) and rate > typical / 100.0]
        self._inertia_is_typical = not rates
        self.acceleration = max(rates, default=typical)

    def _short_push(self, sign: int) -> Generator[float, Sample, float]:
        """Break the joint free, push it briefly, let it coast; return k_t·n/J or NaN."""
        peak = self.ramp_peak
        yield from self._standstill(STILL_TIME)
        sample = self.sample
        begin, home = sample.time, sample.position
        recent = deque([sample], maxlen=200)
        while True:
            current = self._first_current(sample.time - begin)
            if current > peak:
                self._refuse_blocked(sign, peak)
            sample = yield from self._step(sign * current)
            recent.append(sample)
            self._counted = self._counted or sample.position != home
            if speed_over(recent, sign, 0.01) > _PUSH_SPEED / 10.0 and (
                    sign * (sample.position - home) > 8.0 * self._resolution):
                break
        if not self.supervision.is_current_confirmed():
            # The response may still be on its way.
            yield from self._standstill(STILL_TIME + LATEST)
            self.supervision.require_confirmed_current()
            sample = self.sample
        self._push[sign] = current
        if self.goal.ramp_slope is None:
            self.supervision.least = LEAST_SHARE * current
        self._update_friction()
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
        while speed_over(coasted, sign, 0.02) > 0.0 or len(coasted) < 25:
            sample = yield from self._step(0.0)
            coasted.append(sample)
            if sample.time - coasted[0].time > 2.0:
                break
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
            raise IdentificationError(
                f'the encoder has not counted once up to {self.say(current)}: it is stuck, or the '
                'joint is blocked; if its counts are coarse, request a ramp_slope')
        return current

    def _update_friction(self) -> None:
        if 0.0 not in self._push.values():
            positive, negative = (
                sign * max([self._push[sign]] + [abs(point.current) for point in
                                                 self.commanded_points if point.speed * sign > 0.0])
                for sign in (1, -1))
            self.friction = positive, negative

    def _refuse_blocked(self, sign: int, reached: float) -> NoReturn:
        raise IdentificationError(
            f'the joint did not break free in the {"positive" if sign > 0 else "negative"} '
            f'direction up to {self.say(reached)}: it is blocked, its encoder is stuck, or ' + (
                "the drive's current_limit is too low" if self.goal.ramp_slope is None else
                'it takes a steeper ramp_slope or a longer ramp_period, or no ramp_slope'))

    # The controller, from what has been measured so far.

    def _controller(self, factor: float, speed: float) -> control.Controller:
        return control.Controller(
            self.acceleration, self._plausible_current(speed), self._expected_current(1, speed),
            self._expected_current(-1, speed), self._bandwidth(factor))

    def _quiet(self) -> float:
        """Return the bandwidth, rad/s, at which an encoder count hardly changes the current."""
        return math.sqrt(
            0.06 * min(self._push.values()) * self.acceleration / self._resolution)

    def _bandwidth(self, factor: float = 1.0) -> float:
        """Return the controller's bandwidth in rad/s that delay, encoder and joint allow."""
        # Holding a current and computing the velocity from two positions delay by half a sample
        # each.
        late = max(self.supervision.step + self.supervision.delay, 1e-6)
        stable = min(control.BANDWIDTH, control.DELAY_SHARE * control.PHASE / late)
        return max(min(factor * self._calmness * stable, self._quiet()),
                   0.5 * control.LEAST_BANDWIDTH)

    def _why_slow(self, factor: float = 1.0) -> str:
        """Return what keeps the controller slow; '' if it is not slow, or not known yet."""
        if (not math.isfinite(self.acceleration)
                or (bandwidth := self._bandwidth(factor)) > 0.4 * control.BANDWIDTH):
            return ''
        delay = self.supervision.delay
        cause = ('encoder counts are coarse' if bandwidth >= self._quiet() else
                 'the joint oscillates, or sticks and slips, at higher gains'
                 if factor * self._calmness < 1.0 else
                 f'the measured current is {delay:.2g} s late' if delay > 0.0 else
                 'joint states come seldom')
        return f': the velocity controller is slow ({bandwidth:.0f} rad/s), since {cause}'

    def _plausible_current(self, speed: float) -> float:
        """Return the largest plausible current in A at a speed.

        Beyond measured speeds, friction grows at most in proportion to speed. Twice that, plus
        twice the profile's acceleration, leaves room for gravity and control; a blocked joint or a
        stuck encoder exceeds it.
        """
        push = max(self._push.values())
        known = max([push] + [
            abs(point.current) * max(1.0, speed / abs(point.speed))
            for point in self.commanded_points[-2:]])
        return float(min(self.drive.current_limit, max(3.0 * push, 2.0 * known)
                         + 2.0 * self._accelerating_current(speed)))

    def _accelerating_current(self, speed: float) -> float:
        return 10.0 * speed / self.goal.cycle(speed)[0] / self.acceleration

    def _expected_current(self, sign: int, speed: float) -> float:
        """Return the current expected at a speed, from the look-up table so far."""
        known = [point for point in self.commanded_points if point.speed * sign > 0.0][-2:]
        if not known:
            return sign * self._push[sign]
        current, last = known[-1].current, known[-1]
        if last.speed != known[0].speed:
            rise = (last.current - known[0].current) / (last.speed - known[0].speed)
            current += max(rise, 0.0) * (sign * speed - last.speed)
        return current if current * sign > 0.0 else sign * self._push[sign]

    # Following a reference.

    def _follow(self, reference: Callable[[float], tuple[float, float]], duration: float,
                allowance: float, speed: float, factor: float = 1.0
                ) -> Generator[float, Sample, tuple[float, np.ndarray, list[float]]]:
        """Follow reference(t) -> (position, velocity); return start, sample rows, and commands."""
        parameters = self._controller(factor, speed)
        self.supervision.control(parameters.bandwidth)
        state = control.velocity_controller_state()
        begin, last = self.sample.time, self.sample.time - 1e-3
        samples, commands, sample = [], [], self.sample
        while sample.time - begin < duration:
            position, velocity = reference(sample.time - begin)
            self._aim = position
            command = control.velocity_controller_step(
                parameters, state, position, velocity, sample.position, sample.time - last)
            if self.supervision.oscillates():
                raise OscillationError(
                    'the joint oscillates under its velocity controller: current or position come '
                    'late, or its link is elastic')
            if abs(position - sample.position) > allowance:
                lag = (f'the joint lags {abs(position - sample.position):.3g} rad behind its '
                       f'reference at {self.say(abs(command))}')
                why = self._why_slow(factor)
                if why and abs(command) < 0.9 * parameters.limit:
                    raise TooSlowError(lag + why)
                raise IdentificationError(
                    f'{lag}: blocked, encoder stuck, or current limit '
                    f'({self.say(parameters.limit)}, or what was plausible so far) too low')
            last = sample.time
            sample = yield from self._step(command)
            samples.append(sample)
            commands.append(command)
        return begin, sample_rows(samples), commands

    def _travel(self, target: float) -> Generator[float, Sample, None]:
        start = self.sample.position
        distance = target - start
        if abs(distance) > 0.01 * self.goal.motion_range:
            self.phase = 'travel'
            duration = self._travel_time(distance)

            def reference(t: float) -> tuple[float, float]:
                position, velocity = travel_state(t, distance, duration)
                return start + position, velocity

            try:
                yield from self._follow(
                    reference, duration, max(0.5 * abs(distance), 0.05 * self.goal.motion_range),
                    speed=0.5 * self.goal.speeds[0])
            except OscillationError as error:
                yield from self._calm(error)
                yield from self._travel(target)
                return
            self._slid = 1 if distance > 0.0 else -1
        yield from self._standstill(STILL_TIME)

    def _calm(self, error: OscillationError) -> Generator[float, Sample, None]:
        """Come to rest after an oscillation, and lower the controller's gains from now on."""
        if self._calmness < _LEAST_CALMNESS:
            raise error
        if self._calmness == 1.0:
            self.warnings.append(f'{error}; it was slowed')
        self._calmness *= _CALMER
        yield from self._standstill(STILL_TIME)
        self.supervision.forget_oscillation()

    def _travel_time(self, distance: float) -> float:
        return max(1.875 * abs(distance) / min(0.5, self.goal.speeds[-1]), 0.5)
