# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Estimates a model's error on other recordings and how far to trust it.

The error expected on another recording follows from the growth of errors in thirds of the recording
that were not fitted; see `error_growth`. Everything else to report is one of the `findings`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
import math

import numpy as np

from friction_comp.drive import Drive
from friction_comp.facts.motion import STANDSTILL, velocity_agreement
from friction_comp.facts.timing import lost_rows
from friction_comp.model.effects import Coverage, EFFECTS
from friction_comp.model.effects.base import RESISTS, too_coarse
from friction_comp.model.friction_numbers import FrictionNumbers
from friction_comp.refinement import thresholds
from friction_comp.refinement.best_fit import Fit
from friction_comp.refinement.dependence import Dependence, rank_correlation
from friction_comp.refinement.effect_columns import Table
from friction_comp.refinement.findings import experiment, finding
from friction_comp.refinement.prepare import Rows
from friction_comp.refinement.result import Errors, Finding, FoundEffect, Predicted, Question
from friction_comp.refinement.search import Search
from friction_comp.refinement.stability import Disagreement, POSTURE, RECORDING, starts_of
from friction_comp.samples import Samples
from friction_comp.statistics import rms, robust_std

STEPS = 'steps of the velocity'
"""Stands among variables for the error that `report.error_by_steps` returns."""
# Every so many samples show whether joints move as one.
_EVERY = 10
# Waves a turn of 2π of what repeats once a turn, where positions are in these units instead of rad,
# and the share of cases in which chance may say so.
_TURNS, _CHANCE = {'turn': 2.0 * math.pi, 'deg': 2.0 * math.pi / 360.0}, 0.01


def errors_of(rows: Rows, predicted: Predicted, name: str, growth: float = 1.0) -> Errors:
    """Return the errors of a model; `growth` is the ratio of those in left-out thirds to these."""
    moving, held_out = rows.usable, predicted.held_out
    errors, still = held_out[moving], held_out[~moving]
    block = rows.block_of_sample[moving]
    parts = [rms(errors[block == k]) for k in np.unique(block)]
    variance = float(np.var(rows.target[moving]))
    error, overall = rms(errors), rms(held_out)
    extra = (growth ** 2 - 1.0) * error ** 2 * float(np.mean(moving))
    return Errors(
        model=name, fit_rmse=rms(predicted.own[moving]), held_out_rmse=error,
        held_out_max=float(np.max(np.abs(errors))),
        held_out_r2=1.0 - float(np.mean(errors ** 2)) / variance if variance > 0.0 else 0.0,
        worst_part_rmse=max(parts), standstill_rmse=rms(still) if still.size else None,
        overall_rmse=overall, elsewhere_rmse=max(math.sqrt(overall ** 2 + extra), growth * error),
        elsewhere_motion_rmse=growth * error, part_rmse=parts)


def noise_floor(rows: Rows, residual: np.ndarray) -> float:
    """Return the standard deviation of white noise in the residual, shape (N,), A.

    Second differences remove whatever is smooth over three samples; those of white noise have six
    times its variance. A filtered signal shows less noise than its sensor has.
    """
    consecutive = rows.usable[2:] & rows.usable[1:-1] & rows.usable[:-2]
    step = np.diff(rows.samples.recording)
    consecutive &= (step[1:] == 0) & (step[:-1] == 0)
    second = (residual[2:] - 2.0 * residual[1:-1] + residual[:-2])[consecutive]
    if second.size < 50:
        return rms(residual[rows.usable])
    return float(robust_std(second)) / math.sqrt(6.0)


def ambiguities(fit: Fit) -> list[Question]:
    """Return what the recordings leave open."""
    entries: dict[frozenset[str], Question] = {}

    def add(first: str, second: str, why: str) -> None:
        entries.setdefault(frozenset((first, second)), Question(
            [first, second], why, experiment(first, second)))
    for term in fit.terms[fit.initial_count:]:
        for name in fit.rivals.get(term, ()):
            add(term.kind.variable, EFFECTS[name].variable,
                f"'{name}' in the place of '{term.kind.name}' predicts parts that were not fitted "
                'as well')
    samples = fit.rows.at_rows
    variables = {term.kind.variable for term in fit.terms}
    if samples.temperature is not None and variables & {'time', 'temperature'}:
        correlation = rank_correlation(samples.time, samples.temperature)
        if correlation > thresholds.WARMED_WITH_TIME:
            add('time', 'temperature', 'temperature and time changed together in the recordings '
                f'(rank correlation {correlation:.3f})')
    elif 'time' in variables and samples.temperature is None:
        add('time', 'temperature', 'the drift over time may be the motor warming up, and its '
            'temperature was not recorded')
    # Beside an effect of time, a sweep of frequency is enough.
    drifts = 'time' in variables
    together = {name: rank_correlation(samples.time, np.abs(np.asarray(getattr(samples, name))))
                for name in ('velocity', 'acceleration')[:1 + drifts]}
    name, correlation = max(together.items(), key=lambda entry: entry[1])
    if correlation > (thresholds.SWEPT if drifts else thresholds.SPED_WITH_TIME) and len(
            np.unique(samples.recording)) == 1:
        what = 'speed' if name == 'velocity' else name
        add(name, 'time', f'{what} rose or fell with time throughout the recording (rank '
            f'correlation {correlation:.2f}): drift over time cannot be distinguished from '
            f'dependence on {name}')
    return list(entries.values())


