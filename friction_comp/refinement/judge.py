# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Says how large a model's error is, how far to trust it, and what the recording leaves open.

Choice of terms, error and verdict come from the same regimes of motion, each predicted by a fit to
all others. The verdict is the grade of the worst finding.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
import math
import re

import numpy as np

from friction_comp.facts.motion import STANDSTILL, velocity_agreement
from friction_comp.model.effect import RESISTS, segment_starts, too_coarse
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_numbers import FrictionNumbers
from friction_comp.refinement import thresholds
from friction_comp.refinement.block_sums import BlockSums, rank_correlation, repeats
from friction_comp.refinement.effect_columns import first_model, Table
from friction_comp.refinement.prepare import clipped, Rows
from friction_comp.refinement.result import (
    AGAIN,
    Dependence,
    Errors,
    Finding,
    IN_PART,
    Predicted,
    Question,
    TRUST,
    Verdict,
)
from friction_comp.refinement.search import Fit, is_better
from friction_comp.samples import Samples
from friction_comp.statistics import rms, robust_std

# Every so many samples show whether joints move as one, and the share of the variance of a joint's
# position that then follows from the others.
_EVERY, _FOLLOWED = 10, 0.99
# Positions of the encoder: between fewer, no velocity is known.
_FEWEST_POSITIONS = 10
# Rank correlation of time with speed or acceleration above which a drift may depend on these.
_SWEPT = 0.4
# Correlation of measured and commanded current above which no other controller acts.
_AS_COMMANDED = 0.95
_LOADS = 'record several loads, and none'


def errors_of(rows: Rows, predicted: Predicted, name: str, least: float = 0.0) -> Errors:
    """Return the errors of a model.

    The error to expect elsewhere is that of regimes that were not fitted, and one standard error
    over them, or at `least` another one, A: that where half of the motion was not fitted, say.
    """
    moving, held_out = rows.usable, predicted.held_out
    errors, still = held_out[moving], held_out[~moving]
    block = rows.block_of_sample[moving]
    squares = np.array([np.mean(errors[block == k] ** 2) for k in np.unique(block)])
    variance = float(np.var(rows.target[moving]))
    error, scatter = rms(errors), float(np.std(squares)) / math.sqrt(max(len(squares) - 1, 1))
    elsewhere = max(math.sqrt(error ** 2 + scatter), least)
    extra = (elsewhere ** 2 - error ** 2) * float(np.mean(moving))
    return Errors(
        model=name, fit_rmse=rms(predicted.own[moving]), held_out_rmse=error,
        held_out_max=float(np.max(np.abs(errors))),
        held_out_r2=1.0 - float(np.mean(errors ** 2)) / variance if variance > 0.0 else 0.0,
        worst_part_rmse=math.sqrt(float(squares.max())),
        standstill_rmse=rms(still) if still.size else None,
        elsewhere_rmse=max(math.sqrt(rms(held_out) ** 2 + extra), elsewhere),
        elsewhere_motion_rmse=elsewhere)


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
    open_ = [(term.kind.variable, EFFECTS[name].variable,
              f"'{name}' in the place of '{term.kind.name}' predicts motion that was not fitted as "
              'well')
             for term in fit.terms[fit.initial_count:] for name in fit.rivals.get(term, ())]
    samples = fit.rows.at_rows
    variables = {term.kind.variable for term in fit.terms}
    if 'time' in variables and samples.temperature is None:
        open_.append(('time', 'temperature', 'the drift over time may be the motor warming up, and '
                      'its temperature was not recorded'))
    # Beside an effect of time, a sweep of frequency is enough.
    least = _SWEPT if 'time' in variables else thresholds.INSEPARABLE
    for name in ('temperature', 'velocity', 'acceleration'):
        values = getattr(samples, name)
        if variables & {'time', name} and values is not None and len(np.unique(
                samples.recording)) == 1 and rank_correlation(samples.time, np.abs(values)) > least:
            open_.append((name, 'time', f'{name} rose or fell with time throughout the recording'))
    entries: dict[frozenset[str], Question] = {}
    for first, second, why in open_:
        entries.setdefault(frozenset((first, second)), Question(
            [first, second], why, experiment(first, second)))
    return list(entries.values())


