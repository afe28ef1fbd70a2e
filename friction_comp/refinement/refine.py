# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Refines a model: adds the effects that recordings show, and reports on them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.model.arm import Arm, Coupling
from friction_comp.model.differentiation import DEFAULT_SETTINGS
from friction_comp.model.effect import Effect, RESISTS, with_range
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.friction_numbers import friction_of, FrictionNumbers, line_of
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.parallel import one_thread
from friction_comp.refinement import judge
from friction_comp.refinement.effect_columns import EQ6_LINEAR, Term
from friction_comp.refinement.intervals import Intervals, intervals, recorded_of
from friction_comp.refinement.judge import in_unit, remaining_dependences, verdict_of
from friction_comp.refinement.prepare import join, Problem, settings_for_arm
from friction_comp.refinement.result import (
    Finding,
    FoundEffect,
    Origin,
    Predicted,
    RefinementReport,
    RefineResult,
    TRUST,
)
from friction_comp.refinement.reversals import friction_at_rest
from friction_comp.refinement.search import find_best_fit, Fit, fit_eq6_alone, rivals_of
from friction_comp.samples import Samples
from friction_comp.statistics import rms


@one_thread
def refine(recorded: Samples | Sequence[Samples], model: FrictionModel | None = None,
           drive: Drive | None = None, progress: Callable[[float, str], None] | None = None,
           unit: str = '', origin: Origin | None = None) -> RefineResult:
    """Find the effects that a model lacks.

    Parameters
    ----------
    recorded : Samples or sequence of Samples
        One recording, or several in any order.
    model : FrictionModel, optional
        The initial model; the note's sigmoid fitted to the recordings when omitted.
    drive : Drive, optional
        The model's when omitted.
    progress : callable, optional
        Called with the share of the work done and the name of the step.
    unit : str, optional
        Of `Samples.current`, for the text of the report. The default is A if a drive or a model
        gives the torque constant, otherwise N·m, the unit of effort.
    origin : Origin, optional
        What else is known of the recordings beside their samples.

    Returns
    -------
    RefineResult

    Raises
    ------
    InputError
        If the recordings cannot be used.
    """
    report_progress = progress or (lambda share, word: None)
    origin, limits = origin or Origin(), model.position_limits if model else None
    if model and not model.friction_known:
        # The file of a drive that nothing has measured yet.
        drive, model = drive or model.drive, None
    declared = origin.declared
    if declared is None:
        declared = drive is not None or model is not None
    drive = drive or (model.drive if model else Drive(1.0, 1.0))
    origin = replace(origin, unit=unit or origin.unit or ('A' if declared else 'N·m'))
    problem = Problem(join(recorded), drive, declared, model,
                      linear=origin.unit == 'N' or 'position_unit' in origin.notes)
    report_progress(0.0, 'searching')
    fit = find_best_fit(problem)
    report_progress(0.6, 'intervals and rivals')
    fit = replace(fit, rivals=rivals_of(fit))
    bounds = intervals(fit)
    report_progress(0.9, 'writing')
    raw, rows = problem.raw, fit.rows
    new, unknown = model_of(fit, problem, bounds), ''
    # Ramps of identification show it better.
    if not (new.presliding and new.breakaway):
        rest = friction_at_rest(
            raw, new, max(drive.position_resolution or 0.0, rows.coverage.resolution))
        unknown = '' if new.presliding else rest.why
        new = replace(new, presliding=new.presliding or rest.presliding,
                      breakaway=new.breakaway or rest.breakaway)
    if model:
        residual = model.measured(raw) - model.predict(raw, same_recording=True)
        start = Predicted(replace(model, drive=drive), residual, residual)
    else:
        plain = fit_eq6_alone(fit)
        first = model_of(plain, problem, intervals(plain))
        start = Predicted(first, rows.samples.current - first.current(rows.samples),
                          plain.residual())
    refined = Predicted(new, raw.current - new.predict(raw, same_recording=True), fit.residual(),
                        unknown)
    # A model that is no better on parts that were not fitted is not used.
    if rms(refined.held_out[rows.usable]) >= rms(start.held_out[rows.usable]):
        refined = start
    report = report_of(problem, fit, bounds, start, refined, origin)
    # A given model that is kept keeps what its file says of the recordings it was fitted to.
    known = None if refined.model is model else refined.model.recorded
    written = replace(refined.model, position_limits=limits, recorded=known and replace(
        known, error=report.after.elsewhere_motion_rmse, sample_time=_longest_step(raw)), notes={
        **refined.model.notes, **origin.notes, 'unit': origin.unit, 'verdict': report.verdict,
        'reasons': [] if report.verdict == TRUST else report.reasons, 'assumed': report.assumed})
    return RefineResult(
        report=report, model=written, start=start.model, samples=rows.samples, usable=rows.usable,
        before=start.held_out, after=refined.held_out, coverage=rows.coverage)


