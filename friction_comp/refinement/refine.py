# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Refines a model: adds the effects that recordings show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.model.arm import Arm, Coupling
from friction_comp.model.effects import Effect, EFFECTS
from friction_comp.model.effects.base import RESISTS, with_range
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.friction_numbers import line_of
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.parallel import one_thread
from friction_comp.refinement.best_fit import find_best_fit, Fit, fit_eq6_alone, Problem, rivals_of
from friction_comp.refinement.effect_columns import EQ6_LINEAR
from friction_comp.refinement.intervals import Intervals, intervals, recorded_of
from friction_comp.refinement.prepare import join
from friction_comp.refinement.recorded_motion import settings_for_arm
from friction_comp.refinement.report import report_of
from friction_comp.refinement.result import Origin, Predicted, RefineResult, TRUST
from friction_comp.refinement.reversals import friction_at_rest
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
    groups, gains = [], []
    for term in fit.terms:
        values = tuple(coefficients[column] for column in table.columns_of[term])
        if term.group is None:
            # What may be the doing of other joints has no law by which it goes on beyond.
            effects.append(with_range(
                term.kind({**term.constants, 'coefficients': list(values)}), moving,
                only_recorded='other_joints' in fit.rivals.get(term, ())))
        else:
            groups.append(term.group)
            gains.append(values)
    arm = None
    if groups:
        effects.append(EFFECTS['other_joints']({'coefficients': [1.0]}))
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