def friction_would_push(fit: Fit) -> bool:
    """Return whether friction would have to push to explain the current.

    It would where Eq. 6, the terms with which a search begins and those of other joints predict
    much better with any signs than with those that physics requires.
    """
    table = Table(fit.rows, 2.0 / fit.rows.coverage.transition)
    terms = table.add([*first_model(table), *(term for term in fit.terms if term.group)])
    sums = table.sums.part(table.indices(terms))
    as_recorded, free = (replace(sums, signs=signs).held_out_errors(range(len(signs))).sum()
                         for signs in (sums.signs, np.zeros_like(sums.signs)))
    return bool(free < 0.5 * as_recorded)


def friction_shows(fit: Fit) -> bool:
    """Return whether friction lowers the error on regimes that were not fitted."""
    table = fit.table
    resisting = {1, 2, *(column for term in fit.terms
                         if (term.group.kind == 'friction' if term.group
                             else term.kind.role == RESISTS)
                         for column in table.columns_of[term])}
    rest = [column for column in table.indices(fit.terms, derivatives=False)
            if column not in resisting]
    return is_better(
        table.sums.errors_by_size(rest), table.errors(fit.terms))


def other_recordings(fit: Fit) -> float:
    """Return the error of each recording by a fit to the others, A; 0 if alone."""
    rows, table = fit.rows, fit.table
    number = np.unique(rows.samples.recording[rows.index], return_inverse=True)[1]
    columns = table.indices(fit.terms, derivatives=False)
    sums = BlockSums.over(np.vstack((table.columns[columns], table.target)), number,
                          table.sums.signs[columns])
    return 0.0 if number.max() == 0 else math.sqrt(
        float(sums.held_out_errors(range(len(columns))).sum()) / len(number))


def findings(fit: Fit, raw: Samples, after: Errors, dependences: Sequence[Dependence],
             questions: Sequence[Question], between: float, left_out: float
             ) -> Iterator[Finding]:
    """Yield all findings on a model but those on its numbers.

    `between` is what `other_recordings` returns, `left_out` the largest RMS error where a part of
    the motion is not fitted, from a sixteenth to a half, A.
    """
    rows, held_out, expected = fit.rows, after.held_out_rmse, after.elsewhere_motion_rmse
    constant = float(np.std(rows.target[rows.usable]))
    yield from _findings_on_signs(fit)
    if not friction_shows(fit):
        yield Finding(
            'not_friction', 'No friction shows in this current: it is the torque behind the gear, '
            "a controller's request, or that of a motor whose joint is moved by hand.", AGAIN,
            'the current of the motor that moves the joint, or its torque before the gear (where '
            'it is in the table, --columns current=NAME,link_torque=NAME); of a joint moved by '
            "hand, the hand's torque as the load")
    yield from _helped_person(raw, any(
        not term.group and term.kind.name == 'inertia' for term in fit.terms))
    if expected > thresholds.UNEXPLAINED * constant:
        yield Finding(
            'explains_little', f'{expected:.2g} A may remain unexplained in motion that was not '
            f'fitted, of {constant:.2g} A beside a constant: the current depends on something that '
            'is not in the recording.',
            AGAIN if expected > thresholds.USELESS_ERROR * constant else IN_PART,
            'record what loads the joint (torque sensor, other joints), or move it without load')
    if between > thresholds.GROWTH * held_out:
        yield Finding(
            'recordings_differ', 'The recordings differ: each is predicted by a fit to the others '
            f'with {between / held_out:.2g} times the error.', IN_PART, 'refine each recording '
            'alone (--each compares them), or record what differs (temperature, load, unit)')
    if left_out > thresholds.GROWTH * after.fit_rmse:
        yield Finding(
            'extrapolates', 'Motion that was not fitted is predicted with '
            f'{left_out / after.fit_rmse:.2g} times the error: the model only holds where it was '
            'fitted.', IN_PART, 'more places, speeds and loads')
    for entry in dependences:
        if entry.strength > thresholds.UNEXPLAINED:
            yield Finding('unexplained', f'The remaining error depends on {entry.variable}: '
                          f'{entry.note}.', IN_PART)
    for question in questions:
        yield Finding('ambiguous', f'{question.variables}: {question.why}.', IN_PART,
                      question.experiment)
    yield from _findings_on_joints(rows, raw)
    yield from _findings_on_signals(raw)
    yield from _findings_on_motion(rows, expected)
    yield from _not_known(rows)


