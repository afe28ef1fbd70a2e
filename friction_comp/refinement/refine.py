# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Refines a model: adds the effects that recordings show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import Scene
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.attempt import find_best_fit, Fit, fit_eq6_alone, Question
from friction_comp.refinement.constants import at_limit
from friction_comp.refinement.elsewhere import Elsewhere
from friction_comp.refinement.final import model_of, refit
from friction_comp.refinement.judge import rms
from friction_comp.refinement.prepare import join
from friction_comp.refinement.report import report_of, ReportInput
from friction_comp.refinement.stability import intervals, repeat_search, Stability
from friction_comp.samples import Samples


@dataclass
class RefineResult:
    """The result of refinement.

    Parameters
    ----------
    report : dict
        The content of report.json.
    model : FrictionModel
        The refined model, fitted to all usable samples.
    start : FrictionModel
        The initial model.
    samples : Samples
        All samples with velocity and acceleration.
    usable : ndarray of bool, shape (N,)
        The samples in motion, which are fitted.
    before, after : ndarray, shape (N,)
        Residual of parts that were not fitted, by the initial and by the refined model, A.
    scene : Scene
        The ranges that the recordings cover.
    trail : list of (str, float)
        Held-out error in A as effects are added.
    """

    report: dict[str, Any]
    model: FrictionModel
    start: FrictionModel
    samples: Samples
    usable: np.ndarray
    before: np.ndarray
    after: np.ndarray
    scene: Scene
    trail: list[tuple[str, float]] = field(default_factory=list)


def refine(recorded: Sequence[Samples], model: FrictionModel | None = None,
           drive: Drive | None = None, progress: Callable[[float, str], None] | None = None,
           unit: str | None = None) -> RefineResult:
    """Find the effects that a model lacks.

    Parameters
    ----------
    recorded : sequence of Samples
        Recordings, in any order.
    model : FrictionModel, optional
        The initial model; the note's sigmoid fitted to the recordings when omitted.
    drive : Drive, optional
        The model's when omitted.
    progress : callable, optional
        Called with the share of the work done and the name of the step.
    unit : str, optional
        Unit of `Samples.current`, for the text of the report. The default is A where a drive or a
        model gives the torque constant, otherwise N·m, the unit of effort.

    Returns
    -------
    RefineResult

    Raises
    ------
    InputError
        If the recordings cannot be used.
    """
    report_progress = progress or (lambda share, word: None)
    declared = drive is not None or model is not None
    drive = drive or (model.drive if model else Drive(1.0, 1.0))
    question = Question(join(list(recorded)), drive, declared, model, report_progress)
    fit = find_best_fit(question)
    fit, stability = select_named(fit, report_progress)
    report_progress(0.9, 'writing')
    return _result(question, fit, stability, unit or ('A' if declared else 'N·m'))


def select_named(fit: Fit, report_progress: Callable[[float, str], None]) -> tuple[Fit, Stability]:
    """Return a fit of the terms that can be named, and how often each was chosen.

    A term is named where most repeated searches choose it, where it does not increase the errors
    on thirds of the recording that were not fitted, where the interval of one of its coefficients
    excludes zero, and where none of its defining constants is at its limit.
    """
    report_progress(0.6, 'repeating the search on resampled parts')
    stability = repeat_search(fit.table, fit.keys, fit.given, fit.candidates)
    given = fit.keys[:fit.given]
    keys = [*given, *(key for key in fit.keys[fit.given:] if stability.named(key))]
    keys = Elsewhere(fit.table, keys).helpful(keys, fit.given)
    while True:
        fitted = refit(fit, keys)
        # The constants were adjusted again, so keys have changed.
        stability = stability.renamed(dict(zip(keys, fitted.keys)))
        keys = fitted.keys
        bounds = intervals(fitted.table, keys)
        certain = [*keys[:len(given)], *(key for key in keys[len(given):] if bounds.excludes_zero(
            fitted.table.columns_of(key), fitted.table.sums.signs[fitted.table.columns_of(key)])
            and not at_limit(fitted.table.terms[key], fitted.table))]
        if len(certain) == len(keys):
            return fitted, stability
        keys = certain


def _result(question: Question, fit: Fit, stability: Stability, unit: str) -> RefineResult:
    rows, raw, given = fit.rows, question.raw, question.model
    joint = raw.joint or (given.joint if given else '')
    model = model_of(fit, question.drive, given, joint)
    if given:
        start = given
        before = fit_before = given.measured(raw) - given.predict(raw, same_recording=True)
    else:
        plain = refit(fit_eq6_alone(question, fit.settings), [])
        start = model_of(plain, question.drive, None, joint)
        before = plain.residual()
        fit_before = rows.samples.current - start.current(rows.samples)
    after, fit_after = fit.residual(), raw.current - model.predict(raw, same_recording=True)
    # A model that is no better on parts that were not fitted is not used.
    keep_start = rms(after[rows.usable]) >= rms(before[rows.usable])
    if keep_start:
        model, after, fit_after = start, before, fit_before
    report = report_of(ReportInput(
        question, fit, start, model, fit_before, before, fit_after, after, stability,
        intervals(fit.table, fit.keys), unit, keep_start))
    trail = [('before', report['before']['held_out_rmse'])]
    trail += [(effect['name'], effect['held_out_rmse']) for effect in report['effects']]
    return RefineResult(report, model, start, rows.samples, rows.usable, before, after,
                        rows.scene, trail)


__all__ = ['InputError', 'RefineResult', 'refine']
