# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Estimates a model's error on other recordings and how far to trust it.

The growth of errors in thirds of the recording that were not fitted tells what to expect on
another recording; see `elsewhere`. Everything else to report is a finding with a code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from friction_comp.model.effects import EFFECTS, Scene
from friction_comp.model.effects.scene import too_coarse
from friction_comp.refinement.attempt import Fit
from friction_comp.refinement.effect_columns import proposals, Table
from friction_comp.refinement.leftover import Dependence, rank_correlation
from friction_comp.refinement.prepare import blocks_of_samples, Rows
from friction_comp.refinement.stability import Stability
from friction_comp.refinement.sums import BlockSums
from friction_comp.refinement.thresholds import (
    FOLLOWED_VARIANCE,
    GROWTH,
    PUSHING_ERROR,
    UNEXPLAINED,
    UNEXPLAINED_CURRENT,
    USELESS_ERROR,
)
from friction_comp.refinement.verdict import AGAIN, Finding, IN_PART
from friction_comp.samples import Samples
from friction_comp.signal_checks import velocity_fault, velocity_ratios
from friction_comp.statistics import robust_std

# Rank correlation from which a recording cannot distinguish two explanations.
INDISTINGUISHABLE = 0.95
# Largest ratio between velocity and the derivative of position.
LARGEST_VELOCITY_RATIO = 1.2

_EXPERIMENTS = {
    frozenset(('time', 'temperature')):
        'record the motor once warm from the start, or cool it while it goes on moving',
    frozenset(('acceleration', 'history')):
        'record movements of the same speed with several different accelerations, and reversals',
    frozenset(('position', 'acceleration')):
        'record the same positions at several accelerations, such as two different tempos',
    frozenset(('position', 'velocity')):
        'record the same positions at several speeds and in both directions',
    frozenset(('position', 'time')):
        'record the same positions early and late, several times over',
    frozenset(('velocity', 'time')):
        'record the same speeds early and late, in another order',
    frozenset(('velocity', 'temperature')):
        'record the same speeds cold and warm',
    frozenset(('velocity', 'direction')):
        'record the same speeds in both directions',
}


@dataclass(frozen=True)
class Errors:
    """Errors of one model, A.

    Parameters
    ----------
    fit : float
        RMS in motion, of the model fitted to all parts.
    held_out : float
        RMS in motion, of parts that were not fitted.
    largest : float
        Largest error of a sample of these parts.
    r2 : float
        Share of the current's variance that is explained in these parts.
    worst_part : float
        RMS of the part with the largest RMS.
    standstill : float
        RMS at and near standstill; NaN without such samples.
    overall : float
        RMS of all samples of parts that were not fitted.
    elsewhere, elsewhere_motion : float
        RMS to expect on another recording, of all samples and in motion; see `Elsewhere`.
    parts : list of float
        RMS of each part, in motion.
    """

    fit: float
    held_out: float
    largest: float
    r2: float
    worst_part: float
    standstill: float
    overall: float
    elsewhere: float
    elsewhere_motion: float
    parts: list[float]

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of report.json."""
        return {'fit_rmse': self.fit, 'held_out_rmse': self.held_out,
                'held_out_max': self.largest, 'held_out_r2': self.r2,
                'worst_part_rmse': self.worst_part,
                'standstill_rmse': None if math.isnan(self.standstill) else self.standstill,
                'overall_rmse': self.overall, 'elsewhere_rmse': self.elsewhere,
                'elsewhere_motion_rmse': self.elsewhere_motion,
                'part_rmse': self.parts}


def rms(values: np.ndarray) -> float:
    """Return the root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else math.nan


def errors_of(rows: Rows, fit: np.ndarray, held_out: np.ndarray, growth: float = 1.0) -> Errors:
    """Return the errors of a model.

    Parameters
    ----------
    rows : Rows
    fit, held_out : ndarray, shape (N,)
        Residuals of all samples, of the model fitted to all parts and of fits to other parts.
    growth : float
        Ratio of the errors in thirds that were not fitted to those of other held-out parts.
    """
    moving = rows.usable
    current = rows.target[moving]
    block = blocks_of_samples(rows)[moving]
    errors = held_out[moving]
    parts = [rms(errors[block == k]) for k in np.unique(block)]
    variance = float(np.var(current))
    extra = (growth ** 2 - 1.0) * rms(errors) ** 2 * float(np.mean(moving))
    return Errors(
        rms(fit[moving]), rms(errors), float(np.max(np.abs(errors))),
        1.0 - float(np.mean(errors ** 2)) / variance if variance > 0.0 else 0.0,
        max(parts), rms(held_out[~moving]), rms(held_out),
        max(math.sqrt(rms(held_out) ** 2 + extra), growth * rms(errors)), growth * rms(errors),
        parts)


