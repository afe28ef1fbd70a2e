# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification of a drive, sample by sample (note, sections 2.3 and 2.4).

A ROS node or a plain loop runs the procedure by calling `IdentificationRun.update` with every
sample. The movements are generators that yield currents and receive samples, one sample for each
``yield``: `IdentificationRun._movements` is the whole procedure in order, the methods below it
are its steps. Measurements are stored in attributes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import replace
import math

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.identification import agreement, breakaway as stairs, velocity_control as control
from friction_comp.identification.agreement import Cycle
from friction_comp.identification.goal import (
    IdentificationError,
    IdentificationGoal,
    IdentificationResult,
)
from friction_comp.identification.inertia import Inertia, steadiest_inertia, without_lag
from friction_comp.identification.kinetic import cycle_position, cycle_velocity, Sample, sample_rows
from friction_comp.identification.ramp_evaluation import evaluate_ramps, Ramp
from friction_comp.identification.sigmoid_fit import fit_sigmoid
from friction_comp.identification.supervised_run import (
    OscillationError,
    speed_over,
    STILL_TIME,
    SupervisedRun,
    TooSlowError,
)
from friction_comp.identification.supervision import check_curve, check_load
from friction_comp.statistics import evenly_spread, smallest_step

# The joint slides when its mean speed over this time in s exceeds this speed in rad/s, and it has
# moved by more than so many counts. A ramp ends when it has slid this far, rad, at this speed or
# since its last rest: a rotor that crosses backlash also slides, and is then stopped.
CUT_SPEED, CUT_WINDOW, CUT_COUNTS, CUT_DISTANCE = 0.05, 0.02, 8.0, 5e-3
# Stick-slip needs higher gains; lag, or a heavy link that oscillates against its rotor, lower ones.
GAIN_LADDER = (1.0, 1.7, 0.3, 0.1)
# Share of friction by which the curve of Eq. 6 may be off it without a warning, RMS.
CURVE_SHARE = 0.03
_TYPICAL = 'the inertia could not be estimated; a typical one was assumed'
_ONE_RAMP = ('breakaway was measured once in each direction: how much it scatters is not known, '
             'and its standard deviation of 0 means nothing. Request four breakaway_cycles or more')
REST_SHARE = 0.1        # of the ramp period at zero current after each ramp, as in Eq. 8
# Ramps start up to this share of the motion range off its centre, to average out cogging.
PLACES_SHARE = 0.015
# Share of a push's current, read late, that surely holds; share of the ramps that may be repeated.
_PUSH_HOLDS, _MOST_LOST = 0.8, 0.2
# Share of the drive's limit that friction and acceleration may take together.
_USED_CURRENT = 0.9


