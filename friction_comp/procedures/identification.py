# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification of a drive, sample by sample (note, sections 2.3 and 2.4).

The procedure is written as a script that yields a current and is handed the next sample: read
`IdentificationRun._script` from top to bottom. Whatever calls `update` once a sample runs it, be
it a ROS node or a plain loop.
"""

from __future__ import annotations

from collections import deque, namedtuple
import math

import numpy as np

from friction_comp.errors import InputError
from friction_comp.procedures.breakaway import breakaway_currents, BreakawayRecords
from friction_comp.procedures.excitation import at_position, at_ramp, at_travel, at_velocity
from friction_comp.procedures.identification_data import (
    IdentificationError,
    IdentificationGoal,
    IdentificationResult,
)
from friction_comp.procedures.kinetic import constant_velocity_currents, merge_points
from friction_comp.procedures.push import acceleration_of_push
from friction_comp.procedures.sigmoid_fit import fit_sigmoid
from friction_comp.procedures.velocity_control import (
    BANDWIDTH,
    LIMIT,
    velocity_controller_parameters,
    velocity_controller_state,
    velocity_controller_step,
)

__all__ = ['IdentificationError', 'IdentificationGoal', 'IdentificationResult',
           'IdentificationRun']

LONGEST_GAP = 0.25      # s without a sample after which the joint is out of control
STILL_TIME = 0.2        # s of standstill asked for before each ramp
STILL_PATIENCE = 10.0   # s to come to rest
CUT_SPEED = 0.05        # rad/s at which a ramp is cut: well beyond the run-away that is looked for
PUSH_SPEED = 0.3        # rad/s that the inertia's short push aims at
REST_SHARE = 0.1        # of the ramp period at zero current after each ramp, as in Eq. 8

Sample = namedtuple('Sample', 'time position current temperature')


class IdentificationRun:
    """One identification, from standstill to zero current.

    Call `update` with every sample and apply the current that it returns, until `finished`. Then
    `result()` fits the model.

    Parameters
    ----------
    goal : IdentificationGoal
    drive : Drive

    Attributes
    ----------
    phase : str
        'standstill', 'push', 'velocity', 'travel', 'breakaway', 'done', or 'failed'.
    progress : float
        0 to 1, never falling.
    remaining : float
        Estimated time to the end in s.
    finished : bool
        Whether the measurement is complete.
    error : str
        Why the run failed; empty while it has not.

    Raises
    ------
    InputError
        If the drive cannot do what the goal asks for.
    """

    def __init__(self, goal, drive):
        goal.check(drive)
        self.goal, self.drive = goal, drive
        self.phase, self.error, self.finished = 'standstill', '', False
        self.progress, self.remaining = 0.0, math.nan
        self.warnings = []
        self._resolution = drive.position_resolution or 1e-6
        self._acceleration = math.nan   # k_t·n/J
        self._push = {1: 0.0, -1: 0.0}  # current that overcomes friction, per direction
        self._reached = {1: 0.5, -1: 0.5}  # share of the ramp at which the joint broke free
        self._points, self._ramps = [], []
        self._sample, self._command, self._centre, self._begin = None, 0.0, None, None
        self._done_speeds, self._done_ramps = 0, 0
        self._result = None
        self._bandwidth = BANDWIDTH
        _compile()
        self._steps = self._script()
        next(self._steps)

    def update(self, time, position, velocity=None, current=0.0, temperature=None):
        """Take one sample of the joint and return the current to apply.

        Parameters
        ----------
        time : float
            s, on any time base; a sample that is not newer than the last one changes nothing.
        position : float
            rad.
        velocity : float, optional
            Not used: the position is finer.
        current : float
            Measured motor current in A.
        temperature : float, optional
            Motor temperature in degrees Celsius.

        Returns
        -------
        float
            A; zero when finished.

        Raises
        ------
        IdentificationError
            When the joint leaves its range, the encoder fails, or the drive does not do what
            identification needs. From then on every call returns zero.
        """
        if self.finished or self.error:
            return 0.0
        try:
            self._check(time, position)
            if self._sample is not None and time <= self._sample.time:
                return self._command
            if not math.isfinite(current):
                current = math.nan
            warmth = math.nan if temperature is None else float(temperature)
            sample = Sample(float(time), float(position), float(current), warmth)
            command = self._steps.send(sample)
        except StopIteration:
            self.phase, self.finished = 'done', True
            self.progress, self.remaining, self._command = 1.0, 0.0, 0.0
            return 0.0
        except IdentificationError as error:
            self.abort(str(error))
            raise
        self._sample = sample
        limit = self.drive.current_limit
        self._command = min(max(command, -limit), limit)
        return self._command

    def abort(self, reason='cancelled'):
        """End the run: every later `update` returns zero current."""
        if not self.finished:
            self.error, self.phase, self._command = reason, 'failed', 0.0
            self.remaining = 0.0

    def result(self):
        """Fit the curve of Eq. 6, evaluate the ramps and return an `IdentificationResult`.

        Raises
        ------
        IdentificationError
            If the run is not finished, or too many ramps show no breakaway.
        """
        if not self.finished:
            raise IdentificationError(f'identification is not complete: {self.error or self.phase}')
        if self._result is None:
            points = merge_points(self._points)
            sigmoid, error = fit_sigmoid([p.speed for p in points], [p.current for p in points])
            records = self._records()
            self._result = IdentificationResult(
                points=points, sigmoid=sigmoid, sigmoid_error=error,
                breakaway=records.statistics(), records=records,
                acceleration_per_current=self._acceleration, goal=self.goal,
                warnings=list(self.warnings))
        return self._result

    # The procedure.

    def _script(self):
        """Yield currents, be handed samples; the whole of sections 2.3 and 2.4 in order."""
        sample = yield 0.0
        self._centre, self._begin = sample.position, sample.time
        self._sample = sample
        yield from self._standstill(STILL_TIME)
        self.phase = 'push'
        rates = []
        for sign in (1, -1):
            rates.append((yield from self._short_push(sign)))
        self._acceleration = self._combine(rates)
        for speed in self.goal.speeds:
            yield from self._constant_velocity(speed)
            self._done_speeds += 1
        yield from self._travel(self._centre)
        for cycle in range(self.goal.breakaway_cycles):
            for sign in (1, -1):
                if abs(self._sample.position - self._centre) > 0.2 * self.goal.motion_range:
                    yield from self._travel(self._centre)
                self.phase = 'breakaway'
                yield from self._ramp(sign, cycle)
                self._done_ramps += 1

    def _step(self, command):
        """Apply a current and return the next sample."""
        sample = yield command
        self._sample = sample
        self._estimate(sample.time)
        return sample

    def _standstill(self, duration):
        """Wait at zero current until the joint has stood for `duration`; return for how long."""
        sample = self._sample
        begin, still_since, place = sample.time, sample.time, sample.position
        while sample.time - still_since < duration:
            if sample.time - begin > STILL_PATIENCE + duration:
                raise IdentificationError(
                    'the joint does not come to rest at zero current: it is driven by gravity or '
                    'pushed')
            sample = yield from self._step(0.0)
            if abs(sample.position - place) > 2.5 * self._resolution:
                still_since, place = sample.time, sample.position
        return sample.time - still_since

    def _short_push(self, sign):
        """Break the joint free, push it a little, let it coast; return k_t·n/J or NaN."""
        peak = self.goal.ramp_peak
        slope = peak / 3.0
        yield from self._standstill(STILL_TIME)
        sample = self._sample
        begin, home = sample.time, sample.position
        window = deque([sample], maxlen=200)
        while True:
            current = slope * (sample.time - begin)
            if current > peak:
                self._never_free(sign, peak)
            sample = yield from self._step(sign * current)
            window.append(sample)
            if _speed(window, sign, 0.01) > PUSH_SPEED / 10.0 and (
                    sign * (sample.position - home) > 8.0 * self._resolution):
                break
        self._push[sign] = sign * current
        strong = min(1.3 * current, self.drive.current_limit)
        room = sample.position + sign * 0.04 * self.goal.motion_range
        pushed, begin = [sample], sample.time
        while (sign * (sample.position - room) < 0.0 and sample.time - begin < 1.0
               and _speed(pushed, sign, 0.004) < PUSH_SPEED):
            sample = yield from self._step(sign * strong)
            pushed.append(sample)
        coasted = [sample]
        while _speed(coasted, sign, 0.02) > 0.0 or len(coasted) < 10:
            sample = yield from self._step(0.0)
            coasted.append(sample)
            if sample.time - coasted[0].time > 2.0:
                break
        yield from self._standstill(STILL_TIME)
        return acceleration_of_push(pushed, coasted, strong, sign)

    def _combine(self, rates):
        """The larger of the two estimates; from the breakaway current alone where both failed."""
        # A joint that its own breakaway torque accelerates at 10 rad/s² is typical.
        typical = 10.0 / max(self._push[1], -self._push[-1])
        rates = [rate for rate in rates if math.isfinite(rate) and rate > typical / 100.0]
        if not rates:
            self.warnings.append('the inertia could not be estimated; a typical one was assumed')
            return typical
        return max(rates)

    def _controller(self, bandwidth=BANDWIDTH):
        # The encoder's single counts must not make the current rattle by more than friction.
        push = min(self._push[1], -self._push[-1])
        quiet = math.sqrt(0.06 * push * self._acceleration / self._resolution)
        return velocity_controller_parameters(
            self._acceleration, self.drive.current_limit, self._push[1], self._push[-1],
            bandwidth=max(min(bandwidth, quiet), 5.0)), velocity_controller_state()

    def _follow(self, reference, duration, allowance):
        """Follow reference(t) -> (position, velocity) and return the samples, times from zero."""
        parameters, state = self._controller(self._bandwidth)
        begin, last = self._sample.time, self._sample.time - 1e-3
        samples, sample = [], self._sample
        while sample.time - begin < duration:
            position, velocity = reference(sample.time - begin)
            command = velocity_controller_step(
                parameters, state, position, velocity, sample.position, sample.time - last)
            if abs(position - sample.position) > allowance:
                raise IdentificationError(
                    f'the joint lags {abs(position - sample.position):.3g} rad behind its '
                    f'reference at {abs(command):.3g} A: blocked, encoder stuck, or current limit '
                    f'({parameters[LIMIT]:g} A) too low')
            last = sample.time
            sample = yield from self._step(command)
            samples.append(sample)
        return begin, samples

    def _travel(self, target):
        """Go to a position and stand still there."""
        start = self._sample.position
        distance = target - start
        if abs(distance) > 0.01 * self.goal.motion_range:
            self.phase = 'travel'
            duration = self._travel_time(distance)

            def reference(t):
                position, velocity = at_travel(t, distance, duration)
                return start + position, velocity

            yield from self._follow(
                reference, duration, max(0.5 * abs(distance), 0.05 * self.goal.motion_range))
        yield from self._standstill(STILL_TIME)

    def _travel_time(self, distance):
        return max(1.875 * abs(distance) / min(0.5, self.goal.speeds[-1]), 0.5)

    def _constant_velocity(self, speed):
        """Drive the cycles of Eq. 3 at one speed and average over the constant phases."""
        for _ in range(self.goal.velocity_cycles):
            points = None
            for _ in range(3):
                points = yield from self._one_cycle(speed)
                if points is not None:
                    break
                # The speed swung: the gains are too high for this joint.
                self._bandwidth *= 0.5
            if points is None:
                raise IdentificationError(
                    f'the joint cannot be held at {speed:g} rad/s: its speed swings by more than '
                    'a tenth')
            self._points.extend(points)
            for point in points:
                sign = 1 if point.speed > 0.0 else -1
                if sign * point.current > 0.0:
                    self._push[sign] = point.current

    def _one_cycle(self, speed):
        """Drive one cycle of Eq. 3; return its table entries, None where the speed swung."""
        duration, width = self.goal.cycle(speed)
        yield from self._travel(self._centre - 0.5 * width)
        self.phase = 'velocity'
        start = self._sample.position

        def reference(t):
            return start + at_position(t, speed, duration), at_velocity(t, speed, duration)

        begin, samples = yield from self._follow(
            reference, duration, max(0.05 * self.goal.motion_range, 0.25 * width))
        columns = np.array([sample[:3] for sample in samples]).T
        return self._evaluate(columns, begin, speed, duration)

    def _evaluate(self, columns, begin, speed, duration):
        """Return the two table entries, None where the speed was not held."""
        time, position, current = columns[0] - begin, columns[1], columns[2]
        good = np.isfinite(current)
        if np.mean(good) < 0.95:
            raise IdentificationError('the measured current is not finite')
        try:
            points = constant_velocity_currents(
                time[good], position[good], current[good], speed, duration, self._acceleration)
        except InputError as error:
            raise IdentificationError(str(error)) from None
        for point in points:
            if (abs(point.actual_speed / point.speed - 1.0) > 0.1
                    or point.unsteadiness > 0.1):
                return None
        return points

    def _ramp(self, sign, cycle):
        """Raise the current along Eq. 8 until the joint runs away, then let it come to rest."""
        goal = self.goal
        rest = yield from self._standstill(max(STILL_TIME, REST_SHARE * goal.ramp_period))
        sample = self._sample
        begin, home, samples = sample.time, sample.position, [sample]
        window = deque([sample], maxlen=200)
        farthest = 0.2 * goal.motion_range
        while True:
            elapsed = sample.time - begin
            if elapsed > 0.4 * goal.ramp_period:
                self._never_free(sign, goal.ramp_peak)
            sample = yield from self._step(sign * at_ramp(elapsed, goal.ramp_slope,
                                                          goal.ramp_period))
            samples.append(sample)
            window.append(sample)
            way = sign * (sample.position - home)
            if way > farthest or (way > 8.0 * self._resolution
                                  and _speed(window, sign, 0.02) > CUT_SPEED):
                break
        self._reached[sign] = min(1.0, elapsed / (0.4 * goal.ramp_period))
        self._ramps.append((sign, cycle, rest, np.array(samples)))

    def _never_free(self, sign, reached):
        side = 'positive' if sign > 0 else 'negative'
        raise IdentificationError(
            f'the joint did not break free in the {side} direction up to {reached:.3g} A: ask for '
            'a steeper ramp_slope or a longer ramp_period')

    # What surrounds the procedure.

    def _check(self, time, position):
        if not math.isfinite(time):
            raise IdentificationError('the time of a sample is not finite')
        if not math.isfinite(position):
            raise IdentificationError('the joint position is not finite: encoder failure')
        if self._sample is not None and time - self._sample.time > LONGEST_GAP:
            raise IdentificationError(
                f'no sample for {time - self._sample.time:.2g} s; {LONGEST_GAP} s are tolerated')
        if self._centre is not None and (
                abs(position - self._centre) > 0.5 * self.goal.motion_range):
            raise IdentificationError(
                f'the joint left its motion range of {self.goal.motion_range:g} rad')

    def _estimate(self, now):
        """Renew `remaining` and `progress` from what is still to come."""
        goal, left = self.goal, 0.0
        for speed in goal.speeds[self._done_speeds:]:
            duration, width = goal.cycle(speed)
            left += goal.velocity_cycles * (
                duration + self._travel_time(0.5 * width) + STILL_TIME)
        ramps = 2 * goal.breakaway_cycles - self._done_ramps
        share = 0.5 * (self._reached[1] + self._reached[-1])
        left += ramps * goal.ramp_period * (0.4 * share + REST_SHARE)
        elapsed = now - self._begin
        self.remaining = left
        self.progress = max(self.progress, min(0.999, elapsed / max(elapsed + left, 1e-9)))

    def _records(self):
        parts, lost = [], 0
        for sign, cycle, rest, samples in self._ramps:
            good = np.isfinite(samples[:, 2])
            time, position, current, warmth = samples[good].T
            command = sign * np.maximum(time - time[0], 1e-6)
            part = breakaway_currents(time, position, current, command=command,
                                      temperature=warmth, resolution=self._resolution)
            if len(part) == 0:
                lost += 1
                continue
            part.rest_time[:] = rest
            part.cycle[:] = cycle
            parts.append(part)
        if lost > 0.1 * len(self._ramps):
            raise IdentificationError(
                f'{lost} of {len(self._ramps)} ramps show no clear breakaway: the joint creeps; '
                'ask for a steeper ramp_slope')
        if lost:
            self.warnings.append(f'{lost} of {len(self._ramps)} ramps show no clear breakaway')
        return BreakawayRecords.join(parts)


def _speed(samples, sign, window):
    """Speed in the direction `sign` over the last `window` seconds; 0 while they are too few."""
    last = samples[-1]
    for k in range(len(samples) - 2, -1, -1):
        elapsed = last.time - samples[k].time
        if elapsed >= 0.999 * window:
            return sign * (last.position - samples[k].position) / elapsed
    return 0.0


def _compile():
    """Have every kernel of the control loop compiled before the first sample comes."""
    at_position(0.1, 1.0, 1.0), at_velocity(0.1, 1.0, 1.0), at_ramp(0.1, 1.0, 1.0)
    at_travel(0.1, 1.0, 1.0)
    velocity_controller_step(velocity_controller_parameters(1.0, 1.0),
                             velocity_controller_state(), 0.0, 0.0, 0.0, 1e-3)