def _findings_on_signs(fit: Fit) -> Iterator[Finding]:
    if friction_would_push(fit):
        yield Finding(
            'wrong_sign', 'Friction would have to push to explain the current: the current is a '
            "controller's response, something that was not recorded moves the joint, or the sign "
            'of effort or position is reversed.', AGAIN,
            'check the signs of effort and position (--unit effort=-1Nm or current=-1A reverses '
            'one), and that effort is measured; follow a trajectory with a softer or a position '
            'controller')
    values = fit.table.coefficients(fit.terms)
    for term in fit.terms:
        if term.group:
            continue
        own = [values[column] for column in fit.table.columns_of[term]]
        if term.kind.is_load and own[0] > 0.0:
            yield Finding(
                'wrong_sign', f'The current grows with the load, {own[0]:.3g} A per N·m: one of '
                'them has the wrong sign. The load is the torque that moves the joint from '
                'outside.', AGAIN,
                'the same with the sign of the load reversed (in a table, --unit load=-1Nm)')
        if doubt := term.kind({**term.constants, 'coefficients': own}).doubt():
            yield Finding('impossible', doubt, IN_PART,
                          'record the same over a wider range, and other joints')


def _helped_person(samples: Samples, accelerates: bool) -> Iterator[Finding]:
    """Yield the finding that a compensator helped a person, whose own torque was not recorded.

    It acts on announced directions, and the motor does what it commands and nothing else. (Under
    another controller, which moves the joint, the motor does more.) Where none is announced, it may
    help as well, or something else may command the motor, which then `accelerates` the joint: a
    person who is helped with friction does that alone.
    """
    if samples.load is not None or samples.command is None:
        return
    both = np.isfinite(samples.command) & np.isfinite(samples.current)
    command, current = samples.command[both], samples.current[both]
    if len(command) < 2 or not np.ptp(command) > 0.0 or not np.ptp(current) > 0.0:
        return
    announced = samples.direction is not None and np.any(samples.direction)
    if np.corrcoef(command, current)[0, 1] > _AS_COMMANDED and (announced or not accelerates):
        yield Finding(
            'not_friction', 'The motor gave just what was commanded: a compensator '
            f'{"helped" if announced else "may have helped"} a person, whose torque was not '
            'recorded, and the current is only a part of friction.',
            AGAIN if announced else IN_PART,
            "the person's torque (interaction_wrench), /diagnostics, or a faster motion without "
            'the compensator')


def _findings_on_joints(rows: Rows, raw: Samples) -> Iterator[Finding]:
    """Yield what other joints have to do with it."""
    arm = raw.arm
    if arm is None or raw.joint not in arm.joints:
        return
    others = ', '.join(name for name in rows.joints if name != raw.joint)
    if rows.joints and rows.samples.rigid_body is None:
        yield Finding(
            'other_joints', f'Other joints moved too ({others}), and no URDF gives the torques of '
            'their links: the model may not hold in other postures.', IN_PART,
            'move this joint alone, or give a URDF of the arm (--urdf)')
    elif rows.samples.rigid_body is None and len(arm.joints) > 1:
        resting = ', '.join(name for name in arm.joints if name != raw.joint)
        yield Finding('other_joints', f'The other joints ({resting}) rested: weight and inertia '
                      'are those of their posture.')
    if len(arm.joints) > 1:
        index, position = arm.joints.index(raw.joint), arm.position[::_EVERY]
        known = np.column_stack((np.ones(len(position)), np.delete(position, index, axis=1)))
        own = position[:, index]
        residual = own - known @ np.linalg.lstsq(known, own, rcond=None)[0]
        if np.var(residual) < (1.0 - _FOLLOWED) * np.var(own):
            yield Finding(
                'other_joints', f'The position of {raw.joint} follows from those of the other '
                'joints: the recording cannot show on which of them the current depends, and other '
                'motion may be predicted much worse.', AGAIN,
                'move the joints independently of each other; of two on one shaft, keep only this '
                'one in the file')