def friction_would_push(rows: Rows) -> str:
    """Return the finding that friction would have to push to explain the current, '' if not.

    It would where Eq. 6 and the terms with which a search begins predict much better with any signs
    than with those that physics requires. If these predict the reversed current clearly better, and
    any signs no better than that, the current is turned round.
    """
    table, found = Table(rows, 2.0 / rows.coverage.transition), ''
    search = Search(table, [])

    def errors(sign: float, bound: bool) -> list[np.ndarray]:
        trial = Table(replace(rows, target=sign * rows.target), *table.transition)
        trial.add(terms, table)
        trial.sums.signs[:] *= bound
        return Search(trial, []).errors(terms)
    for start in starts_of(table):
        terms = search.without_collinear(start)
        as_recorded, turned, free = search.errors(terms), errors(-1.0, True), errors(1.0, False)
        if search.is_improvement(as_recorded, turned) and not search.is_improvement(turned, free):
            return 'turned'
        if free[0].sum() < thresholds.PUSHING_ERROR * as_recorded[0].sum():
            found = 'pushes'
    return found


def moves_as_one(samples: Samples) -> bool:
    """Return whether a joint's position is a linear function of those of the others."""
    arm = samples.arm
    if arm is None or samples.joint not in arm.joints or len(arm.joints) < 2:
        return False
    index, position = arm.joints.index(samples.joint), arm.position[::_EVERY]
    others = np.column_stack((np.ones(len(position)), np.delete(position, index, axis=1)))
    own = position[:, index]
    residual = own - others @ np.linalg.lstsq(others, own, rcond=None)[0]
    return bool(np.var(residual) < (1.0 - thresholds.FOLLOWED_VARIANCE) * np.var(own))


def error_of_constant(rows: Rows) -> float:
    """Return the RMS error of the simplest model in motion, A: the mean of all other parts."""
    block, target = rows.block_of_sample[rows.usable], rows.target[rows.usable]
    count, total = np.bincount(block), np.bincount(block, target)
    return rms(target - ((total.sum() - total) / np.maximum(count.sum() - count, 1))[block])


def friction_shows(fit: Fit) -> bool:
    """Return whether friction lowers the error on parts that were not fitted."""
    table = fit.table
    resisting = {1, 2, *(column for term in fit.terms
                         if (term.group.kind == 'friction' if term.group
                             else term.kind.role == RESISTS)
                         for column in table.columns_of[term])}
    rest = [column for column in table.indices(fit.terms, derivatives=False)
            if column not in resisting]
    without = np.bincount(table.block, table.held_out_errors(rest))
    return Search(table, []).is_improvement([without], [table.block_errors(fit.terms, False)])


def findings_on_model(fit: Fit, raw: Samples) -> Iterator[Finding]:
    """Yield findings on a fit that no drive can have, and on a person who may have helped."""
    if not friction_shows(fit):
        yield finding('no_friction')
    if (helped := helped_person(raw, any(
            not term.group and term.kind.name == 'inertia' for term in fit.terms))):
        yield helped
    values = fit.table.coefficients(fit.terms)
    for term in fit.terms:
        if term.group:
            continue
        own = [values[column] for column in fit.table.columns_of[term]]
        known = term.kind.known_coefficients(Drive(1.0, 1.0))
        if known is not None and known[0] * own[0] < 0.0:
            yield finding('load_reversed', coefficient=own[0])
        doubt = term.kind({**term.constants, 'coefficients': own}).doubt()
        if doubt:
            yield finding('doubtful', doubt=doubt)


