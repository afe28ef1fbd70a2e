# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Estimates a model's error on other recordings and how far to trust it.

The growth of errors in thirds of the recording that were not fitted tells what to expect on
another recording; see `elsewhere`. Everything else to report is a finding with a code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import math
from typing import Any

import numpy as np

from friction_comp.model.effects import EFFECTS, Scene
from friction_comp.model.effects.scene import too_coarse
from friction_comp.refinement.attempt import Fit
from friction_comp.refinement.effect_columns import proposals, Table
from friction_comp.refinement.leftover import Dependence, rank_correlation
from friction_comp.refinement.naming import Stability
from friction_comp.refinement.prepare import blocks_of_samples, Rows
from friction_comp.refinement.thresholds import (
    FOLLOWED_VARIANCE,
    GROWTH,
    PUSHING_ERROR,
    SPED_WITH_TIME,
    UNEXPLAINED,
    UNEXPLAINED_CURRENT,
    USELESS_ERROR,
    VELOCITY_RATIO,
    WARMED_WITH_TIME,
    WRITTEN_ERROR,
)
from friction_comp.refinement.verdict import AGAIN, Finding, IN_PART
from friction_comp.samples import Samples
from friction_comp.signal_checks import velocity_fault, velocity_ratios

_EXPERIMENTS = {
    ('temperature', 'time'):
        'record the motor once warm from the start, or cool it while it goes on moving',
    ('acceleration', 'history'):
        'record movements of the same speed with several different accelerations, and reversals',
    ('acceleration', 'position'):
        'record the same positions at several accelerations, such as two different tempos',
    ('position', 'velocity'):
        'record the same positions at several speeds and in both directions',
    ('position', 'time'): 'record the same positions early and late, several times over',
    ('time', 'velocity'): 'record the same speeds early and late, in another order',
    ('temperature', 'velocity'): 'record the same speeds cold and warm',
    ('direction', 'velocity'): 'record the same speeds in both directions'}


def rms(values: np.ndarray) -> float:
    """Return the root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else math.nan


def errors_of(rows: Rows, fit: np.ndarray, held_out: np.ndarray, growth: float = 1.0
              ) -> dict[str, Any]:
    """Return the errors of a model in A, as in report.json.

    `fit` and `held_out`, shape (N,), are the residuals of all samples, of the model fitted to all
    parts and of fits to other parts; `growth` is the ratio of the errors in thirds that were not
    fitted to those of other held-out parts.
    """
    moving = rows.usable
    errors, still = held_out[moving], held_out[~moving]
    block = blocks_of_samples(rows)[moving]
    parts = [rms(errors[block == k]) for k in np.unique(block)]
    variance = float(np.var(rows.target[moving]))
    error, overall = rms(errors), rms(held_out)
    extra = (growth ** 2 - 1.0) * error ** 2 * float(np.mean(moving))
    return {'fit_rmse': rms(fit[moving]), 'held_out_rmse': error,
            'held_out_max': float(np.max(np.abs(errors))),
            'held_out_r2': (1.0 - float(np.mean(errors ** 2)) / variance if variance > 0.0
                            else 0.0),
            'worst_part_rmse': max(parts), 'standstill_rmse': rms(still) if still.size else None,
            'overall_rmse': overall,
            'elsewhere_rmse': max(math.sqrt(overall ** 2 + extra), growth * error),
            'elsewhere_motion_rmse': growth * error, 'part_rmse': parts}


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
    return 1.4826 * float(np.median(np.abs(second))) / math.sqrt(6.0)


def experiment(first: str, second: str) -> str:
    """Return the recording that would distinguish two variables."""
    known = _EXPERIMENTS.get((min(first, second), max(first, second)))
    return known or (f'record motion in which {first} changes while {second} does not, and the '
                     'other way round')


def ambiguities(fit: Fit, stability: Stability) -> list[dict[str, Any]]:
    """Return entries of report.json's `ambiguous`."""
    entries: dict[frozenset[str], dict[str, Any]] = {}

    def add(first: str, second: str, why: str) -> None:
        if first != second:
            entries.setdefault(frozenset((first, second)), {
                'between': [first, second], 'why': why, 'experiment': experiment(first, second)})
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
        if correlation > WARMED_WITH_TIME:
            add('time', 'temperature', 'temperature and time rose together in the recordings '
                f'(rank correlation {correlation:.3f})')
    elif 'time' in variables and samples.temperature is None:
        add('time', 'temperature', 'the drift over time may be the motor warming up, and its '
            'temperature was not recorded')
    correlation = rank_correlation(samples.time, np.abs(np.asarray(samples.velocity)))
    if correlation > SPED_WITH_TIME and len(np.unique(samples.recording)) == 1:
        add('velocity', 'time', 'speed rose or fell with time throughout the recording (rank '
            f'correlation {correlation:.2f}): drift over time cannot be distinguished from '
            'dependence on velocity')
    return list(entries.values())