def _findings_on_signals(raw: Samples) -> Iterator[Finding]:
    fault = '' if raw.velocity is None else velocity_agreement(
        raw.time, raw.position, raw.velocity, raw.position_step).fault
    if fault:
        yield Finding('signals', f'{fault[0].upper()}{fault[1:]}.', IN_PART,
                      'let one clock stamp position, velocity and current, and check the units of '
                      'velocity')
    limited = clipped(raw.current)
    if limited.any():
        limits = raw.current[limited]
        ends = dict.fromkeys(f'{end:.4g} A' for end in (limits.min(), limits.max()))
        yield Finding(
            'signals', f'The current ends at a limit, {" and ".join(ends)}, in '
            f'{100 * limited.mean():.1f} % of the samples, which are left out.', IN_PART,
            'raise the limit of current or sensor, or use less acceleration and speed')


def _findings_on_motion(rows: Rows, error: float) -> Iterator[Finding]:
    """Yield what the motion and the loads, against an error in A, varied too little for."""
    coverage, motion = rows.coverage, rows.samples.take(rows.usable)
    coarse = too_coarse(coverage)
    if coarse and (coverage.speed < STANDSTILL
                   or coverage.distinct_positions < _FEWEST_POSITIONS):
        yield Finding(
            'little_motion', f'The joint hardly moved: over {coverage.distinct_positions:.0f} '
            f'steps of its encoder, at {coverage.speed:.2g} rad/s at most. It may only have given '
            'way, and what is called friction may be elastic.', AGAIN,
            'move further and faster, until the joint slides')
    elif coarse:
        yield Finding('little_motion', 'Position is coarse: '
                      f'{coverage.distinct_positions:.0f} distinct values. Lag, presliding and '
                      'other effects within a few steps of it cannot be seen, and acceleration is '
                      'uncertain.', IN_PART,
                      'record the motor-side encoder, or move over a wider range')
    if coverage.passed_again < thresholds.PASSED_AGAIN:
        yield Finding(
            'little_motion', 'The joint passed most places once: what depends on position, speed, '
            'direction or time cannot be told apart, and other motion may be predicted much '
            'worse.', AGAIN,
            'move to and fro over the same places several times, at several speeds')
    elif (share := repeats(motion.position, np.asarray(motion.velocity))) > thresholds.ONE_MOTION:
        yield Finding(
            'little_motion', 'The recording repeats one motion: where the joint is and which way '
            f'it moves tells {100.0 * share:.0f} % of its speed. Whether another motion is '
            'predicted as well, it does not tell.', IN_PART,
            'the same places at several speeds')
    if not coverage.both_directions:
        yield Finding(
            'little_motion', 'Motion was in one direction only: Coulomb friction cannot be '
            'distinguished from an offset.', IN_PART, 'move in both directions')
    for load, values in (('The load', motion.load),
                         ("The torque of the arm's links", motion.rigid_body)):
        if values is None:
            continue
        # What it does to offset and friction looks like a constant then, by whichever power of it.
        low, high = np.quantile(values, (0.01, 0.99))
        small, large = sorted((abs(low), abs(high)))
        if low * high > 0.0 and large < 1.5 * small and small > error * rows.torque_per_current:
            yield Finding(
                'little_motion', f'{load} hardly varied, {low:.3g} to {high:.3g} N·m: friction and '
                'offset that depend on it cannot be told from those that do not, and hold at such '
                'loads only.', IN_PART, _LOADS)