def _longest_step(raw: Samples) -> float:
    """Return the longest of the recordings' sample times, s."""
    return max(round(raw.take(raw.recording == number).sample_time, 6)
               for number in np.unique(raw.recording))


def model_of(fit: Fit, problem: Problem, bounds: Intervals) -> FrictionModel:
    """Return the model of a fit with the intervals of its numbers.

    The parts that refinement does not fit are the initial model's. Breakaway friction changes as
    sliding friction does at the lowest speed of the recordings.
    """
    table, rows, settings = fit.table, fit.rows, fit.settings
    coefficients = table.coefficients(fit.terms)
    offset, coulomb, viscous = (coefficients[column] for column in range(EQ6_LINEAR))
    sigmoid = Sigmoid(offset + coulomb, offset - coulomb, *table.transition, viscous)
    moving = rows.samples.take(rows.usable)
    effects: list[Effect] = []
    groups, gains, coupling = [], [], np.zeros(len(rows.samples))
    for term in fit.terms:
        values = tuple(coefficients[column] for column in table.columns_of[term])
        if term.group is None:
            effects.append(with_range(
                term.kind({**term.constants, 'coefficients': list(values)}), moving))
        else:
            groups.append(term.group)
            gains.append(values)
            coupling += term.columns(rows) @ np.array(values)
    arm = None
    if groups:
        effects.append(with_range(EFFECTS['other_joints']({'coefficients': [1.0]}),
                                  moving.with_(coupling=coupling[rows.usable])))
        # The model applies the lag to these torques, as to all others.
        arm = Arm(Coupling(tuple(groups), tuple(gains)),
                  settings_for_arm(rows.samples, {**settings, 'lag': 0.0}))
    if rows.load_coefficient:
        effects.append(EFFECTS['load_torque']({'coefficients': [rows.load_coefficient]}))
    initial = problem.model
    fitted: dict[str, Any] = {
        'sigmoid': sigmoid, 'effects': effects, 'differentiation': dict(settings),
        'joint': problem.raw.joint or (initial.joint if initial else '')}
    model = (replace(initial, drive=problem.drive, arm=arm or initial.arm, **fitted) if initial
             else FrictionModel(problem.drive, arm=arm, **fitted))
    model = replace(model, recorded=recorded_of(fit, bounds, model))
    if initial and initial.breakaway and model.recorded and model.recorded.speeds:
        return replace(model, breakaway=initial.breakaway.times(
            _change_of_friction(initial, model, model.recorded.speeds)))
    return model


def _change_of_friction(initial: FrictionModel, model: FrictionModel, speeds: Sequence[float]
                        ) -> float:
    """Return friction of a sliding joint over that of the initial model, at the lowest speed.

    A hysteresis may be friction that the initial model knows as Coulomb friction, or more of it:
    the change is that which is nearer to none. What depends on a temperature, say, is not compared.
    """
    if any(effect.role == RESISTS and (
            effect.needs or effect.variable == 'load' or not effect.holds_on_another_day)
           for effect in (*initial.effects, *model.effects)):
        return 1.0
    changes = [1.0]
    for skipped in ((), ('hysteresis',)):
        lines = [line_of(replace(one, recorded=model.recorded, effects=[
            effect for effect in one.effects if effect.name not in skipped]))
            for one in (initial, model)]
        before, now = (line['coulomb'] + line['viscous'] * min(speeds) for line in lines)
        changes.append(now / before if before > 0.0 < now else 1.0)
    return sorted(changes)[1]