def other_turn(effects: Sequence[FoundEffect]) -> Finding | None:
    """Return the finding that ripples repeat a whole number of times a turn in a unit but rad.

    What a motor or gear repeats, it repeats a whole number of times a turn; the intervals of some
    ripple exclude that, and those of all hold it for another turn, by chance in 1 % of cases.
    """
    waves = [np.array(effect.intervals['frequency']) for effect in effects
             if 'frequency' in effect.intervals]

    def whole(turn: float) -> list[float]:
        """Return the whole number in each interval, NaN where there is none."""
        return [low if (low := math.ceil(ends[0] / turn)) <= ends[1] / turn else math.nan
                for ends in waves]
    if not np.isnan(whole(1.0)).any():
        return None
    for unit, turn in _TURNS.items():
        chance = math.prod(min(float(np.ptp(ends)) / turn, 1.0) for ends in waves)
        numbers = whole(turn)
        if chance < _CHANCE and min(numbers) > 0.0 and not np.isnan(numbers).any():
            return finding('other_turn', unit=unit, numbers=', '.join(
                f'{number:g}' for number in numbers))
    return None


def beyond_what_was_fitted(variable: str, growth: float) -> Finding:
    """Return the finding that the error is `growth` times as large elsewhere."""
    if variable == STEPS:
        return finding('counted', growth=growth)
    if variable == RECORDING:
        return finding('extrapolates', part='A recording', growth=growth,
                       variable='position and speed in each recording')
    if variable == POSTURE:
        return finding('extrapolates', part='A sixth of the postures', growth=growth,
                       variable='the positions of all joints')
    return finding('extrapolates', part=f'A third of the {variable} range', growth=growth,
                   variable=f'{variable}, in another order')


def findings(fit: Fit, raw: Samples, after: Errors, growth: dict[str, float],
             noise: float, dependences: Sequence[Dependence], open_questions: Sequence[Question],
             between: Disagreement | None) -> Iterator[Finding]:
    """Yield all findings on a model.

    `growth` is what `error_growth` returns, `between` how recordings differ.
    """
    rows, held_out = fit.rows, after.held_out_rmse
    constant = error_of_constant(rows)
    # Without friction, nothing tells the sign of a current.
    if (code := friction_would_push(rows)) and (code != 'turned' or friction_shows(fit)):
        yield finding(code)
    variable, largest = max(growth.items(), key=lambda entry: entry[1])
    differ = between is not None and between.ratio > thresholds.GROWTH
    if between is not None and differ:
        yield finding('recordings_differ', **between._asdict())
    expected = max(largest, 1.0) * held_out
    if expected > thresholds.USELESS_ERROR * constant:
        yield finding('explains_nothing', error=expected, constant=constant)
    elif held_out > thresholds.UNEXPLAINED * constant:
        yield finding('explains_part', error=held_out, constant=constant)
    elif held_out > max(thresholds.ABOVE_NOISE * noise, 1e-300,
                        math.sqrt(thresholds.LEAST_SHARE) * constant):
        yield finding('above_noise', error=held_out, times=held_out / noise)
    yield from findings_on_model(fit, raw)
    if largest > thresholds.GROWTH and not (variable == RECORDING and differ):
        yield beyond_what_was_fitted(variable, largest)
    for entry in dependences:
        if entry.strength > thresholds.UNEXPLAINED:
            yield finding('unexplained', variable=entry.variable, note=entry.note)
    for question in open_questions:
        yield finding('ambiguous', variables=question.variables, why=question.why,
                      experiment=question.experiment)
    if -sum(fit.lag) >= rows.samples.sample_time:
        yield finding('late_current', lag=-1e3 * sum(fit.lag))
    yield from findings_on_recording(rows, raw)
    yield from loads_that_hardly_varied(rows, after.elsewhere_motion_rmse)
    yield from notes_on_coverage(rows.samples, rows.coverage)
    # The fit's error comes from block sums, that of the model from `predict` on the recording. Rows
    # average noise out, and samples outside all rows may have larger errors.
    fitted = math.hypot(rms(fit.table.residual(fit.terms, derivatives=False)),
                        noise_floor(rows, rows.target) if rows.length > 1 else 0.0)
    if after.fit_rmse > thresholds.WRITTEN_ERROR * max(fitted, held_out):
        yield finding('written', error=after.fit_rmse, fitted=fitted)


def findings_on_numbers(friction: FrictionNumbers, error: float = math.inf,
                        largest: float = math.inf) -> Iterator[Finding]:
    """Yield numbers that no drive has, and those of which half the interval is a large part.

    One that may be zero, or larger than the held-out `error` of the current by which it was chosen,
    is not known at all. `largest` is the largest current of the recordings.
    """
    if friction.coulomb > thresholds.IMPOSSIBLE * largest:
        yield finding('impossible_friction', value=friction.coulomb, largest=largest)
    names = {'coulomb': 'Coulomb friction', 'viscous': 'viscous friction', 'inertia': 'inertia'}
    wide = []
    for name, said in names.items():
        value, ends = getattr(friction, name), friction.intervals.get(name)
        if name != 'inertia' and value < 0.0 and max(ends or [value]) < 0.0:
            yield finding('negative_friction', name=said, value=value)
        if ends and np.ptp(ends) > 2.0 * thresholds.UNCERTAIN * abs(value):
            wide.append(said)
        if name == 'coulomb' and ends and ends[0] <= 0.0 and ends[1] > error:
            yield finding('unknown_friction', low=ends[0], high=ends[1])
    if wide:
        yield finding('not_told_apart', names=' and '.join(wide))