def friction_would_push(rows: Rows) -> bool:
    """Return whether friction would have to push for a plain drive to explain the current.

    Eq. 6, inertia, weight, spring and load are fitted with the signs that physics requires and
    with any signs. Where the second fit predicts much better, the current is a controller's
    response, something that was not recorded moves the joint, or a signal has the wrong sign.
    """
    table = Table(rows, 2.0 / rows.scene.transition)
    keys = table.add([term for term in proposals(table, []) if term.kind.physics])
    columns = table.indices(keys, derivatives=False)
    free = replace(table.sums, signs=np.zeros_like(table.sums.signs))
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
    reasons = {kind.insufficient_data(scene): None for kind in EFFECTS.values() if all(
        getattr(samples, signal) is not None for signal in kind.needs)}
    notes += [Finding('not_seen', reason) for reason in reasons if reason]
    if scene.duration < 60.0 and not EFFECTS['warm_up'].insufficient_data(scene):
        notes.append(Finding('short', f'The longest recording lasts {scene.duration:.3g} s: '
                             'warm-up takes minutes and cannot be seen in full.'))
    return notes


def findings(fit: Fit, raw: Samples, after: dict[str, Any], growth: dict[str, float],
             dependences: Sequence[Dependence], open_questions: Sequence[dict[str, Any]]
             ) -> list[Finding]:
    """Return all findings on a model.

    `after`, `growth` and `open_questions` are what `errors_of`, `Elsewhere.growth` and
    `ambiguities` return.
    """
    unexplained = [Finding(
        'unexplained', f'The remaining error depends on {entry.variable}: {entry.note}.', IN_PART)
        for entry in dependences if entry.strength > UNEXPLAINED]
    ambiguous = [Finding(
        'ambiguous', f"{' or '.join(question['between'])}: {question['why']}.", IN_PART,
        question['experiment']) for question in open_questions]
    return [*findings_on_errors(fit, after, growth), *unexplained, *ambiguous,
            *findings_on_recording(fit.rows, raw),
            *notes_on_coverage(fit.rows.samples, fit.rows.scene),
            *findings_on_writing(fit, after)]


def findings_on_errors(fit: Fit, after: dict[str, Any], growth: dict[str, float]
                       ) -> list[Finding]:
    """Return the findings that follow from a model's errors; see `findings`."""
    rows, held_out = fit.rows, after['held_out_rmse']
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
    expected = max(largest, 1.0) * held_out
    if expected > USELESS_ERROR * signal:
        notes.append(Finding(
            'explains_nothing', f'Where it was not fitted, the model may be {expected:.2g} A off '
            f'in motion, of {signal:.2g} A: the current depends on something that is not in the '
            'recording.', AGAIN,
            'record what loads the joint (torque sensor, other joints), or move it without load'))
    elif held_out > UNEXPLAINED_CURRENT * signal:
        notes.append(Finding(
            'explains_part', f'{held_out:.2g} A of {signal:.2g} A remain unexplained.',
            IN_PART, 'record what loads the joint (torque sensor, other joints)'))
    if largest > GROWTH:
        notes.append(Finding(
            'extrapolates', f'A third of the {variable} range that was not fitted is predicted '
            f'with {largest:.2g} times the error: the model is only supported where it was fitted.',
            IN_PART, f'record more values of {variable}, in another order'))
    return notes


def findings_on_writing(fit: Fit, after: dict[str, Any]) -> list[Finding]:
    """Return a finding where the model as it is written predicts worse than its fit.

    The fit's error comes from block sums, that of the written model from `predict` on the
    recording.
    """
    rows = fit.rows
    # Rows average noise out.
    fitted_error = math.hypot(rms(fit.table.residual(fit.keys, derivatives=False)),
                              noise_floor(rows, rows.target) if rows.length > 1 else 0.0)
    # Samples outside all rows may have larger errors.
    if after['fit_rmse'] <= WRITTEN_ERROR * max(fitted_error, after['held_out_rmse']):
        return []
    return [Finding('written', f'The model as written predicts with an error of '
                    f'{after["fit_rmse"]:.3g} A, but its fit had {fitted_error:.3g} A.', AGAIN)]


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
            raw.time, raw.position, raw.velocity, scene.resolution), VELOCITY_RATIO)
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