def report_of(problem: Problem, fit: Fit, bounds: Intervals, start: Predicted, refined: Predicted,
              origin: Origin) -> RefinementReport:
    """Return the report on a model.

    `refined` is `start`, the initial model, if no refined one predicts better; the findings are
    then those of the best fit.
    """
    rows, raw, given = fit.rows, problem.raw, problem.model is not None
    model, unit, kept = refined.model, origin.unit, refined is start
    # In order of time.
    order = np.argsort(rows.index)
    dependences = remaining_dependences(
        rows.at_rows.take(order), refined.held_out[rows.index][order], rows.coverage.slowest)
    between = judge.other_recordings(fit)
    friction = friction_of(replace(model, notes={**model.notes, 'unit': unit}))
    effects = [] if kept else effects_of(fit, bounds, friction, unit)
    questions = [] if kept else judge.ambiguities(fit)
    base = 'the given model' if given else 'sigmoid of Eq. 6 fitted to the recording'
    if rows.load_coefficient and not given:
        base += ', the measured load taken as it is'
    name = ' + '.join(['the given model' if given else 'sigmoid of Eq. 6',
                       *(effect.name for effect in effects)])
    sizes = fit.rmse(fit.terms)
    # Elsewhere, what holds in one recording alone is missing, such as drift over time.
    elsewhere = 0.0 if all(effect.holds_on_another_day for effect in model.effects) else rms(
        (model.measured(raw) - model.predict(raw))[rows.usable])
    errors = judge.errors_of(rows, refined, name, max(
        between, elsewhere, 0.0 if kept else float(sizes.max())))
    notes = _notes(problem, refined)
    verdict = verdict_of([
        *judge.findings_on_numbers(friction, errors.held_out_rmse),
        *judge.findings(
            fit, raw, errors, dependences, questions, between, float(sizes.max())), *notes], unit)
    return RefinementReport(
        unit=unit, joint=model.joint, samples=len(raw), samples_in_motion=int(rows.usable.sum()),
        samples_clipped=int(problem.clipped.sum()),
        held_out=f'{rows.blocks} regimes of motion (by position, velocity, acceleration and load, '
        'or by posture), each predicted by a fit to all others',
        signal_rms=rms(raw.current[rows.usable]), before=judge.errors_of(rows, start, base),
        after=errors, noise_floor=judge.noise_floor(rows, refined.held_out), effects=effects,
        friction=friction,
        assumed=list(origin.assumed),
        unexplained=[replace(dependence, note=in_unit(dependence.note, unit))
                     for dependence in dependences],
        ambiguous=questions,
        differentiation=dict(model.differentiation or DEFAULT_SETTINGS if kept else fit.settings),
        stopped_because='no further effect predicts motion that was not fitted better by more '
                        'than chance would',
        **{**vars(verdict), 'warnings': [*verdict.warnings, *origin.warnings]})


def _notes(problem: Problem, refined: Predicted) -> list[Finding]:
    """Return what to know of friction at rest."""
    notes, model = [], refined.model
    what = 'Presliding is' if model.breakaway else 'Breakaway and presliding are'
    if refined.no_presliding:
        notes.append(Finding(
            'not_known', f'{what} not known, which a law needs at starts and turns: '
            f'{refined.no_presliding}. Ten slow reversals (a sine of 0.1 Hz) at 500 Hz or more '
            'show it.'))
    old, now = problem.model and problem.model.breakaway, model.breakaway
    if old and now and now != old:
        notes.append(Finding(
            'not_known', 'Breakaway friction was not measured here: it is that of the given model, '
            f'times {now.friction / old.friction:.3g} as friction in sliding. Identification '
            'measures it.'))
    return notes