def helped_person(samples: Samples, accelerates: bool) -> Finding | None:
    """Return the finding that a compensator helped a person, whose own torque was not recorded.

    It acts on announced directions, and the motor does what it commands and nothing else. (Under
    another controller, which moves the joint, the motor does more.) Where none is announced, it may
    help as well, or something else may command the motor, which then `accelerates` the joint: a
    person who is helped with friction does that alone.
    """
    if samples.load is not None or samples.command is None:
        return None
    both = np.isfinite(samples.command) & np.isfinite(samples.current)
    command, current = samples.command[both], samples.current[both]
    if len(command) < 2 or not np.ptp(command) > 0.0 or not np.ptp(current) > 0.0:
        return None
    if np.corrcoef(command, current)[0, 1] <= thresholds.DOES_AS_COMMANDED:
        return None
    if samples.direction is not None and np.any(samples.direction):
        return finding('helped_person')
    return None if accelerates else finding('may_have_helped')


def fault_of_velocity(raw: Samples) -> str:
    """Return how the recorded velocity contradicts the position, beside a delay; '' if not."""
    return '' if raw.velocity is None else velocity_agreement(
        raw.time, raw.position, raw.velocity, raw.position_step).fault


def findings_on_recording(rows: Rows, raw: Samples) -> Iterator[Finding]:
    """Yield the findings on the recordings themselves."""
    coverage = rows.coverage
    if rows.joints and rows.samples.rigid_body is None:
        yield finding('other_joints', joints=', '.join(
            name for name in rows.joints if name != raw.joint))
    elif raw.arm is not None and rows.samples.rigid_body is None and (resting := [
            name for name in raw.arm.joints if name != raw.joint]):
        yield finding('one_posture', joints=', '.join(resting))
    if moves_as_one(raw):
        yield finding('moves_as_one', joint=raw.joint)
    if fault := fault_of_velocity(raw):
        yield finding('velocity', fault=fault[0].upper() + fault[1:])
    if lost := lost_rows(raw.time, raw.position, raw.position_step):
        yield finding('lost_rows', percent=100.0 * lost)
    coarse = too_coarse(coverage)
    if coarse and (coverage.speed < STANDSTILL
                   or coverage.distinct_positions < thresholds.FEWEST_STEPS):
        yield finding('hardly_moved', steps=coverage.distinct_positions, speed=coverage.speed)
    elif coarse:
        yield finding('coarse', reason=coarse)
    if coverage.passed_again < thresholds.PASSED_AGAIN:
        yield finding('passed_once')
    if not coverage.both_directions:
        yield finding('one_direction')
    if rows.clipped.any():
        limits = raw.current[rows.clipped]
        ends = dict.fromkeys(f'{end:.4g} A' for end in (limits.min(), limits.max()))
        yield finding('ceiling', ends=' and '.join(ends), percent=100 * rows.clipped.mean())


def loads_that_hardly_varied(rows: Rows, error: float) -> Iterator[Finding]:
    """Yield each load, of those that exceed an error, A, which is far from zero against its range.

    What it does to offset and friction cannot be told from these then, nor by which power of it:
    all look like a constant. Locally, the model may be right.
    """
    for load, values in (('The load', rows.samples.load),
                         ("The torque of the arm's links", rows.samples.rigid_body)):
        if values is None:
            continue
        low, high = np.quantile(values[rows.usable], (0.01, 0.99))
        small, large = sorted((abs(low), abs(high)))
        if (low * high > 0.0 and large < thresholds.ONE_LOAD * small
                and small > error * rows.torque_per_current):
            yield finding('one_load', load=load, low=low, high=high)


def notes_on_coverage(samples: Samples, coverage: Coverage) -> Iterator[Finding]:
    """Yield notes on what the recordings cannot show, none of which lowers the verdict."""
    if samples.temperature is None:
        yield finding('no_temperature')
    if samples.load is None:
        yield finding('no_load')
    reasons = {kind.insufficient_data(coverage): None for kind in EFFECTS.values() if all(
        getattr(samples, signal) is not None for signal in kind.needs)}
    for reason in filter(None, reasons):
        yield finding('not_seen', reason=reason)
    if coverage.duration < 60.0 and not EFFECTS['warm_up'].insufficient_data(coverage):
        yield finding('short', duration=coverage.duration)