def _not_known(rows: Rows) -> Iterator[Finding]:
    """Yield what the recording cannot show, which does not lower the verdict."""
    samples = rows.samples
    if samples.temperature is None:
        yield Finding('not_known', 'Motor temperature was not recorded.')
    if samples.load is None:
        yield Finding('not_known', 'No load was recorded: what a hand gives to the motion is '
                      'missing from friction.')
    unseen = [name.replace('_', ' ') for name, kind in EFFECTS.items()
              if not kind.can_show(rows.coverage) and all(
                  getattr(samples, signal) is not None for signal in kind.needs)]
    if unseen:
        yield Finding('not_known', f'This motion cannot show: {", ".join(unseen)}.')


def findings_on_numbers(friction: FrictionNumbers, error: float = math.inf) -> Iterator[Finding]:
    """Yield numbers that no drive has, and that are not known.

    Of these, the interval holds zero, and more than the held-out `error` of the current by which it
    was chosen.
    """
    for name in ('coulomb', 'viscous'):
        value, ends = getattr(friction, name), friction.intervals.get(name)
        said = f'{name.capitalize() if name == "coulomb" else name} friction'
        if value < 0.0 and max(ends or [value]) < 0.0:
            yield Finding(
                'impossible', f'The straight line through friction has {said} below zero, '
                f'{value:.3g}, which no drive has: neither its Coulomb nor its viscous friction is '
                'that of the drive.', IN_PART,
                'record more constant speeds, with a finer encoder or a stiffer controller')
        if name == 'coulomb' and ends and ends[0] <= 0.0 and ends[1] > error:
            yield Finding(
                'impossible', f'Coulomb friction may be {ends[0]:.3g} to {ends[1]:.3g} A: the '
                'model predicts, but what of it is friction is not known.', IN_PART,
                'record slow and fast motion in both directions')


CODES = {
    'wrong_sign': 'a sign is reversed', 'not_friction': 'the current is not that of friction',
    'explains_little': 'much is not in the recording',
    'extrapolates': 'other motion is predicted worse',
    'recordings_differ': 'recordings contradict each other',
    'unexplained': 'the error depends on a variable', 'ambiguous': 'two effects explain it',
    'other_joints': 'other joints moved, or stood',
    'little_motion': 'motion or load hardly varied', 'signals': 'signals contradict, or are cut',
    'impossible': 'a number that no drive has', 'not_known': 'what does not show'}
"""Codes of all findings, each with what it says."""

# How each variable is made to change.
_VARIED = {
    'acceleration': 'several tempos', 'direction': 'both directions', 'history': 'reversals, and '
    'constant speeds that last', 'load': 'several loads, and none', 'position': 'a wider range of '
    'positions', 'temperature': 'a cold and a warm motor', 'time': 'the same early and late',
    'velocity': 'several constant speeds, slow ones among them'}


def experiment(first: str, second: str) -> str:
    """Return the recording that would distinguish two variables."""
    varied = [_VARIED.get(name, f'a wider range of {name}') for name in dict.fromkeys(
        (first, second))]
    return f'record {", and ".join(varied)}' + ', each by itself' * (len(varied) > 1)


def verdict_of(findings: Iterable[Finding], unit: str = 'A') -> Verdict:
    """Return what follows from findings on a model in a unit."""
    found = [replace(finding, text=in_unit(finding.text, unit)) for finding in findings]
    bad = sorted((finding for finding in found if finding.grade != TRUST),
                 key=lambda finding: (AGAIN, IN_PART).index(finding.grade))
    reasons = [finding.text for finding in bad] or [
        'The model predicts motion of the recording that was not fitted about as well as that '
        'which was, and no variable explains a large part of the remaining error.']
    return Verdict(
        bad[0].grade if bad else TRUST, reasons,
        list(dict.fromkeys(finding.record for finding in bad if finding.record)),
        [finding.text for finding in found if finding.grade == TRUST], found)


def in_unit(text: str, unit: str) -> str:
    """Return a sentence about currents in A with the unit of the recording in its place."""
    return text if unit == 'A' else re.sub(r'(?<=\d) A\b', f' {unit}', text)


# Errors beyond so many standard deviations are clipped.
_OUTLYING = 8.0
# Ranges of each variable.
_RANGES = {'velocity': 20, 'position': 16, 'acceleration': 12, 'time': 12, 'history': 12,
           'load': 12, 'temperature': 10}
_FEWEST_BLOCKS, _MOST_BLOCKS = 20, 400


