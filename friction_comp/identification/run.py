# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification of a drive, sample by sample (note, sections 2.3 and 2.4), and trajectories.

A ROS node or a plain loop calls `update` with every sample. `IdentificationRun._movements` is the
whole procedure in order, the methods below it are its steps; what is measured twice must agree,
else the result says by how much it does not.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field, replace
import math

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from friction_comp.drive import Drive
from friction_comp.identification import measurements as shown
from friction_comp.identification.curves import fit_sigmoid
from friction_comp.identification.goal import (
    cycle_state,
    IdentificationError,
    IdentificationGoal,
    TrajectoryGoal,
)
from friction_comp.identification.measurements import Cycle, KineticPoint, MAX_SCATTER
from friction_comp.identification.supervised_run import (
    LEAST_BANDWIDTH,
    Motion,
    NotFollowedError,
    Sample,
    sample_rows,
    speed_over,
    STILL_TIME,
    SupervisedRun,
)
from friction_comp.model.arm import Arm
from friction_comp.model.effect import Effect
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import Breakaway, Presliding
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.statistics import evenly_spread, rms, smallest_step

# Smallest share of friction that measured and commanded currents may differ by to be told, and
# by which breakaway scatters, or the load changes, under a person's hand.
_CURRENTS, _TOUCHED = 0.04, 0.6
PRESLIDING_RATE = 500.0
"""Rate of joint states in Hz from which on presliding is within its stated deviation."""


class TrajectoryRun(SupervisedRun):
    """One trajectory, from standstill to zero current; see `SupervisedRun`.

    First the joint is broken free and pushed briefly at its present position. Then it travels to
    the first point, follows the trajectory, and stops.
    """

    goal: TrajectoryGoal

    def __init__(self, goal: TrajectoryGoal, drive: Drive, torque: bool = False) -> None:
        super().__init__(goal, drive, torque)
        self._began: float | None = None
        self._path = CubicHermiteSpline(goal.times, goal.positions, goal.velocities)
        self._speed = self._path.derivative()

    def _bounds(self) -> tuple[float, float]:
        # Of the range, by how much the joint may leave it, and be pushed at the start.
        width, places = self.goal.motion_range, self.goal.positions
        beyond, pushed = 0.025 * width, 0.1 * width
        return (min(min(places) - beyond, self.start - pushed),
                max(max(places) + beyond, self.start + pushed))

    def _time_left(self) -> float:
        if self._began is None:
            return self.goal.times[-1] + 5.0 * STILL_TIME
        return max(0.0, self._began + self.goal.times[-1] - self.sample.time)

    def _movements(self) -> Motion:
        goal = self.goal
        yield from self._travel(goal.positions[0])
        self.phase, self._began = 'trajectory', self.sample.time
        yield from self._follow(self._reference, goal.times[-1], 0.1 * goal.motion_range,
                                goal.speeds[-1], self.gains[0])

    def _reference(self, time: float) -> tuple[float, float]:
        time = max(time, self.goal.times[0])
        return float(self._path(time)), float(self._speed(time))