def noise_floor(rows: Rows, residual: np.ndarray) -> float:
    """Return the standard deviation of white noise in the residual, A.

    Second differences of the residual, shape (N,), remove whatever is smooth over three samples;
    those of white noise have six times its variance. Slow noise is not included, and a filtered
    signal shows less noise than its sensor has.
    """
    consecutive = rows.usable[2:] & rows.usable[1:-1] & rows.usable[:-2]
    step = np.diff(rows.samples.recording)
    consecutive &= (step[1:] == 0) & (step[:-1] == 0)
    second = (residual[2:] - 2.0 * residual[1:-1] + residual[:-2])[consecutive]
    if second.size < 50:
        return rms(residual[rows.usable])
    return float(robust_std(second)) / math.sqrt(6.0)


def experiment(first: str, second: str) -> str:
    """Return the recording that would distinguish two variables."""
    known = _EXPERIMENTS.get(frozenset((first, second)))
    return known or (f'record motion in which {first} changes while {second} does not, and the '
                     'other way round')


def ambiguities(fit: Fit, stability: Stability) -> list[dict[str, Any]]:
    """Return entries of report.json's `ambiguous`."""
    entries: list[dict[str, Any]] = []
    pairs = set()

    def add(first: str, second: str, why: str) -> None:
        pair = frozenset((first, second))
        if first != second and pair not in pairs:
            pairs.add(pair)
            entries.append({'between': [first, second], 'why': why,
                            'experiment': experiment(first, second)})
    terms = fit.table.terms
    for key in fit.keys[fit.given:]:
        for name, share in stability.alternatives.get(key, ()):
            add(terms[key].kind.variable, EFFECTS[name].variable,
                f'{100 * share:.0f} % of the searches repeated on parts of the recording choose '
                f"'{name}' instead of '{key[0]}'")
    samples = fit.rows.at_rows
    variables = {terms[key].kind.variable for key in fit.keys}
    if samples.temperature is not None and variables & {'time', 'temperature'}:
        correlation = rank_correlation(samples.time, samples.temperature)
        if correlation > INDISTINGUISHABLE:
            add('time', 'temperature', 'temperature and time rose together in the recordings '
                f'(rank correlation {correlation:.3f})')
    elif 'time' in variables and samples.temperature is None:
        add('time', 'temperature', 'the drift over time may be the motor warming up, and its '
            'temperature was not recorded')
    correlation = rank_correlation(samples.time, np.abs(np.asarray(samples.velocity)))
    if correlation > 0.9 and len(np.unique(samples.recording)) == 1:
        add('velocity', 'time', 'speed rose or fell with time throughout the recording (rank '
            f'correlation {correlation:.2f}): drift over time cannot be distinguished from '
            'dependence on velocity')
    return entries


def friction_would_push(rows: Rows) -> bool:
    """Return whether friction would have to push for a plain drive to explain the current.

    Eq. 6, inertia, weight, spring and load are fitted with the signs that physics requires and
    with any signs. Where the second fit predicts much better, the current is a controller's
    response, something that was not recorded moves the joint, or a signal has the wrong sign.
    """
    table = Table(rows, 2.0 / rows.scene.transition)
    keys = table.add([term for term in proposals(table, []) if term.kind.physics])
    columns = table.indices(keys, derivatives=False)
    free = BlockSums(table.sums.gram, table.sums.rows, np.zeros_like(table.sums.signs))
    bounded, unbounded = (float(sums.left_out(columns, table.block).sum())
                          for sums in (table.sums, free))
    return unbounded < PUSHING_ERROR * bounded


def notes_on_coverage(samples: Samples, scene: Scene) -> list[Finding]:
    """Return notes on what the recordings cannot show, none of which lowers the verdict."""
    notes: list[Finding] = []
    if samples.temperature is None:
        notes.append(Finding('no_temperature', 'Motor temperature was not recorded: its effect '
                             'can only show as drift over time.'))
    if samples.load is None:
        notes.append(Finding('no_load', 'No load was recorded: effects of load, and an error of '
                             'the torque constant, cannot be seen.'))
    for kind in EFFECTS.values():
        reason = kind.insufficient_data(scene)
        note = Finding('not_seen', reason)
        if reason and note not in notes and all(
                getattr(samples, signal) is not None for signal in kind.needs):
            notes.append(note)
    if scene.duration < 60.0 and not any('warm-up' in one.text for one in notes):
        notes.append(Finding('short', f'The longest recording lasts {scene.duration:.3g} s: '
                             'warm-up takes minutes and cannot be seen in full.'))
    return notes