def remaining_dependences(samples: Samples, residual: np.ndarray, slowest: float
                          ) -> list[Dependence]:
    """Return the variables that a residual, shape (N,), still depends on, the strongest first.

    Each dependence is subtracted before the next is searched for, so that a variable is reported
    only if it explains a part that others do not. The samples are in motion and in order of time;
    `slowest` is the speed of standstill, rad/s.
    """
    limit = _OUTLYING * float(robust_std(residual)) + 1e-300
    values = np.clip(residual, -limit, limit)
    values = values - values.mean()
    power, found = float(values @ values), []
    cells = _cells(samples, slowest) if power > 0.0 else {}
    while cells:
        block = _blocks(values)
        errors = {name: np.bincount(block, (values - _of_other_blocks(values, cell, block)) ** 2)
                  for name, cell in cells.items()}
        name, left = min(errors.items(), key=lambda entry: float(entry[1].sum()))
        if not is_better(np.bincount(block, values ** 2), left, thresholds.LEAST_STRENGTH):
            break
        gain = float(values @ values - left.sum())
        found.append(Dependence(
            name, gain / power, f'{math.sqrt(gain / len(values)):.2g} A RMS of it, in a way that '
            'no effect of the package describes'))
        cell = cells.pop(name)
        values = values - (np.bincount(cell, values) / np.maximum(np.bincount(cell), 1))[cell]
    return sorted(found, key=lambda item: -item.strength)


def _of_other_blocks(values: np.ndarray, cells: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Return the mean of each value's cell in all other blocks, shape (N,)."""
    count, parts = int(cells.max()) + 1, int(block.max()) + 1
    total, number = (np.bincount(block * count + cells, weights, count * parts).reshape(
        parts, count) for weights in (values, np.ones_like(values)))
    mean = (total.sum(axis=0) - total) / np.maximum(number.sum(axis=0) - number, 1.0)
    return np.asarray(mean[block, cells])


def _cells(samples: Samples, slowest: float) -> dict[str, np.ndarray]:
    """Return by variable the cell of each sample; directions have their own, or signs cancel."""
    velocity = np.asarray(samples.velocity)
    cells: dict[str, np.ndarray] = {}
    side = (velocity > 0).astype(int)
    moving = np.where(np.abs(velocity) > slowest, np.sign(velocity), 0.0)
    start = segment_starts(samples) | (np.diff(moving, prepend=moving[:1]) != 0)
    first = np.maximum.accumulate(np.where(start, np.arange(len(samples)), 0))
    for name, count in _RANGES.items():
        # Distance since the motion last changed direction or stood still.
        values = np.abs(samples.position - samples.position[first]) if name == 'history' else (
            getattr(samples, name))
        if values is None:
            continue
        tails = (0.003, 0.01, 0.03) if name in ('velocity', 'acceleration') else ()
        cell = _ranges(values, count, tails)
        if name == 'position':
            # A ripple's phase changes with the speed.
            cell = 3 * cell + _ranges(np.abs(velocity), 3)
        cells[name] = cell if tails else 2 * cell + side
    return cells


def _blocks(values: np.ndarray) -> np.ndarray:
    """Return the block of each value, shape (N,): blocks are longer than the correlation."""
    size = len(values)
    padded = 1 << (2 * size - 1).bit_length()
    correlation = np.fft.irfft(np.abs(np.fft.rfft(values, padded)) ** 2)[:max(2, size // 10)]
    memory = int(np.argmax(correlation < 0.2 * correlation[0])) or size // 10
    length = max(2, min(max(2 * memory, size // _MOST_BLOCKS), size // _FEWEST_BLOCKS))
    return np.arange(size) // length


def _ranges(values: np.ndarray, count: int, tails: tuple[float, ...] = ()) -> np.ndarray:
    """Return the range of each value, of `count` with equal numbers, and of the `tails`."""
    ends = np.array(tails)
    shares = np.concatenate((ends, np.linspace(0, 1, count + 1)[1:-1], 1.0 - ends))
    return np.searchsorted(np.unique(np.quantile(values, shares)), values, side='right')