class IdentificationRun(SupervisedRun):
    """One identification, from standstill to zero current; see `SupervisedRun`.

    Call `update` with every sample and apply the current that it returns, until `finished`. Then
    `result()` fits the model.

    Parameters
    ----------
    goal : IdentificationGoal
    drive : Drive
    torque : bool
        Whether messages have joint torques in N·m instead of motor currents in A.

    Raises
    ------
    InputError
        If the drive cannot meet the goal.
    """

    goal: IdentificationGoal

    def __init__(self, goal: IdentificationGoal, drive: Drive, torque: bool = False) -> None:
        super().__init__(goal, drive, torque)
        self.cycles: list[Cycle] = []      # at each speed, the lowest first: the look-up table
        self.repeated: list[Cycle] = []    # at the speeds driven once more after the ramps
        self.ramps: list[Ramp] = []
        self._highest_gain = math.inf      # largest factor of GAIN_LADDER that may be used
        self._uneven = False               # whether the current varies at any gain
        self._held: dict[int, list[float]] = {1: [], -1: []}    # largest currents that held, A
        self._ramp_time, self._lost = 0.25 * goal.ramp_period + 3.0, 0
        # Every speed, then the lowest, the middle and the top one again, each once.
        again = {goal.speeds[k] for k in (0, len(goal.speeds) // 2, -1)}
        self._to_drive, self._again = list(goal.speeds), sorted(again)
        self._result: IdentificationResult | None = None
        # Compile the function of the control loop before the first sample arrives.
        control.velocity_controller_step(
            control.Controller(1.0, 1.0), control.velocity_controller_state(), 0.0, 0.0, 0.0, 1e-3)

    def _bounds(self) -> tuple[float, float]:
        half = 0.5 * self.goal.motion_range
        return self.start - half, self.start + half

    def _time_left(self) -> float:
        goal, left = self.goal, 0.0
        for speed in [*self._to_drive, *self._again]:
            duration, width = goal.cycle(speed)
            left += duration + self._travel_time(0.5 * width) + STILL_TIME
        return left + (2 * goal.breakaway_cycles - len(self.ramps)) * self._ramp_time

    def _movements(self) -> Generator[float, Sample, None]:
        self._leave_out_fast()
        yield from self._velocities(self._to_drive, self.cycles)
        self.warnings += filter(None, [self.supervision.encoder_fault()])
        if len(self.cycles) < 2:
            raise IdentificationError('too few speeds could be held: ' + '; '.join(self.warnings))
        # Directions alternate in pairs of ramps: a gear yields less after a slide in the ramp's own
        # direction than after one against it, and presliding needs both.
        for first in range(0, self.goal.breakaway_cycles, 2):
            count = min(2, self.goal.breakaway_cycles - first)
            yield from self._travel(self._place(first // 2))
            for sign in (1, -1):
                for _ in range(count):
                    if abs(self.sample.position - self.start) > 0.2 * self.goal.motion_range:
                        yield from self._travel(self.start)
                    self.phase = 'breakaway'
                    yield from self._breakaway(sign)
        # Before, speeds rose with time: what changes with time would be taken for viscous friction.
        driven = {cycle.speed for cycle in self.cycles}
        self._again = [speed for speed in self._again if speed in driven]
        yield from self._velocities(self._again, self.repeated)

    def _place(self, index: int) -> float:
        """Return the start in rad of the next ramps; any number of them is evenly spread."""
        share = 2.0 * ((0.5 + evenly_spread(index)) % 1.0) - 1.0
        return self.start + share * PLACES_SHARE * self.goal.motion_range

    def _leave_out_fast(self) -> None:
        """Take speeds off the list whose acceleration would need too much current."""
        limit, push = self.drive.current_limit, max(self._push.values())
        for speed in reversed(self.goal.speeds):
            needed = push + self._accelerating_current(speed)
            if needed <= _USED_CURRENT * limit:
                return
            self._to_drive.remove(speed)
            self._left_out(speed, f'within {self.goal.motion_range:g} rad it would take about '
                           f'{self.say(needed)} to accelerate, more than {_USED_CURRENT:.0%} of '
                           f'the current limit of {self.say(limit)}: widen the range')

    def _left_out(self, speed: float, why: str) -> None:
        self.warnings.append(f'{speed:g} rad/s left out: {why}')

    def _velocities(self, speeds: list[float], driven: list[Cycle]
                    ) -> Generator[float, Sample, None]:
        """Drive each speed, add its cycle to `driven`, and take the speed off the list."""
        while speeds:
            why = self.goal.too_short(speeds[0], self.supervision.step)
            best = None if why else (yield from self._constant_velocity(speeds[0]))
            speed = speeds.pop(0)
            if best is None:
                why = why or f'stick-slip, or the joint oscillates{self._why_slow()}'
                self._left_out(speed, why)
                continue
            driven.append(best)
            if driven is self.cycles:
                self.commanded_points.extend(best.commanded)
                self._update_friction()

    def _constant_velocity(self, speed: float) -> Generator[float, Sample, Cycle | None]:
        """Drive cycles until a controller gain is steady; return the best, None if none was."""
        best = None
        for factor in GAIN_LADDER:
            if factor > self._highest_gain:
                continue
            driven = yield from self._one_cycle(speed, factor)
            if driven is None:
                continue
            scatter = driven.scatter
            if best is not None and scatter > 0.7 * best.scatter:
                # The controller is not the cause: friction itself varies.
                self._uneven, self._highest_gain = True, math.inf
                break
            best = driven
            if self._uneven or scatter <= agreement.MAX_SCATTER:
                break
            # Higher gains would only cause more oscillation, at other speeds too.
            self._highest_gain = max(0.99 * factor, GAIN_LADDER[-1])
        return best

    def _one_cycle(self, speed: float, factor: float) -> Generator[float, Sample, Cycle | None]:
        """Run one cycle of Eq. 3; return both directions' currents, None if speed oscillated."""
        duration, width = self.goal.cycle(speed)
        yield from self._travel(self.start - 0.5 * width)
        self.phase = 'velocity'
        start = self.sample.position

        def reference(t: float) -> tuple[float, float]:
            return start + cycle_position(t, speed, duration), cycle_velocity(t, speed, duration)

        allowance = max(0.05 * self.goal.motion_range, 0.25 * width)
        try:
            begin, driven, commands = yield from self._follow(
                reference, duration, allowance, speed, factor)
        except OscillationError as error:
            yield from self._calm(error)
            return (yield from self._one_cycle(speed, factor))
        except TooSlowError:
            yield from self._standstill(STILL_TIME)
            return None
        if np.mean(np.isfinite(driven[:, 2])) < 0.95:
            raise IdentificationError('the measured current is not finite')
        try:
            cycle = Cycle.measured(
                begin, duration, speed, driven, np.array(commands), self.acceleration)
        except InputError as error:
            raise IdentificationError(str(error)) from None
        if any(abs(point.actual_speed / point.speed - 1.0) > 0.1 or point.unsteadiness > 0.1
               for point in cycle.points):
            return None
        return cycle

    def _breakaway(self, sign: int) -> Generator[float, Sample, None]:
        """Find the largest current that holds, on one ramp; repeat it if no stair held."""
        held = self._held[sign]
        first = stairs.first_stair(held or [_PUSH_HOLDS * self._push[sign]])
        while True:
            begin = self.sample.time
            ramp, level = yield from self._ramp(sign, first)
            if ramp is not None:
                break
            self._lost += 1
            first *= stairs.FIRST_STAIR
            if self._lost > 2 + _MOST_LOST * 2 * self.goal.breakaway_cycles:
                raise IdentificationError(
                    f'no current holds the joint reliably: it slid at {self.say(level)}, although '
                    f'more held it before; {agreement.why_unreliable(self.cycles[0])}')
        held.append(level)
        self.ramps.append(ramp)
        self._ramp_time += (self.sample.time - begin - self._ramp_time) / min(len(self.ramps), 8)

    def _ramp(self, sign: int, stair: float) -> Generator[float, Sample, tuple[Ramp | None, float]]:
        """Raise the current, A, from `stair` until the joint slides away; return ramp and level."""
        yield from self._standstill(max(STILL_TIME, REST_SHARE * self.goal.ramp_period))
        watch = _Slide(self.sample, sign, self._resolution, 0.2 * self.goal.motion_range)
        current, held, level = 0.0, None, stair
        pauses: list[float] = []
        while not watch.gone:
            if stair > self.ramp_peak:
                if watch.slides and held is not None:
                    break
                self._refuse_blocked(sign, self.ramp_peak)
            yield from self._rise(current, stair, watch)
            current = stair
            pauses.append(self.sample.time)
            rested = yield from self._pause(sign * current, watch)
            if rested is not None:
                held, level = rested, current
            stair *= 1.0 + (stairs.SLIDING_STAIR if watch.slides else stairs.STAIR)
        before, self._slid = self._slid, sign
        if held is None:
            return None, stair
        return Ramp(sign, before, sample_rows(watch.samples), held, pauses), level

    def _rise(self, low: float, high: float, watch: _Slide) -> Generator[float, Sample, None]:
        """Raise the current from `low` to `high`, A, without shaking the joint."""
        begin, duration = self.sample.time, (high - low) / self.ramp_slope + stairs.STAIR_TIME
        share = 0.0
        while share < 1.0 and not watch.gone:
            share = min((self.sample.time - begin) / duration, 1.0)
            level = low + (high - low) * stairs.risen(share, low == 0.0)
            watch.take((yield from self._step(watch.sign * level)))

    def _pause(self, command: float, watch: _Slide) -> Generator[float, Sample, stairs.Held | None]:
        """Keep a current until it is clear whether it holds the joint; return the rest, if so."""
        begin, first, duration = self.sample.time, len(watch.samples) - 1, stairs.SHORTEST_PAUSE
        while not watch.gone:
            watch.take((yield from self._step(command)))
            if self.sample.time - begin < 0.999 * duration:
                continue
            time, position, _ = sample_rows(watch.samples[first:]).T
            if stairs.rests(time, position, watch.sign, self._resolution):
                watch.rest()
                return stairs.Held(begin, self.sample.time, self.sample.position)
            moved = watch.sign * (self.sample.position - position[0])
            if (watch.slides or duration >= stairs.LONGEST_PAUSE
                    or moved > stairs.SLIDE_SHARE * watch.sign * (position[0] - watch.home)):
                break
            duration *= 2.0
        watch.slides = True
        return None

    def result(self) -> IdentificationResult:
        """Fit the curve of Eq. 6, evaluate the ramps and return an `IdentificationResult`.

        Raises
        ------
        IdentificationError
            If the run is not finished, or breakaway scatters because of backlash.
        """
        if not self.finished:
            raise IdentificationError(f'identification is not complete: {self.error or self.phase}')
        if self._result is None:
            self._result = self._evaluate()
        return self._result

    def _evaluate(self) -> IdentificationResult:
        slopes = agreement.position_slopes(self.cycles)
        inertia = self._inertia(agreement.levelled(self.cycles, slopes))
        acceleration, lag = inertia[:2] if inertia else (self.acceleration, 0.0)
        # An inertia that is not known must not correct anything.
        cycles, repeated = (
            agreement.levelled([cycle.again(acceleration if inertia else math.inf, lag)
                                for cycle in driven], slopes)
            for driven in (self.cycles, self.repeated))
        points, drift = agreement.without_drift(cycles, repeated)
        sigmoid, error = fit_sigmoid([p.actual_speed for p in points], [p.current for p in points])
        # The table is that of the speeds that were requested.
        points = sorted((replace(point, current=point.current + float(
            sigmoid(point.speed) - sigmoid(point.actual_speed))) for point in points),
            key=lambda point: point.speed)
        ramps = evaluate_ramps(
            [ramp._replace(samples=without_lag(ramp.samples, lag)) for ramp in self.ramps],
            self._finest_step(), acceleration, sigmoid.viscous)
        breakaway = ramps.records.statistics()
        wrong, doubtful = check_load(
            points, (breakaway.positive_mean, breakaway.negative_mean),
            max(breakaway.positive_std, breakaway.negative_std), self.say)
        if wrong:
            raise IdentificationError(wrong)
        return IdentificationResult(
            points=points, sigmoid=sigmoid, sigmoid_error=error, breakaway=breakaway,
            records=ramps.records, acceleration_per_current=acceleration,
            goal=replace(self.goal, ramp_slope=self.ramp_slope),
            warnings=[*self.warnings,
                      *([_TYPICAL] if self._inertia_is_typical and not inertia else []),
                      *agreement.check_currents(cycles), *agreement.say_scatter(cycles),
                      *agreement.say_lag(lag), *agreement.say_swing(inertia),
                      *([] if inertia else agreement.say_unsettled(self.cycles, cycles)),
                      *agreement.say_drift(drift),
                      *([_ONE_RAMP] if self.goal.breakaway_cycles == 1 else []), *ramps.warnings,
                      *agreement.say_unseen_creep(cycles[0], self.ramps, self._resolution),
                      *agreement.check_positions(self.cycles, self.repeated),
                      *filter(None, [doubtful]),
                      *check_curve(points, sigmoid, CURVE_SHARE, self.say)],
            drift=drift, presliding=ramps.presliding, backlash=ramps.backlash)

    def _finest_step(self) -> float:
        """Return the encoder's step in rad: that of the drive, or a coarser one that was seen."""
        seen = [smallest_step(ramp.samples[:, 1]) for ramp in self.ramps]
        return max(self.drive.position_resolution or 1e-6, min(filter(None, seen), default=0.0))

    def _inertia(self, cycles: Sequence[Cycle]) -> Inertia | None:
        """Return k_t·n/J and the lag of the current from the cycles, if they show it."""
        found = steadiest_inertia([cycle.samples for cycle in cycles])
        # A push that moved the joint is right within tens of percent, unless a sensor is late.
        wide = 50.0 if self._inertia_is_typical else 5.0
        ratio = found.acceleration_per_current / self.acceleration if found else 0.0
        return found if 1.0 / wide < ratio < wide else None


class _Slide:
    def __init__(self, sample: Sample, sign: int, resolution: float, farthest: float) -> None:
        self.sign, self.samples = sign, [sample]
        self.gone = self.slides = False     # slides: it did not come to rest on the last stair
        self._resolution, self._farthest = resolution, farthest
        self.home = self._rested = sample.position
        self._window = deque([sample], maxlen=200)
        self._began: float | None = None    # displacement at which a fast slide began, rad

    def take(self, sample: Sample) -> None:
        """Add a sample and update `gone`."""
        self.samples.append(sample)
        self._window.append(sample)
        moved = self.sign * (sample.position - self.home)
        if (moved <= CUT_COUNTS * self._resolution
                or speed_over(self._window, self.sign, CUT_WINDOW) <= CUT_SPEED):
            self._began = None
        elif self._began is None:
            self._began = moved
        self.gone = (moved > self._farthest
                     or (self._began is not None and moved > self._began + CUT_DISTANCE)
                     or (self.slides and self.sign * (sample.position - self._rested)
                         > max(CUT_DISTANCE, CUT_COUNTS * self._resolution)))

    def rest(self) -> None:
        """Take note that the joint came to rest."""
        self.slides, self._rested = False, self.samples[-1].position
