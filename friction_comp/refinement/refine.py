# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""From recordings to a model with the effects that they show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import Scene
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.attempt import Found, found_in, Question
from friction_comp.refinement.columns import Key
from friction_comp.refinement.final import held_out_residual, model_of, settled
from friction_comp.refinement.judge import errors_of
from friction_comp.refinement.prepare import join
from friction_comp.refinement.report import Outcome, report_of
from friction_comp.refinement.stability import intervals, repeated, Stability
from friction_comp.samples import Samples

_MOST_SAMPLES = 200_000


@dataclass
class RefineResult:
    """What refinement found.

    Parameters
    ----------
    report : dict
        The content of report.json.
    model : FrictionModel
        Fitted to all usable samples, with the effects.
    start : FrictionModel
        The model before.
    samples : Samples
        All samples with velocity and acceleration.
    usable : ndarray of bool, shape (N,)
        The samples in motion, which are fitted.
    before, after : ndarray, shape (N,)
        Residual in A of parts not fitted, of the model before and of the refined one.
    scene : Scene
        What the recordings cover.
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
        Their order makes no difference.
    model : FrictionModel, optional
        Where to start; the note's sigmoid fitted to the recordings when omitted.
    drive : Drive, optional
        Of the model when omitted.
    progress : callable, optional
        Called with a share of the work done and a word on it.
    unit : str, optional
        Of `Samples.current`, for the words of the report. When omitted it is A where a drive or a
        model says how effort becomes current, else N·m, the unit of effort.

    Returns
    -------
    RefineResult

    Raises
    ------
    InputError
        If the recordings cannot be used.
    """
    say = progress or (lambda share, word: None)
    declared = drive is not None or model is not None
    drive = drive or (model.drive if model else Drive(1.0, 1.0))
    raw = join(list(recorded))
    question = Question(raw, drive, declared, model, say)
    found = found_in(question)
    say(0.6, 'repeated searches')
    stability = repeated(found.table, found.keys, found.given, found.candidates)
    named = [key for key in found.keys[found.given:] if stability.named(key)]
    keys = [*found.keys[:found.given], *named]
    before = keys
    found = settled(found, keys)
    # Their constants were adjusted once more.
    stability = stability.renamed(dict(zip(before, found.keys)))
    joint = raw.joint or (model.joint if model else '')
    refined = model_of(found, drive, model, joint)
    say(0.9, 'verdict')
    return _result(question, found, refined, stability, unit or ('A' if declared else 'N·m'))


def _result(question: Question, found: Found, refined: FrictionModel, stability: Stability,
            unit: str) -> RefineResult:
    rows, raw, model = found.rows, question.raw, question.model
    index = np.arange(len(raw))
    after = held_out_residual(found, found.keys, index)
    fit_after = raw.current - refined.predict(raw, same_recording=True)
    if model:
        start = model
        before = fit_before = raw.current - model.predict(raw, same_recording=True)
    else:
        plain = settled(replace(found, keys=[], given=0), [])
        start = model_of(plain, question.drive, None, refined.joint)
        before = held_out_residual(plain, [], index)
        fit_before = rows.samples.current - start.current(rows.samples)
    errors = [errors_of(rows, fit, held_out, index)
              for fit, held_out in ((fit_before, before), (fit_after, after))]
    trail = [('before', errors[0].held_out)]
    report = report_of(Outcome(question, found, start, refined, errors[0], errors[1], before, after,
                               stability, intervals(found.table, found.keys), unit))
    for effect in report['effects']:
        trail.append((effect['name'], effect['held_out_rmse']))
    return RefineResult(report, refined, start, rows.samples, rows.usable, before, after,
                        rows.scene, trail)


__all__ = ['InputError', 'RefineResult', 'refine']
