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
from friction_comp.model.differentiation import differentiate
from friction_comp.model.effects import Scene
from friction_comp.model.effects.edges import with_range
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.choice import Choice, choose, lag_shows, Question
from friction_comp.refinement.fit.effect_sum import Fit
from friction_comp.refinement.fit.final_fit import final_fit, to_model, with_load
from friction_comp.refinement.judge.evidence import held_out_residual, rms
from friction_comp.refinement.judge.report import Outcome, report_of
from friction_comp.refinement.prepare import fit_data as recordings
from friction_comp.refinement.prepare.coupling_choice import say_so, with_other_joints
from friction_comp.refinement.prepare.differentiation_choice import (
    choose_differentiation,
    sharpest,
)
from friction_comp.refinement.prepare.prepared import fold_of_all
from friction_comp.refinement.prepare.saturation import saturated
from friction_comp.samples import Samples

# A second pass over more samples than this would take too long.
_TWICE = 200_000


@dataclass
class RefineResult:
    """What refinement found.

    Parameters
    ----------
    report : dict
        The content of report.json.
    model : FrictionModel
        Fitted on all usable samples, with the effects.
    start : FrictionModel
        The model before.
    samples : Samples
        All samples with velocity and acceleration.
    usable : ndarray of bool, shape (N,)
        The samples that the errors are counted on.
    before, after : ndarray, shape (N,)
        Held-out residual in A of the model before and of the refined model.
    scene : Scene
        What the recordings cover.
    trail : list of (str, float)
        Held-out error in A as effects were added.
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
    unit = unit or ('A' if drive or model else 'N·m')
    drive = drive or (model.drive if model else Drive(1.0, 1.0))
    raw = recordings.join(list(recorded))
    clipped = recordings.clipped(raw.current)
    settings = choose_differentiation(raw, clipped)
    clipped |= saturated(differentiate(raw, settings), clipped)
    choices = []
    for beside in with_other_joints(
            model.with_arm(raw) if model else raw, ~clipped, settings, len(raw) < _TWICE):
        question = Question(beside.samples, clipped, model, drive, unit, progress)
        choices.append((_chosen(question, beside.settings), question, beside))
    errors = _held_out_errors([found for found, _, _ in choices])
    found, question, beside = choices[int(np.argmin(errors))]
    raw, arm = beside.samples, beside.arm
    found = _with_lag_that_holds(question, found)
    # Samples near standstill do not decide which effects there are; what the model is worth beside
    # rest and at reversals does depend on how sharply the two are told apart.
    settings = sharpest(
        found.model, raw, ~clipped, found.model.differentiation, found.usable)
    result = _result(question, found, settings)
    if arm and any('coupling' in effect.needs for effect in result.model.effects):
        result.model.arm = arm
        say_so(result.report, arm, raw)
    return result


def _chosen(question: Question, settings: dict[str, Any]) -> Choice:
    """Return the effects, chosen again where another way of differentiating suits them better.

    Which bandwidth suits is seen better once the effects are known.
    """
    found = choose(question, settings)
    better = sharpest(found.model, question.raw, found.usable, settings)
    if better == settings or len(question.raw) >= _TWICE:
        return found
    return choose(question, better)


def _with_lag_that_holds(question: Question, found: Choice) -> Choice:
    """Return a choice without lag, unless it shows at a smoother velocity or nothing else will do.

    A zero-phase filter delays nothing: a lag of the drive is the same whatever the bandwidth. What
    makes up for noise or blur of one way of differentiating, or for the shape of another effect,
    comes and goes with it. Such a lag has to be worth its place beside the best that does without,
    differentiated as suits that.
    """
    lags = tuple({step.kind for step in found.steps if step.kind.reshapes})
    if not lags or len(question.raw) >= _TWICE:
        return found
    settings = found.model.differentiation
    choices = [choice for choice in recordings.bandwidths(question.raw)
               if choice['source'] == settings['source'] and choice['bandwidth']
               and choice['bandwidth'] < (settings['bandwidth'] or np.inf)]
    if not choices or lag_shows(question, found, max(
            choices, key=lambda choice: choice['bandwidth'])):
        return found
    other = _chosen(replace(question, without=(*question.without, *lags)), settings)
    worth = max(step.kind.worth(0.0, step.fits[0].terms[-1].constants, found.data.scene)
                for step in found.steps if step.kind.reshapes)
    errors = _held_out_errors([found, other])
    return found if errors[0] ** 2 < (1.0 - worth) * errors[1] ** 2 else other


def _held_out_errors(choices: list[Choice]) -> list[float]:
    """Return the error of each choice on data not fitted, on the samples that all of them have."""
    # Not every velocity tells the same samples from rest.
    rows = np.all([choice.data.usable for choice in choices], axis=0)
    return [rms(held_out_residual(choice.data, choice.steps[-1].fits if choice.steps else
                                  choice.bases)[rows]) for choice in choices]


def _result(question: Question, found: Choice, settings: dict[str, Any]) -> RefineResult:
    """Return what was found, or the start where that is as good on data not fitted."""
    model, drive, data = question.model, question.drive, found.data
    samples, usable = differentiate(question.raw, settings), found.usable
    fold = fold_of_all(data, len(samples))

    def held_out(pair: list[Fit]) -> np.ndarray:
        residual = np.empty(len(samples))
        for side, fit in enumerate(pair):
            rows = fold == side
            part = samples.current - to_model(fit, None, None, drive, settings).current(samples)
            residual[rows] = part[rows]
        return residual

    if model:
        start = with_load(model, data.load_coefficient)
        before = samples.current - start.current(samples)
    else:
        start = to_model(final_fit(data, found.bases), samples, usable, drive, settings)
        before = held_out(found.bases)
    trail = [('before', rms(before[usable]))]
    after = held_out(found.bases)
    for step in found.steps:
        after = held_out(step.fits)
        trail.append((step.kind.name, rms(after[usable])))
    moved = samples.take(usable)
    refined = replace(found.model, differentiation=dict(settings),
                      effects=[with_range(effect, moved) for effect in found.model.effects])
    stopped, steps = found.stopped, found.steps
    if not rms(after[usable]) < rms(before[usable]):
        refined, after, trail, steps = start, before, trail[:1], []
        if found.steps:
            stopped = ('nothing that was found lowers the error on data not fitted: the result is '
                       'the model before')
    refined = replace(
        refined, joint=refined.joint or question.raw.joint or (model.joint if model else ''),
        breakaway=model.breakaway if model else None,
        simulation=dict(model.simulation) if model else {},
        arm=model.arm if model else None,
        notes=dict(model.notes) if model else {})
    outcome = Outcome(
        samples=samples, usable=usable, clipped=question.clipped, data=data, steps=steps,
        start=start, model=refined, before=before, after=after, trail=trail, left=found.left,
        control=found.control, stopped=stopped, given=model is not None, unit=question.unit,
        raw=question.raw, settings=settings)
    return RefineResult(report_of(outcome), refined, start, samples, usable, before, after,
                        data.scene, trail)


__all__ = ['InputError', 'RefineResult', 'refine']