def effects_of(fit: Fit, bounds: Intervals, friction: FrictionNumbers, unit: str
               ) -> list[FoundEffect]:
    """Return the effects, those first that lower the error most.

    All terms of other joints' weight and inertia make one. Inertia has the interval that it has
    among the numbers of `friction`.
    """
    chosen, remaining = fit.terms[:fit.initial_count], fit.terms[fit.initial_count:]
    entries: list[FoundEffect] = []
    # A shorter lag is due to sampling; a negative one, due to a filter of a sensor.
    if fit.lag >= fit.rows.samples.sample_time:
        entries.append(FoundEffect(
            name='actuation_lag', variable='history', held_out_rmse=float(fit.rmse(chosen)[-1]),
            chosen=1.0, parameters={'lag': fit.lag}, intervals={}, holds_on_another_day=None,
            in_words=f'Lag: the torque is {1e3 * fit.lag:.3g} ms later than the current',
            formula=f'i(t + {fit.lag:.4g} s)'))
    while remaining:
        groups = [term for term in remaining if term.group and term.group.kind != 'friction']
        candidates = [[term] for term in remaining if term not in groups]
        if groups:
            candidates.append(groups)
        error, index = min((float(fit.rmse([*chosen, *terms])[-1]), index)
                           for index, terms in enumerate(candidates))
        terms = candidates[index]
        chosen += terms
        remaining = [term for term in remaining if term not in terms]
        entry = _found_effect(fit, bounds, terms, error, unit)
        if ends := friction.intervals.get(entry.name):
            entry = replace(entry, intervals={'coefficients': [list(ends)]})
        entries.append(entry)
    return entries


def _found_effect(fit: Fit, bounds: Intervals, terms: Sequence[Term], error: float, unit: str
                  ) -> FoundEffect:
    """Return the effect of one term, or of all terms of other joints."""
    term, table = terms[0], fit.table
    kind, group = term.kind, term.group
    columns, values = table.columns_of[term], table.coefficients(fit.terms)
    own = [values[column] for column in columns]
    about: dict[str, Any] = {
        'name': kind.name, 'parameters': {'coefficients': own}, 'holds_on_another_day': True,
        'intervals': {'coefficients': [list(bounds.coefficients[column]) for column in columns]}}
    if group and group.kind == 'friction':
        said = group.describe()
        about |= {
            'name': 'friction_between',
            'in_words': f'{said[0].upper()}{said[1:]}: {own[0]:.4g} {unit} of Coulomb and '
            f'{own[1]:.4g} {unit} per rad/s of viscous friction',
            'formula': f'{own[0]:+.4g}·tanh(w/{group.width:.3g}) {own[1]:+.4g}·w, w = ' + ' '.join(
                f'{"+" if side > 0 else "-"}v_{name}' for name, side in group.angles)}
    elif group:
        moved = {name for one in terms if one.group for name in one.group.all_joints}
        names = ', '.join(sorted(moved - {fit.rows.samples.joint}))
        about |= {
            'parameters': {'coefficients': [1.0], 'terms': len(terms)}, 'intervals': {},
            'in_words': f'Weight and inertia of other links: {len(terms)} terms of the motion of '
            f'{names}', 'formula': f'{len(terms)} terms of {names}'}
    else:
        effect = kind({**term.constants, 'coefficients': own})
        about['intervals'] |= {name: list(ends) for (owner, name), ends in bounds.constants.items()
                               if owner == term}
        said, rivals = effect.describe(), fit.rivals.get(term, [])
        if rivals:
            said += f'; or {" or ".join(rivals).replace("_", " ")}: the recording does not tell'
        about |= {
            'parameters': effect.parameters, 'holds_on_another_day': effect.holds_on_another_day,
            'in_words': in_unit(said, unit), 'formula': effect.formula(), 'instead': rivals}
    return FoundEffect(variable=kind.variable, held_out_rmse=error,
                       chosen=min(fit.chosen(one) for one in terms), **about)
