# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Prepares recordings as rows of a fit, each in a regime of motion.

Velocity and acceleration come from one zero-phase filter. Each measured signal, such as a load, has
a filter of its own: noise that is left in it lowers its coefficient, and other terms take the rest.
All are chosen by how well a plain drive predicts regimes that were not fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
import functools
import math
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.facts.motion import positions
from friction_comp.model.arm import moving_states
from friction_comp.model.differentiation import (
    differentiate,
    filters,
    METHOD,
    prepared_signal,
    with_signals,
)
from friction_comp.model.effect import Coverage
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement import thresholds
from friction_comp.refinement.block_sums import BlockSums, held_out_error, regimes_of
from friction_comp.samples import Samples
from friction_comp.statistics import evenly_spread, rms, top_speed

_BANDWIDTHS = (5.0, 10.0, 20.0, 40.0, 80.0, 120.0, 200.0)
# The same for measured signals: a thermometer is slow.
_SIGNAL_BANDWIDTHS = (0.03, 0.1, 0.3, 1.0, 2.5, 5.0, 7.0, 10.0, 15.0, *_BANDWIDTHS[2:])
# Widest bandwidth of a filter as a share of the rate.
_WIDEST = 0.3
# Samples of noise that stand for an encoder's steps.
_COUNTED = 2000
# Shares of the top speed over which friction may change sign.
TRANSITIONS = (0.3, 0.1, 0.03, 0.01, 0.003)
# Share of the top speed above which a smooth velocity is right, and the most rows with it.
_FAST, _SMOOTH_ROWS = 0.1, 12000


def plain_columns(samples: Samples, transitions: Sequence[float] = ()) -> np.ndarray:
    """Return the columns of a plain drive: friction, inertia, weight and load.

    Friction changes its sign over `transitions`, rad/s, by default `TRANSITIONS` of the usual top
    speed.
    """
    v, q = np.asarray(samples.velocity), samples.position
    transitions = transitions or np.percentile(np.abs(v), 95) * np.array(TRANSITIONS)
    columns = [np.ones_like(v), *(np.tanh(v / width) for width in transitions), v,
               np.asarray(samples.acceleration), np.cos(q), np.sin(q)]
    if np.ptp(q) < 2.0:
        columns.append(q)
    for load in (samples.load, samples.rigid_body):
        if load is not None:
            columns += [load, np.abs(load) * np.tanh(v / transitions[-1])]
    return np.column_stack(columns)


def candidate_settings(samples: Samples, velocity: np.ndarray | None,
                       bandwidths: Sequence[float] = _BANDWIDTHS) -> list[dict[str, Any]]:
    """Return the differentiation settings to compare; `velocity` is as recorded, if it was."""
    # The last bandwidth, half of the rate, does not filter this recording. Of a faster one it
    # removes what this one cannot show.
    rate = 1.0 / max(samples.sample_time, 1e-9)
    values = [*(value for value in bandwidths if value <= _WIDEST * rate), 0.5 * rate]
    recorded = velocity is not None and np.any(velocity, axis=0).all()
    sources = ('position', 'velocity') if recorded else ('position',)
    return [{'method': METHOD, 'source': source, 'bandwidth': value}
            for source in sources for value in values]


def resolved_settings(samples: Samples) -> list[dict[str, Any]]:
    """Return the differentiation settings to compare, at which motion is not an encoder's steps.

    A controller that responds to the steps makes them predict the current at wider bandwidths.
    """
    choices = candidate_settings(samples, samples.velocity)
    piece = samples.take(np.arange(min(len(samples), _COUNTED)))
    random = np.random.default_rng(0).random(len(piece))
    steps = piece.with_(position=samples.position_step * random)

    def acceleration(of: Samples, choice: dict[str, Any]) -> float:
        return rms(np.asarray(differentiate(of, choice).acceleration))
    # The narrowest filter shows the motion.
    most = thresholds.ENCODER_STEPS * acceleration(samples, choices[0])
    return [choice for choice in choices if choice is choices[0] or choice['source'] == 'velocity'
            or acceleration(steps, choice) <= most]


def standstill_speed(samples: Samples) -> float:
    """Return the speed below which the joint counts as standing still, rad/s.

    A hundredth of the usual top speed, or more where the resolution of position hides slow motion.
    """
    speed = np.abs(np.asarray(samples.velocity))
    top = top_speed(speed)
    quiet = speed[speed < 0.02 * top]
    noise = 3.0 * rms(quiet) if quiet.size > 50 else 0.0
    return float(min(max(0.01 * top, noise), 0.05 * top))


