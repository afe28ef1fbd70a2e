# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Improves a model with motion planned for what the recordings so far leave open.

Each recording tests the model before it is fitted: the error with which earlier rounds predict new
motion is that to expect within the limits. Then the round is fitted together with all others, and
the next motion is planned for what that leaves open, until it adds no information.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
import math
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.excitation.joint_limits import JointLimits
from friction_comp.excitation.plan import JointPlan, plan_joint
from friction_comp.excitation.separation import DEFAULT, open_pairs, Pair, pairs_of
from friction_comp.files import plain
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement import refine, RefineResult
from friction_comp.refinement.recorded_motion import in_motion, standstill_speed
from friction_comp.refinement.result import AGAIN, IN_PART, TRUST
from friction_comp.refinement.thresholds import GROWTH
from friction_comp.samples import Samples
from friction_comp.statistics import rms

# Findings that more motion may resolve.
_BY_MOTION = ('extrapolates', 'ambiguous', 'unexplained', 'one_direction', 'explains_part',
              'explains_nothing')


@dataclass(frozen=True)
class Schedule:
    """How much a joint is moved; `InputError` if the budget is less than two rounds."""

    seconds: float = 30.0  # of motion in each round
    budget: float = 300.0  # s of motion in all rounds
    seed: int = 0  # of the first plan

    def __post_init__(self) -> None:
        if self.budget < 2.0 * self.seconds:
            raise InputError(
                f'a budget of {self.budget:g} s is less than two rounds of {self.seconds:g} s: '
                'the second tests what the first taught')


@dataclass(frozen=True)
class Round:
    """The motion and the results of one round."""

    seconds: float  # of motion, in this round
    asked: list[Pair]  # effects that its motion was planned to tell apart
    # RMS error in A, in motion, with which earlier rounds predict this one; NaN of the first.
    predicted_rmse: float
    held_out_rmse: float  # RMS error in A of the fit to all rounds, on parts that were not fitted
    effects: tuple[str, ...]  # named by the fit to all rounds
    verdict: str  # on the fit to all rounds, with what this round tested
    reasons: list[str]  # why it is not better


@dataclass(frozen=True)
class Improvement:
    """The results of all rounds."""

    rounds: list[Round]
    result: RefineResult  # of all recordings together
    ended: str  # why there was no further round; empty while there is one

    @property
    def verdict(self) -> str:
        """The verdict of the last round."""
        return self.rounds[-1].verdict

    @property
    def seconds(self) -> float:
        """Duration of motion in all rounds, s."""
        return sum(one.seconds for one in self.rounds)

    def report(self) -> dict[str, Any]:
        """Return the content of report.json: that of refinement, and the rounds."""
        last = self.rounds[-1]
        return {**self.result.report.content(), 'verdict': last.verdict,
                'reasons': last.reasons or self.result.report.reasons,
                'rounds': [plain(asdict(one), not_finite=None) for one in self.rounds],
                'ended': self.ended}


def prediction_error(model: FrictionModel, samples: Samples) -> float:
    """Return the RMS error with which a model predicts a recording, in motion, A."""
    return rms((model.measured(samples) - model.predict(samples))[moving(samples, model)])


def moving(samples: Samples, model: FrictionModel) -> np.ndarray:
    """Return which samples refinement would fit, bool, (N,); InputError if they are too few."""
    moved = model.differentiated(samples)
    return in_motion(moved, np.zeros(len(moved), dtype=bool), standstill_speed(moved),
                     model.settings.get('bandwidth'))


def improve(play: Callable[[JointPlan], Samples], limits: JointLimits, drive: Drive, *,
            model: FrictionModel | None = None, recorded: Sequence[Samples] = (),
            schedule: Schedule = Schedule(),
            progress: Callable[[float, str], None] | None = None,
            done: Callable[[Improvement], None] | None = None,
            plan: Callable[..., JointPlan] = plan_joint) -> Improvement:
    """Refine, plan, move and record until the model predicts motion that it has not seen.

    `play` moves the joint along a plan and returns the recording. `model` is the initial one, else
    the note's sigmoid, and `recorded` are recordings from before the first round. `progress` is
    called with the share of the budget that is spent and the present step, `done` with the results
    so far after each round; `plan` replaces `plan_joint`. Raises InputError if limits, model or
    recordings cannot be used.
    """
    seconds, budget = schedule.seconds, schedule.budget
    recordings, rounds = list(recorded), list[Round]()
    result = refine(recordings, model, drive) if recordings else None
    while True:
        spent, number = sum(one.seconds for one in rounds), len(rounds)

        def report(share: float, word: str, number: int = number) -> None:
            if progress:
                progress(share, f'round {number + 1}: {word}')
        asked = (open_pairs(result.report.content()) if result else []) or pairs_of(DEFAULT)
        report(spent / budget, 'planning')
        planned = plan(limits, asked, seconds, schedule.seed + number, model)
        report(spent / budget, 'moving')
        recordings.append(play(planned))
        predicted = prediction_error(result.model, recordings[-1]) if result else math.nan
        before = named_effects(result) if result else None
        report((spent + seconds) / budget, 'refining')
        result = refine(recordings, model, drive)
        rounds.append(_round(planned.seconds, asked, predicted, result, before))
        improvement = Improvement(list(rounds), result, _why_ended(
            rounds, result, spent + 2.0 * seconds > budget))
        if done:
            done(improvement)
        if improvement.ended:
            return improvement


def named_effects(result: RefineResult) -> tuple[str, ...]:
    """Return the names of the effects in a result, without duplicates."""
    return tuple(sorted({one.name for one in result.report.effects}))


def _round(seconds: float, asked: list[Pair], predicted: float, result: RefineResult,
           before: tuple[str, ...] | None) -> Round:
    """Return the round of a recording that was predicted with the RMS error `predicted`."""
    report = result.report
    held_out, effects = report.after.held_out_rmse, named_effects(result)
    same = effects == before
    tested = same and predicted <= GROWTH * held_out
    # A motion that was predicted well shows that the model does not extrapolate badly.
    open_findings = [one for one in report.findings if one.grade != TRUST
                     and not (tested and one.code == 'extrapolates')]
    reasons = [one.text for one in open_findings]
    if before is None:
        reasons.append('No motion that was not fitted has tested the model.')
    elif not same:
        reasons.append('The last recording changed which effects are named.')
    elif not tested:
        reasons.append(f'The last recording was predicted with an error of {predicted:.3g}, where '
                       f'{held_out:.3g} is left once it is fitted too.')
    grades = {one.grade for one in open_findings}
    verdict = AGAIN if AGAIN in grades else IN_PART if reasons else TRUST
    return Round(
        seconds=seconds, asked=asked, predicted_rmse=predicted, held_out_rmse=held_out,
        effects=effects, verdict=verdict, reasons=reasons)


def _why_ended(rounds: list[Round], result: RefineResult, spent: bool) -> str:
    """Return why there is no further round; empty where there is one."""
    last = rounds[-1]
    if last.verdict == TRUST:
        return 'a motion that was not fitted is predicted as well as those that were'
    codes = {one.code for one in result.report.findings if one.grade != TRUST}
    if len(rounds) > 1 and codes - set(_BY_MOTION):
        return 'the open questions cannot be answered by moving this joint'
    recent = rounds[-3:]
    if len(recent) == 3 and len({one.effects for one in recent}) == 1 and (
            max(one.held_out_rmse for one in recent)
            < 1.05 * min(one.held_out_rmse for one in recent)):
        return 'three rounds named the same effects with the same error'
    return 'the budget is spent' if spent else ''