class IdentificationRun(SupervisedRun):
    """One identification, from standstill to zero current; see `SupervisedRun`.

    Call `update` with every sample and apply the current that it returns, until `finished`. Then
    `result()` fits the model. With `torque`, messages have joint torques in N·m instead of motor
    currents in A. Raises InputError if the drive cannot meet the goal.
    """

    goal: IdentificationGoal

    def __init__(self, goal: IdentificationGoal, drive: Drive, torque: bool = False) -> None:
        super().__init__(goal, drive, torque)
        self.cycles: list[Cycle] = []      # at each speed, the lowest first: the look-up table
        self.repeated: list[Cycle] = []    # at the speeds driven once more after the ramps
        self.ramps: list[shown.Ramp] = []
        self._held: dict[int, list[float]] = {1: [], -1: []}    # largest currents that held, A
        self._ramp_time, self._lost = 0.25 * goal.ramp_period + 3.0, 0
        # Every speed, then the lowest, the middle and the top one again, each once.
        self._to_drive = list(goal.speeds)
        self._again = sorted({goal.speeds[k] for k in (0, len(goal.speeds) // 2, -1)})
        self._result: IdentificationResult | None = None

    def _bounds(self) -> tuple[float, float]:
        half = 0.5 * self.goal.motion_range
        return self.start - half, self.start + half

    def _time_left(self) -> float:
        goal, left = self.goal, 0.0
        for speed in [*self._to_drive, *self._again]:
            duration, width = goal.cycle(speed)
            left += duration + self._travel_time(0.5 * width) + STILL_TIME
        return left + (2 * goal.breakaway_cycles - len(self.ramps)) * self._ramp_time

    def _movements(self) -> Motion:
        while self._to_drive:
            yield from self._measure_speed(self._to_drive[0])
            self._to_drive.pop(0)
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
        # With the gains of the first time: what changed is then the drive.
        for first_cycle in [cycle for cycle in self.cycles if cycle.speed in self._again]:
            again = yield from self._one_cycle(first_cycle.speed, first_cycle.gain)
            self._again.remove(first_cycle.speed)
            self.repeated += [] if again is None else [again]

    def _place(self, index: int) -> float:
        """Return the start in rad of the next ramps: evenly spread, to average out cogging."""
        share = 2.0 * ((0.5 + evenly_spread(index)) % 1.0) - 1.0
        return self.start + 0.015 * share * self.goal.motion_range

    # Constant velocities.

    def _leave_out(self, speed: float, why: str) -> None:
        self.warnings.append(f'{speed:g} rad/s left out: {why}')
        self._again = [again for again in self._again if again != speed]

    def _too_fast(self, speed: float) -> str:
        """Return why a speed cannot be driven; '' if it can."""
        slow, limit = self.bandwidth(self.gains[0]), self.drive.current_limit
        needed, say = self.push + self._accelerating_current(speed), self.supervision.say
        return self.goal.too_short(speed, self.supervision.step) or next((
            f'within {self.goal.motion_range:g} rad {why}: widen the range' for applies, why in (
                (0.3 * self.goal.cycle(speed)[0] * slow < 6.5,
                 f'its controller, of {slow:.0f} rad/s, does not settle'),
                (needed > 0.9 * limit,
                 f'it would take about {say(needed)} to accelerate, more than 90 % of the current '
                 f'limit of {say(limit)}')) if applies), '')

    def _measure_speed(self, speed: float) -> Motion:
        """Drive cycles at a speed with lower gains until its current is steady; keep the best."""
        if why := self._too_fast(speed):
            self._leave_out(speed, why)
            return
        best = None
        for gain in list(self.gains):
            # Lower gains hold no low speeds: they are for a joint that oscillates with others.
            if gain < self.gains[0] and self.bandwidth(gain) < LEAST_BANDWIDTH:
                break
            driven = yield from self._one_cycle(speed, gain)
            if best is not None and (
                    driven is None or driven.scatter >= 0.7 * best.scatter):
                # Not the controller but friction itself varies.
                break
            best = driven
            if best is not None and best.scatter <= MAX_SCATTER:
                break
        if best is None:
            self._leave_out(speed, 'stick-slip, the joint oscillates, or its controller is slow '
                            f'({self.bandwidth(self.gains[0]):.0f} rad/s)')
            return
        self.cycles.append(best)
        for point in best.commanded:
            self.learn(1 if point.speed > 0.0 else -1, abs(point.speed), point.current)

    def _one_cycle(self, speed: float, gain: float) -> Generator[float, Sample, Cycle | None]:
        """Run one cycle of Eq. 3; return None if the joint did not hold its speed."""
        duration, width = self.goal.cycle(speed)
        yield from self._travel(self.start - 0.5 * width)
        self.phase = 'velocity'
        start = self.sample.position

        def reference(t: float) -> tuple[float, float]:
            moved, velocity = cycle_state(t, speed, duration)
            return start + moved, velocity

        try:
            begin, driven, commands = yield from self._follow(
                reference, duration, max(0.05 * self.goal.motion_range, 0.25 * width), speed, gain)
        except NotFollowedError:
            return None
        if np.mean(np.isfinite(driven[:, 2])) < 0.95:
            raise IdentificationError('the measured current is not finite')
        cycle = Cycle.measured(begin, duration, speed, driven, np.array(commands), gain)
        held = cycle.scatter <= 0.5 and all(
            max(abs(point.actual_speed / point.speed - 1.0), point.unsteadiness) <= 0.1
            for point in cycle.points)
        return cycle if held else None

    # Breakaway.

    def _breakaway(self, sign: int) -> Motion:
        """Find the largest current that holds, on one ramp; repeat it if no stair held."""
        held = self._held[sign]
        # Of a push's current, read late, this surely holds.
        first = shown.first_stair(held or [0.8 * self.known[sign][0][1]])
        while True:
            begin = self.sample.time
            ramp, level = yield from self._ramp(sign, first)
            if ramp is not None:
                break
            self._lost += 1
            first = shown.first_stair([first])
            if self._lost > 2 + 0.4 * self.goal.breakaway_cycles:
                raise IdentificationError(
                    f'no current holds the joint reliably: it slid at {self.supervision.say(level)}'
                    ', although more held it before: it is pushed, or its friction varies with '
                    'place or time')
        held.append(level)
        self.ramps.append(ramp)
        self._ramp_time += (self.sample.time - begin - self._ramp_time) / min(len(self.ramps), 8)

    def _ramp(self, sign: int, stair: float
              ) -> Generator[float, Sample, tuple[shown.Ramp | None, float]]:
        """Raise the current, A, from `stair` until the joint slides away; return ramp and level."""
        yield from self._standstill(max(STILL_TIME, 0.1 * self.goal.ramp_period))
        watch = _Slide(self.sample, sign, self._resolution, 0.2 * self.goal.motion_range)
        current, held, level = 0.0, None, stair
        pauses: list[float] = []
        while not watch.gone:
            if stair > self.ramp_peak:
                if watch.slides and held is not None:
                    break
                self._refuse_blocked(sign)
            yield from self._rise(current, stair, watch)
            current = stair
            pauses.append(self.sample.time)
            rested = yield from self._pause(sign * current, watch)
            if rested is not None:
                held, level = rested, current
            # Larger ones above a current that did not hold.
            stair *= 1.03 if watch.slides else 1.01
        before, self._slid = self._slid, sign
        if held is None:
            return None, stair
        return shown.Ramp(sign, before, sample_rows(watch.samples), held, pauses), level

    def _rise(self, low: float, high: float, watch: _Slide) -> Motion:
        """Raise the current from `low` to `high`, A, without shaking the joint."""
        # A rise that is too quick shakes the joint, and a contact with little damping then creeps.
        begin, duration = self.sample.time, (high - low) / self.ramp_slope + 0.08
        share = 0.0
        while share < 1.0 and not watch.gone:
            share = min((self.sample.time - begin) / duration, 1.0)
            level = low + (high - low) * shown.risen(share, low == 0.0)
            watch.take((yield from self._step(watch.sign * level)))

    def _pause(self, command: float, watch: _Slide) -> Generator[float, Sample, shown.Held | None]:
        """Keep a current until it is clear whether it holds the joint; return the rest, if so."""
        begin, first, duration = self.sample.time, len(watch.samples) - 1, shown.SHORTEST_PAUSE
        while not watch.gone:
            watch.take((yield from self._step(command)))
            if self.sample.time - begin < 0.999 * duration:
                continue
            time, position, _ = sample_rows(watch.samples[first:]).T
            if shown.rests(time, position, watch.sign, self._resolution):
                watch.rest()
                return shown.Held(begin, self.sample.time, self.sample.position)
            # It slides if it moves by half of all its movement on the ramp before.
            moved = watch.sign * (self.sample.position - position[0])
            if (watch.slides or duration >= shown.LONGEST_PAUSE
                    or moved > 0.5 * watch.sign * (position[0] - watch.home)):
                break
            duration *= 2.0
        watch.slides = True
        return None

    # The result.

    def result(self) -> IdentificationResult:
        """Fit the curve of Eq. 6, evaluate the ramps and return an `IdentificationResult`.

        Raises IdentificationError before the end, or if breakaway scatters because of backlash.
        """
        if not self.finished:
            raise IdentificationError(f'identification is not complete: {self.error or self.phase}')
        if self._result is None:
            self._result = self._evaluate()
        return self._result

    def _evaluate(self) -> IdentificationResult:
        slopes = shown.position_slopes(self.cycles)
        cycles, repeated = (
            shown.levelled(driven, slopes) for driven in (self.cycles, self.repeated))
        points, drift = shown.without_drift(cycles, repeated)
        sigmoid, error = fit_sigmoid([p.actual_speed for p in points], [p.current for p in points])
        # The table is that of the speeds that were requested.
        points = sorted((replace(point, current=point.current + float(
            sigmoid(point.speed) - sigmoid(point.actual_speed))) for point in points),
            key=lambda point: point.speed)
        # The encoder's step: that of the drive, or a coarser one that was seen.
        seen = [smallest_step(ramp.samples[:, 1]) for ramp in self.ramps]
        found = shown.evaluate_ramps(
            self.ramps, max(self._resolution, min(filter(None, seen), default=0.0)),
            self.supervision.acceleration, sigmoid.viscous)
        breakaway, misfit = shown.breakaway_of(self.ramps), curve_misfit(points, sigmoid)
        say = self.supervision.say
        warnings = [
            *self.warnings, *doubts_of_cycles(cycles, drift, slopes), *found.warnings,
            *doubts_of_ramps(breakaway, points, self.goal.breakaway_cycles,
                             self.supervision.step, found.presliding, say),
            *doubts_of_curve(points, sigmoid, misfit, say)]
        return IdentificationResult(
            points=points, sigmoid=sigmoid, sigmoid_error=error, breakaway=breakaway,
            breakaways=found.breakaways, goal=replace(self.goal, ramp_slope=self.ramp_slope),
            uncertainty=uncertainty_of(cycles, repeated, misfit),
            warnings=warnings,
            drift=drift, presliding=found.presliding, backlash=found.backlash)


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
        # It slides faster than 0.05 rad/s over 20 ms, by more than some counts.
        counts = 8.0 * self._resolution
        if moved <= counts or speed_over(self._window, self.sign, 0.02) <= 0.05:
            self._began = None
        elif self._began is None:
            self._began = moved
        # At this speed, or since its last rest, it has slid 5 mrad: a rotor that crosses backlash
        # also slides, and is then stopped.
        self.gone = (moved > self._farthest
                     or (self._began is not None and moved > self._began + 5e-3)
                     or (self.slides and self.sign * (sample.position - self._rested)
                         > max(5e-3, counts)))

    def rest(self) -> None:
        """Take note that the joint came to rest."""
        self.slides, self._rested = False, self.samples[-1].position


# The result.

@dataclass(frozen=True)
class IdentificationResult:
    """Result of an identification."""

    points: list[KineticPoint]      # the look-up table in ascending speed, negative speeds first
    sigmoid: Sigmoid                # fit of Eq. 6
    sigmoid_error: float            # E of Eq. 7, A
    breakaway: Breakaway
    breakaways: np.ndarray          # every single one, A, signed, in order of time
    goal: IdentificationGoal
    uncertainty: float              # share by which friction may differ, half of a 95 % interval
    warnings: list[str] = field(default_factory=list)
    presliding: Presliding | None = None        # None if the encoder is too coarse
    backlash: float | None = None               # rad; None if the ramps show none
    # How much friction at a speed in rad/s drifted, a share of it; empty if it hardly did.
    drift: dict[float, float] = field(default_factory=dict)

    def _column(self, name: str) -> np.ndarray:
        return np.array([getattr(point, name) for point in self.points])

    speeds = property(lambda self: self._column('speed'), doc='Of the look-up table, rad/s, (N,).')
    currents = property(lambda self: self._column('current'), doc='Their mean currents, A, (N,).')
    standard_deviations = property(lambda self: self._column('standard_deviation'),
                                   doc='Of the current at each speed, A, (N,).')

    @property
    def coefficients(self) -> tuple[float, ...]:
        """c1..c6 of Eq. 6 with velocity in rad/s."""
        return self.sigmoid.coefficients()

    def model(self, drive: Drive, joint: str = '',
              position_limits: tuple[float, float] | None = None,
              carrying: Sequence[Effect] = (), arm: Arm | None = None) -> FrictionModel:
        """Return the drive's model, with the effects whose current was `carried`, and their `arm`.

        Breakaway is then what it takes beside them, at any position.
        """
        breakaway = self.breakaway if not carrying else replace(
            self.breakaway, positive_position=None, negative_position=None)
        return FrictionModel(
            drive=drive, position_limits=position_limits, joint=joint,
            sigmoid=self.sigmoid, breakaway=breakaway, presliding=self.presliding,
            uncertainty=self.uncertainty, effects=list(carrying), arm=arm if carrying else None,
            lookup_table={name: getattr(self, name).tolist() for name in (
                'speeds', 'currents', 'standard_deviations')},
            notes={
                'source': 'identification: constant velocities and current ramps',
                'sigmoid_error': self.sigmoid_error,
                **{name: getattr(self.goal, name) for name in (
                    'motion_range', 'ramp_slope', 'ramp_period', 'breakaway_cycles')},
                'drift': [{'speed': speed, 'share': share} for speed, share in self.drift.items()],
                'warnings': list(self.warnings),
            })


def uncertainty_of(cycles: Sequence[Cycle], repeated: Sequence[Cycle], misfit: float) -> float:
    """Return the share by which sliding friction may differ, half of a 95 % interval.

    From the standard errors of the means, from how far friction moved between repetitions, and from
    `misfit`, the share of friction by which the curve of Eq. 6 is off the table (RMS).
    """
    both = shown.pairs(cycles, repeated)
    moved = [change / a.friction for (a, _), sides in zip(both, shown.changes(both))
             for change in sides]
    # The difference of two measurements scatters by the root of two more than one.
    again = rms(np.array(moved)) / math.sqrt(2.0) if moved else 0.0
    return 2.0 * math.hypot(rms(np.array([cycle.error for cycle in cycles])), again, misfit)


def curve_misfit(points: Sequence[KineticPoint], sigmoid: Sigmoid) -> float:
    """Return by how much the curve of Eq. 6 is off the look-up table, RMS, a share of friction."""
    errors = np.array([float(sigmoid(point.speed)) - point.current for point in points])
    return rms(errors) / max(float(np.mean([abs(point.current) for point in points])), 1e-9)


# What is doubtful, as texts.

def doubts_of_cycles(cycles: Sequence[Cycle], drift: dict[float, float],
                     slopes: Sequence[float] = (0.0, 0.0)) -> list[str]:
    """Return what is doubtful about cycles: currents, scatter, drift, and what rises over position.

    `slopes` are those of `position_slopes`, A/rad.
    """
    measured = sum(cycle.friction for cycle in cycles)
    gain = measured / sum(replace(cycle, points=cycle.commanded).friction for cycle in cycles)
    offset = sum(one.current - other.current for cycle in cycles
                 for one, other in zip(cycle.points, cycle.commanded)) / (2.0 * measured)
    worst = max(cycles, key=lambda cycle: cycle.scatter)
    sizes = ', '.join(f'by {share:+.1%} at {speed:.3g} rad/s' for speed, share in drift.items())
    # By how much friction and the load rise from the middle to an end, shares of friction.
    half = 0.5 * max(float(np.ptp(cycle.samples[:, 1])) for cycle in cycles)
    rises, loads = (0.5 * half * len(cycles) / measured * abs(slopes[0] + side * slopes[1])
                    for side in (-1.0, 1.0))
    return [text for applies, text in (
        (abs(gain - 1.0) > _CURRENTS,
         f'the measured current is {gain:.2f} times the commanded one: torque constant, gear ratio '
         'or current controller deviate from the model file, and friction is the measured one'),
        (abs(offset) > _CURRENTS,
         f'the measured current is off the commanded one by {offset:+.0%} of friction in both '
         'directions: the current sensor has an offset, now part of the model'),
        (worst.scatter > MAX_SCATTER,
         f'at {worst.speed:.3g} rad/s, the current varies by ±{worst.scatter:.0%} of friction, '
         'with lower gains as well: friction varies there, or the joint oscillates under its '
         'velocity controller'),
        (sizes, f'friction drifted during the measurement: {sizes}. The look-up table and its '
         'curve are those of the end, breakaway is the mean of the time before. Let the drive warm '
         'up, then identify it again'),
        (rises > 0.05, f'friction rises over position, by about ±{rises:.0%} of friction: the '
         'table has means over the range, breakaway is that of its middle'),
        (loads > 0.05, f'the load rises over position, by about ±{loads:.0%} of friction: gravity, '
         'or a spring. Add it with refine, since compensated friction no longer holds a weight')
        ) if applies]


def doubts_of_ramps(breakaway: Breakaway, points: Sequence[KineticPoint], cycles: int, step: float,
                    presliding: Presliding | None, say: Callable[[float], str]) -> list[str]:
    """Return what is doubtful about `cycles` ramps a direction, with samples every `step`, s.

    Gravity, a spring, or a person adds to friction in one direction, and gravity to look-up table
    and breakaway alike. Raises IdentificationError if a person leant on the joint; `say` returns a
    current as text.
    """
    friction, shift = breakaway.friction, breakaway.held
    spread = max(breakaway.positive_std, breakaway.negative_std)
    sliding = 0.5 * sum(float(np.mean([
        point.current for point in points if point.speed * sign > 0.0])) for sign in (1, -1))
    if spread > _TOUCHED * friction:
        raise IdentificationError(f'breakaway scatters by {say(spread)} around {say(friction)}: '
                                  'the joint was touched during the measurement')
    if abs(shift - sliding) > _TOUCHED * friction:
        raise IdentificationError(
            f'the load was {say(sliding)} while the joint moved, but {say(shift)} when it broke '
            'free: somebody leant on it during part of the run')
    more = 2.0 * max(shift, sliding, key=abs)
    return [text for applies, text in (
        (abs(more) > 0.24 * friction,
         f'the {"positive" if more > 0.0 else "negative"} direction needs {say(abs(more))} more '
         'than the other: gravity or a spring, friction that differs, or somebody leant on the '
         'joint. If it is a weight, add it to the model with refine before people let go: '
         'compensated friction holds it no longer'),
        (cycles == 1, 'breakaway was measured once in each direction: how much it scatters is not '
         'known. Request four breakaway_cycles or more'),
        (presliding is not None and step * PRESLIDING_RATE > 1.05,
         f'presliding was measured at {1.0 / step:.0f} Hz: below {PRESLIDING_RATE:.0f} Hz it is '
         'usually a fifth too long and may be more than twice as long as it is, which costs help '
         'where no direction is announced')) if applies]


def doubts_of_curve(points: Sequence[KineticPoint], sigmoid: Sigmoid, misfit: float,
                    say: Callable[[float], str]) -> list[str]:
    """Return where the curve of Eq. 6 is off the look-up table; `say` returns a current as text."""
    if misfit <= 0.03:
        return []
    off, point = max(((abs(float(sigmoid(one.speed)) - one.current), one) for one in points),
                     key=lambda entry: entry[0])
    return [f'the curve of Eq. 6 is off the look-up table by {misfit:.0%} of friction (RMS), most '
            f'at {point.speed:g} rad/s, where {say(abs(point.current))} were measured, by '
            f'{say(off)}: compensation follows the curve. Refine a recording with this model, or '
            'request other speeds']