def widened(mask: np.ndarray, reach: int) -> np.ndarray:
    """Return which samples are within `reach` of one that a mask, bool, shape (N,), selects."""
    count = np.concatenate(([0], np.cumsum(mask)))
    index = np.arange(len(mask))
    return count[np.minimum(index + reach + 1, len(mask))] > count[np.maximum(index - reach, 0)]


def in_motion(samples: Samples, slowest: float, bandwidth: float | None = None,
              unusable: np.ndarray | bool = False) -> np.ndarray:
    """Return which samples show friction; raises `InputError` if too few are in motion.

    Unless too few would remain, those near standstill and gaps are left out, where the filter mixes
    in samples without motion, and slow ones near a rest, where friction still builds up.
    """
    speed = np.abs(np.asarray(samples.velocity))
    still = speed <= slowest
    moving = ~(still | unusable)
    ends = np.zeros(len(samples), dtype=bool)
    for part in samples.segments():
        ends[[part.start, part.stop - 1]] = True
    filter_samples = round(0.5 / (bandwidth * samples.sample_time)) if (
        filters(bandwidth, samples.sample_time)) else 0
    rest_samples = round(thresholds.REST / samples.sample_time)
    # Without runs that are shorter than a rest.
    rest = ~widened(~still, rest_samples // 2)
    starts = widened(rest, rest_samples + rest_samples // 2)
    starts &= speed < thresholds.PRESLIDING_SPEED * top_speed(speed)
    for mask in (widened(still, filter_samples), widened(ends, filter_samples), starts):
        remaining = moving & ~mask
        if remaining.sum() > 0.8 * moving.sum():
            moving = remaining
    if moving.sum() < thresholds.FEWEST_SAMPLES:
        limited = (unusable & ~still).sum() >= thresholds.FEWEST_SAMPLES
        idle = limited and np.mean(samples.current[~still] == 0.0) > 0.5
        raise InputError(
            ('the current is zero in nearly all motion of the recordings, where the motor has to '
             'move the joint (where a hand moves it, its torque may be the effort): ' if idle else
             'the current is at a limit in nearly all motion of the recordings: '
             if limited else 'the joint hardly moves in the recordings: '
             if np.mean(still) > 0.5 else 'the recordings are short: ')
            + f'{int(moving.sum())} samples of motion are too few')
    return moving


def moving(samples: Samples, model: FrictionModel) -> np.ndarray:
    """Return which samples refinement would fit, bool, (N,); InputError if they are too few."""
    moved = model.differentiated(samples)
    return in_motion(moved, standstill_speed(moved), model.settings.get('bandwidth'))


def regimes_in(samples: Samples, index: np.ndarray, others: Sequence[np.ndarray] = ()
               ) -> np.ndarray:
    """Return the regime of motion of the samples of an `index`, shape (R,).

    Regimes differ in position, speed, acceleration and load; where other joints moved too, whose
    positions are `others`, each (N,), in posture: a wrong term may fit one posture alone. Each has
    both directions, without which Coulomb friction is an offset.
    """
    position, turn = samples.position, 2.0 * math.pi
    # A joint that turns on is at the same places again.
    place = position % turn if np.ptp(position[index]) > turn else position
    signals = others or (place, np.abs(np.asarray(samples.velocity)), samples.acceleration,
                         samples.load, samples.rigid_body)
    return regimes_of([values[index] for values in signals if values is not None],
                      int(thresholds.REGIMES))


@dataclass(frozen=True)
class Problem:
    """The input of refinement, and what is known of it before velocity and acceleration are."""

    raw: Samples  # all recordings
    drive: Drive
    declared: bool = True  # whether torque constant and gear ratio are known
    model: FrictionModel | None = None  # the initial one
    linear: bool = False  # whether positions are in m

    @functools.cached_property
    def choices(self) -> list[dict[str, Any]]:
        """The differentiation settings to compare."""
        return resolved_settings(self.raw)

    @functools.cached_property
    def smooth(self) -> dict[str, Any]:
        """The settings of the widest filter without an encoder's steps."""
        most = min(20.0, _WIDEST / self.raw.sample_time)
        return max((choice for choice in self.choices if choice['bandwidth'] <= most),
                   key=lambda choice: (choice['bandwidth'], choice['source']),
                   default=self.choices[-1])

    @functools.cached_property
    def _motions(self) -> dict[tuple[Any, ...], Samples]:
        return {}

    def moved(self, settings: dict[str, Any]) -> Samples:
        """Return the recordings as `differentiate` does, which are asked for again and again."""
        plain = {name: settings[name] for name in ('method', 'source', 'bandwidth')}
        known, key = self._motions, tuple(plain.values())
        if key not in known:
            known[key] = differentiate(self.raw, plain)
        return with_signals(known[key], settings)

    @functools.cached_property
    def smoothed(self) -> Samples:
        """The recordings with a smooth velocity.

        Without a filter, an encoder's steps look like standstill and bursts.
        """
        return self.moved(self.smooth)

    @functools.cached_property
    def smooth_rows(self) -> np.ndarray:
        """Return the indices of (some of) the samples in motion, where smooth velocity is right."""
        moved = self.smoothed
        usable = in_motion(
            moved, standstill_speed(moved), self.smooth['bandwidth'], self.clipped)
        speed = np.abs(np.asarray(moved.velocity))
        fast = usable & (speed > _FAST * np.percentile(speed[usable], 95))
        # A smooth velocity is wrong where friction changes its sign.
        usable = fast if fast.sum() > 0.5 * usable.sum() else usable
        return np.flatnonzero(usable)[::max(1, int(usable.sum()) // _SMOOTH_ROWS)]

    @functools.cached_property
    def clipped(self) -> np.ndarray:
        """Which samples are at a limit of the current, bool, (N,)."""
        return clipped(self.raw.current)

    @functools.cached_property
    def joints(self) -> tuple[str, ...]:
        """All joints that moved, none where no other did.

        Beside known rigid bodies they are neighbours: only these have friction in common.
        """
        arm, joint = self.raw.arm, self.raw.joint
        if arm is None or self.raw.coupling is not None or joint not in arm.joints:
            return ()
        names, own = arm.joints, arm.joints.index(joint)
        if self.raw.rigid_body is not None:
            names = names[max(0, own - 1):own + 2]
        span = np.ptp(arm.of(names).position, axis=0)
        names = tuple(name for name, moved in zip(names, span) if moved > 1e-3 or name == joint)
        return names if len(names) > 1 else ()

    @functools.cached_property
    def load_coefficient(self) -> float:
        """-1/(k_t·n), A/(N·m), if the load must enter with this coefficient; 0 if it is fitted.

        By J·a = k_t·n·i + τ_b - F, friction is i + τ_b/(k_t·n). If the current shows the load, that
        is if the load lowers the error of parts that were not fitted, with half to twice this
        coefficient, the motor carries it, and its coefficient is fitted as that of an effect. If it
        does not, but the load overcomes friction or accelerates the joint, then a person moves it,
        and the current is that of a compensation law or zero: the known coefficient has to be used.
        A sensor behind the gear may show the torque of the motor on the links instead, of the other
        sign: then friction and inertia alone predict parts that were not fitted, without a weight,
        and only with that sign. The current shows that torque: again its coefficient is fitted.
        """
        if not self.declared or self.raw.load is None or not np.any(self.raw.load):
            return 0.0
        mechanics, start = -1.0 / self.drive.torque_per_current, self.smooth_rows
        part = self.smoothed.take(start)
        # Whether a load moves the joint is no question of other motion: parts of time.
        block = np.arange(len(start)) * int(thresholds.REGIMES) // len(start)
        velocity, load = np.asarray(part.velocity), np.asarray(part.load)
        columns = plain_columns(part.with_(load=None))
        plain = range(columns.shape[1])
        sums = BlockSums.over(np.vstack((columns.T, load, part.current)), block)
        without, fitted = (float(sums.held_out_errors(some).sum())
                           for some in (plain, [*plain, len(plain)]))
        shown = sums.fit([*plain, len(plain)])[-1] / mechanics
        if fitted < (1.0 - thresholds.LEAST_SHARE) * without and 0.5 < shown < 2.0:
            return 0.0
        # Its mean power against friction: that of its Coulomb and viscous columns, since gravity
        # and inertia return what they take. The blocks left out in turn give its standard error,
        # and that of the inertia, the column after these.
        last = len(TRANSITIONS) + 2
        fits = BlockSums.over(np.vstack((columns.T, load)), block).fits(
            plain, 1.0 - np.eye(int(block.max()) + 1))
        power = fits[:, 1:last] @ (columns[:, 1:last].T @ velocity)
        # With twice the usual margin, since a sensor's load of the wrong sign would count twice.
        moves = any(values.mean() > 2.0 * thresholds.STANDARD_ERRORS * np.sqrt(
            (len(values) - 1) * np.var(values)) for values in (power, fits[:, last]))
        # Inertia is the last of these columns, of which none is a weight.
        inner, turned = columns[:, :last + 1], part.current + mechanics * load
        given = part.current - mechanics * load
        of_given, of_turned = (held_out_error(inner, target, block) for target in (given, turned))
        # Of its own size: a part of friction has the same shape, and a smaller error.
        least = 1.0 - thresholds.LEAST_SHARE
        if (of_turned * (given @ given) < least * of_given * (turned @ turned)
                and least * of_turned < held_out_error(columns, given, block)):
            return 0.0
        return mechanics if moves else 0.0

    @functools.cached_property
    def target(self) -> np.ndarray:
        """The current that a model has to explain, A, (N,)."""
        load = self.load_coefficient
        return self.raw.current - load * np.asarray(self.raw.load) if load else self.raw.current

    @functools.cached_property
    def plain_settings(self) -> dict[str, Any]:
        """The settings with which a plain drive predicts other regimes best."""
        start = self.smooth_rows
        block, target = regimes_in(self.smoothed, start), self.target[start]
        carried = {'load': None} if self.load_coefficient else {}

        def error(moved: Samples) -> float:
            part = moved.take(start).with_(**carried)
            if not np.percentile(np.abs(np.asarray(part.velocity)), 95) > 0.0:
                # Without a filter, a coarse encoder stands still in nearly all samples.
                return math.inf
            return held_out_error(plain_columns(part), target, block)
        # The load first, since noise in motion may make up for its noise.
        signals = choose_signals(self.raw, () if carried else ('load',), lambda **changed: error(
            self.smoothed.with_(**changed)))
        errors = [(error(self.moved(choice)), choice) for choice in (
            {**choice, **signals} for choice in self.choices)]
        least = min(one for one, _ in errors)
        # A narrow filter blunts reversals, so the widest of equivalent ones is used. The less of
        # the current a plain drive explains, the less its error says about the bandwidth.
        unexplained = least / max(float(target @ target), 1e-300)
        most = ((1.0 + thresholds.EQUIVALENT) ** 2 + 0.4 * unexplained) * least
        # Between two sources with the same bandwidth the later one, the recorded velocity, wins.
        return max((choice for one, choice in reversed(errors) if one <= most),
                   key=lambda choice: choice['bandwidth'])


def choose_signals(samples: Samples, names: Iterable[str], error: Callable[..., float]
                   ) -> dict[str, Any]:
    """Return the entry `signals` of settings: the best bandwidths of some measured signals.

    `error` returns the squared error in other regimes with one of them changed, by its name.
    """
    chosen: dict[str, Any] = {}
    for name in names:
        values = getattr(samples, name)
        if values is None or not np.ptp(values) > 0.0:
            continue
        rate = 1.0 / samples.sample_time
        prepared = {value: prepared_signal(samples, values, value) for value in (
            *(value for value in _SIGNAL_BANDWIDTHS if value <= _WIDEST * rate), 0.5 * rate)}
        errors = {value: error(**{name: own}) for value, own in prepared.items()}
        most = (1.0 + thresholds.EQUIVALENT) ** 2 * min(errors.values())
        bandwidth = max(value for value, error_ in errors.items() if error_ <= most)
        if not np.array_equal(prepared[bandwidth], values):
            chosen[name] = {'bandwidth': bandwidth}
    return {'signals': chosen} if chosen else {}


def settings_for_arm(samples: Samples, settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings for the motion of all joints, from position if velocity was not recorded."""
    settings = {name: value for name, value in settings.items() if name != 'signals'}
    if samples.arm is not None and samples.arm.velocity is None:
        return {**settings, 'source': 'position'}
    return settings


# A limit occurs more often than this multiple of the value next to it. At its turning points, a
# sine in coarse steps has 2.4 times as many samples in the outermost step.
_MORE_OFTEN = 3.0
# As many different currents, or fewer, are a command: both directions, and none.
_LEVELS = 3
# How many rows are kept or left out together.
_PIECE = 100


@dataclass(frozen=True)
class Rows:
    """The data of a fit: N samples, R of which are its rows, in blocks."""

    samples: Samples  # with velocity and acceleration
    target: np.ndarray  # (N,): current that the model has to explain, A
    usable: np.ndarray  # (N,): which samples are fitted
    coverage: Coverage
    index: np.ndarray  # (R,): sample of each row
    block: np.ndarray  # (R,): regime of motion, which is left out of a fit as a whole
    # Current per load, A/(N·m), where the load is part of the target; otherwise 0.
    load_coefficient: float = 0.0
    # Position, velocity and acceleration, each (N, J), of all joints where others moved too.
    motion: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
    joints: tuple[str, ...] = ()  # names of these joints
    torque_per_current: float = 1.0  # N·m/A at the joint, 1 where it is not known

    @property
    def blocks(self) -> int:
        """Number of regimes."""
        return int(self.block.max()) + 1

    @functools.cached_property
    def parts(self) -> list[slice]:
        """The rows of each regime, which follow each other."""
        edges = np.searchsorted(self.block, np.arange(self.blocks + 1)).tolist()
        return [slice(*ends) for ends in zip(edges, edges[1:])]

    @functools.cached_property
    def at_rows(self) -> Samples:
        """The samples that are rows."""
        return self.samples.take(self.index)

    @property
    def block_of_sample(self) -> np.ndarray:
        """The regime of each sample, that of the row before it, shape (N,)."""
        order = np.argsort(self.index)
        before = np.searchsorted(self.index[order], np.arange(len(self.samples)), side='right') - 1
        return np.asarray(self.block[order][np.clip(before, 0, None)])


def join(recordings: Sequence[Samples] | Samples) -> Samples:
    """Join recordings, without samples that are not finite; raises `InputError` if too few."""
    if isinstance(recordings, Samples):
        recordings = [recordings]
    if not all(isinstance(r, Samples) for r in recordings):
        raise InputError('recordings must be a list of Samples, as read_recording returns it')
    # Sorted by content, so that neither the order in which files are named makes a difference, nor
    # a sign or an origin; the last digits may be rounding.
    recordings = sorted((part for part in recordings if len(part)), key=lambda part: (
        len(part), f'{np.ptp(part.position):.6e}', float(np.std(part.current))))
    if not recordings:
        raise InputError('the recordings hold no samples')
    samples = Samples.concatenate(recordings) if len(recordings) > 1 else recordings[0]
    valid = np.isfinite(samples.time) & np.isfinite(samples.position)
    valid &= np.isfinite(samples.current)
    for name in ('velocity', 'load', 'temperature'):
        values = getattr(samples, name)
        if values is None:
            continue
        if np.mean(np.isfinite(values)) < 0.5:
            samples = samples.with_(**{name: None})
        else:
            valid &= np.isfinite(values)
    samples = samples if valid.all() else samples.take(valid)
    if len(samples) < thresholds.FEWEST_SAMPLES:
        raise InputError(f'{len(samples)} usable samples are too few: at least '
                         f'{thresholds.FEWEST_SAMPLES:.0f} are needed')
    if not samples.sample_time > 0.0:
        raise InputError('all time stamps of the recordings are equal')
    if np.ptp(samples.position) == 0:
        raise InputError('the joint never moves in the recordings: there is no friction to fit')
    return samples


def clipped(current: np.ndarray) -> np.ndarray:
    """Return which samples sit at the limits of the current signal, shape (N,).

    Runs of samples repeat a limit exactly, and much more often than the value next to it: neither a
    noisy signal nor one in coarse steps does so. A current of a level each way was commanded so.
    """
    mark = np.zeros(len(current), dtype=bool)
    span = float(np.ptp(current))
    if span == 0:
        return mark
    for extreme in (current.max(), current.min()):
        distance = np.abs(current - extreme) / span
        at_limit = distance <= 1e-6
        inner = distance[(distance > 1e-6) & (distance < 1.0 - 1e-6)]
        beside = np.sum(inner <= inner.min() + 1e-6) if inner.size else 0
        runs, count = at_limit[1:] & at_limit[:-1], at_limit.sum()
        if (count >= max(20, 1e-3 * len(current)) and runs.sum() >= 0.5 * count
                and count > _MORE_OFTEN * beside):
            mark |= at_limit
    if mark.any() and current.min() < 0.0 < current.max() and len(np.unique(current)) <= _LEVELS:
        mark[:] = False
    return mark


def prepare(problem: Problem, settings: dict[str, Any]) -> Rows:
    """Return the rows that effects are fitted to, with motion by differentiation settings."""
    samples, joints, moved = problem.raw, problem.joints, problem.moved(settings)
    slowest = standstill_speed(moved)
    usable = in_motion(moved, slowest, settings['bandwidth'], problem.clipped)
    motion = moving_states(
        samples, joints, settings_for_arm(samples, settings)) if joints else None
    # Of many, pieces from everywhere.
    index = np.flatnonzero(usable)
    index = index[evenly_spread(np.arange(len(index)) // _PIECE) < thresholds.ROWS / len(index)]
    # Rigid bodies are the same in all postures.
    others = list(motion[0].T) if motion and samples.rigid_body is None else []
    block = regimes_in(moved, index, others)
    order = np.argsort(block, kind='stable')
    target, load = problem.target, problem.load_coefficient
    if load:
        # Here, the load is as its filter leaves it.
        target = moved.current - load * np.asarray(moved.load)
    # Squares of smaller numbers are 0; an effort that was never set can hold such numbers.
    if not np.abs(target[usable]).max() > math.sqrt(np.finfo(float).tiny):
        why = '; the motor has to move the joint' if samples.load is None or problem.declared else (
            ' without torque constant and gear ratio, which say how much of the recorded load it '
            'is; 1 for both gives friction in N·m')
        raise InputError('the current is zero throughout the motion: there is no friction to fit'
                         + why)
    rows = Rows(
        samples=moved, target=target, usable=usable,
        coverage=replace(coverage_of(moved, usable, slowest, samples), linear=problem.linear),
        index=index[order], block=block[order], load_coefficient=load,
        motion=motion, joints=joints, torque_per_current=problem.drive.torque_per_current)
    return replace(rows, coverage=replace(rows.coverage, transition=choose_transition(rows)))


def choose_transition(rows: Rows) -> float:
    """Return the velocity in rad/s over which friction changes sign: tanh(v/transition)."""
    speed = rows.coverage.speed
    part, target = rows.at_rows, rows.target[rows.index]
    if rows.load_coefficient:
        part = part.with_(load=None)
    best = (math.inf, speed)
    for width in np.geomspace(0.001, 0.25, 12) * speed:
        error = held_out_error(plain_columns(part, [width]), target, rows.block)
        if error < (1.0 - thresholds.EQUIVALENT) * best[0]:
            best = (error, float(width))
    return best[1]


def coverage_of(samples: Samples, usable: np.ndarray, slowest: float, raw: Samples) -> Coverage:
    """Return the ranges that recordings cover; only the raw positions show the encoder's counts."""
    moving = samples.take(usable)
    # Only within one recording can a time constant be observed.
    duration = max(float(np.ptp(samples.time[samples.recording == r]))
                   for r in np.unique(samples.recording))
    lowest, highest = np.percentile(moving.position, (1, 99))
    velocity = np.asarray(moving.velocity)
    moves = np.abs(velocity)
    # How far the joint moved, against its range, of a turn at most.
    path, span = float(moves.sum()) * samples.sample_time, float(np.ptp(moving.position))
    slow, speed = np.percentile(moves, (5, 95))
    resting = np.abs(np.asarray(samples.velocity)) < slowest
    temperature, temperature_span = 25.0, 0.0
    if samples.temperature is not None:
        temperature = float(np.median(samples.temperature))
        temperature_span = float(np.ptp(np.percentile(samples.temperature[usable], (1, 99))))
    return Coverage(
        transition=0.05 * float(speed), speed=float(speed), slowest=slowest, lowest=float(lowest),
        highest=float(highest), duration=duration, temperature=temperature,
        resolution=raw.position_step,
        # By distance: at rest, noise goes both ways.
        both_directions=0.02 < float(np.maximum(velocity, 0.0).sum() / moves.sum()) < 0.98,
        passed_again=1.0 - 1.0 / max(path / min(span, 2.0 * math.pi), 1.0), slow=float(slow),
        reversals=float(np.count_nonzero(np.diff(np.sign(velocity)))),
        rest_duration=float(np.sum(resting)) * samples.sample_time,
        distinct_positions=positions(raw.position[usable]),
        temperature_span=temperature_span,
        speed_spread=float(np.std(moves) / np.mean(moves)))