def findings(fit: Fit, raw: Samples, after: Errors, growth: dict[str, float],
             dependences: Sequence[Dependence], open_questions: Sequence[dict[str, Any]]
             ) -> list[Finding]:
    """Return all findings on a model.

    Parameters
    ----------
    fit : Fit
    raw : Samples
        As recorded.
    after : Errors
    growth : dict of str to float
        As returned by `Elsewhere.growth`.
    dependences : sequence of Dependence
    open_questions : sequence of dict
        As returned by `ambiguities`.
    """
    return [*findings_on_errors(fit.rows, after, growth), *(Finding(
        'unexplained', f'The remaining error depends on {entry.variable}: {entry.note}.', IN_PART)
        for entry in dependences if entry.strength > UNEXPLAINED), *(Finding(
            'ambiguous', f"{' or '.join(question['between'])}: {question['why']}.", IN_PART,
            question['experiment']) for question in open_questions),
        *findings_on_recording(fit.rows, raw), *notes_on_coverage(fit.rows.samples, fit.rows.scene)]


def findings_on_errors(rows: Rows, after: Errors, growth: dict[str, float]) -> list[Finding]:
    """Return the findings that follow from a model's errors; see `findings`."""
    signal = rms(rows.target[rows.usable])
    notes: list[Finding] = []
    if friction_would_push(rows):
        notes.append(Finding(
            'pushes', 'Friction would have to push to explain the current: the current is a '
            "controller's response, something that was not recorded moves the joint, or the sign "
            'of effort or position is reversed.', AGAIN,
            'check the signs of effort and position, and that effort is measured; follow a '
            'trajectory with a softer or a position controller'))
    variable, largest = max(growth.items(), key=lambda entry: entry[1])
    if max(largest, 1.0) * after.held_out > USELESS_ERROR * signal:
        notes.append(Finding(
            'explains_nothing', f'Where it was not fitted, the model may be '
            f'{max(largest, 1.0) * after.held_out:.2g} A off in motion, of {signal:.2g} A: the '
            'current depends on something that is not in the recording.', AGAIN,
            'record what loads the joint (torque sensor, other joints), or move it without load'))
    elif after.held_out > UNEXPLAINED_CURRENT * signal:
        notes.append(Finding(
            'explains_part', f'{after.held_out:.2g} A of {signal:.2g} A remain unexplained.',
            IN_PART, 'record what loads the joint (torque sensor, other joints)'))
    if largest > GROWTH:
        notes.append(Finding(
            'extrapolates', f'A third of the {variable} range that was not fitted is predicted '
            f'with {largest:.2g} times the error: the model is only supported where it was fitted.',
            IN_PART, f'record more values of {variable}, in another order'))
    return notes


def moves_as_one(rows: Rows) -> bool:
    """Return whether a joint's position is a linear function of those of the others."""
    if rows.motion is None:
        return False
    position = rows.motion[0][rows.start]
    index = list(rows.joints).index(rows.samples.joint)
    others = np.column_stack((np.ones(len(position)), np.delete(position, index, axis=1)))
    own = position[:, index]
    residual = own - others @ np.linalg.lstsq(others, own, rcond=None)[0]
    return bool(np.var(residual) < (1.0 - FOLLOWED_VARIANCE) * np.var(own))


def findings_on_recording(rows: Rows, raw: Samples) -> list[Finding]:
    """Return the findings on the recordings themselves."""
    scene = rows.scene
    notes: list[Finding] = []
    if rows.joints:
        others = ', '.join(name for name in rows.joints if name != raw.joint)
        notes.append(Finding(
            'other_joints', f'Other joints moved too ({others}), and no URDF gives the torques of '
            'their links: the model may not hold in other postures.', IN_PART,
            'move this joint alone, or give a URDF of the arm (--urdf)'))
        if moves_as_one(rows):
            notes.append(Finding(
                'moves_as_one', f'The position of {raw.joint} follows from those of the other '
                'joints: the recording cannot show on which of them the current depends, and other '
                'motion may be predicted much worse.', AGAIN,
                'move the joints independently of each other'))
    fault = ''
    if raw.velocity is not None:
        fault = velocity_fault(velocity_ratios(
            raw.time, raw.position, raw.velocity, scene.resolution), LARGEST_VELOCITY_RATIO)
    if fault:
        notes.append(Finding('velocity', fault[0].upper() + fault[1:] + '.', IN_PART,
                             'let one clock stamp position, velocity and current, and check the '
                             'units of velocity'))
    coarse = too_coarse(scene)
    if coarse:
        notes.append(Finding('coarse', coarse, IN_PART,
                             'record the motor-side encoder, or move over a wider range'))
    if not scene.both_directions:
        notes.append(Finding('one_direction', 'Motion was in one direction only: Coulomb friction '
                             'cannot be distinguished from an offset.', IN_PART,
                             'move in both directions'))
    if rows.clipped.any():
        ends = dict.fromkeys(f'{end:.4g} A' for end in (
            raw.current[rows.clipped].min(), raw.current[rows.clipped].max()))
        notes.append(Finding(
            'ceiling', f'The current ends at a limit, {" and ".join(ends)}, in '
            f'{100 * rows.clipped.mean():.1f} % of the samples, which are left out.', IN_PART,
            'raise the limit of current or sensor, or use less acceleration and speed'))
    return notes
