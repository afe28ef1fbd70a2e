# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The reports of `excite` (a planned motion) and `improve` (a model refined on such motions)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import itertools

from matplotlib.figure import Figure
import numpy as np

from friction_comp.excitation.improve import Improvement
from friction_comp.excitation.plan import JointPlan
from friction_comp.excitation.separation import Pair
from friction_comp.number_text import quantity
from friction_comp.reports.figures import COLOURS, curve, new_figure, styled
from friction_comp.reports.html import Report
from friction_comp.reports.refinement_report import effect_names

_RATE = 50.0  # of the drawn curves, Hz


def excitation_report(plans: Sequence[JointPlan],
                      others: Sequence[Mapping[str, Mapping[Pair, float]]]) -> Report:
    """Return the report; `others` has for each plan the separation by other motions, by name."""
    seconds = plans[0].seconds
    report = Report('Planned motion', f'{len(plans)} joint{"s" * (len(plans) > 1)}, {seconds:g} s')
    worst = min((share, pair, plan.limits.joint) for plan in plans
                for pair, share in plan.separation.items())
    report.verdict(f'**Hardest to distinguish: {_pair_text(worst[1])}** of joint {worst[2]}: '
                   f'{100 * worst[0]:.2g} % of one is independent of the other and of the friction '
                   'curve (Eq. 6).')
    for plan, other in zip(plans, others):
        report.heading(f'Joint {plan.limits.joint}')
        report.figure(_plan_figure(plan), 'Left: position and velocity over time. Right: '
                      'velocity over position; dashed: the limits.')
        report.table(
            ['effects', 'this plan (%)', *(f'{name} (%)' for name in other)],
            [[_pair_text(pair), 100 * share,
              *(100 * separation[pair] for separation in other.values())]
             for pair, share in plan.separation.items()])
    report.text('The percentage is the part of one effect that is independent of the other: the '
                "smallest for several values of the effects' constants. It depends on the motion "
                'alone; whether `refine` finds an effect also depends on noise and on its size.')
    return report


def _pair_text(pair: Pair) -> str:
    return ' and '.join(pair).replace('_', ' ')


@styled
def _plan_figure(plan: JointPlan) -> Figure:
    motion, limits = plan.samples(_RATE), plan.limits
    figure, (left, right) = new_figure(columns=2, height=3.2)
    curve(left, motion.time, motion.position, 'blue', 'position (rad)')
    curve(left, motion.time, motion.velocity, 'orange', 'velocity (rad/s)', linewidth=0.8)
    left.set_xlabel('time (s)')
    left.legend(loc='lower left', bbox_to_anchor=(0.0, 1.0), ncols=2)
    curve(right, motion.position, motion.velocity, 'blue', style='.', markersize=2.0)
    for value in (limits.lowest, limits.highest):
        right.axvline(value, color=COLOURS['grey'], linestyle='--', linewidth=0.8)
    for value in (-limits.velocity, limits.velocity):
        right.axhline(value, color=COLOURS['grey'], linestyle='--', linewidth=0.8)
    right.set(xlabel='position (rad)', ylabel='velocity (rad/s)')
    return figure


def improvement_report(improvement: Improvement, names: Sequence[str]) -> Report:
    """Return the report of `improve` on recordings; the refined model has a page of its own."""
    last, report = improvement.rounds[-1], improvement.result.report
    unit = report.unit
    page = Report(f"The friction model of {report.joint or 'the joint'}, improved by motion")
    ended = improvement.ended or 'there are further rounds'
    rounds = len(improvement.rounds)
    page.verdict(f'**After {rounds} round{"s" * (rounds > 1)}, {improvement.seconds:g} s of '
                 f'motion: {last.verdict}.** {ended.capitalize()}.')
    page.numbers([
        (quantity(report.before.held_out_rmse, unit),
         'error before: Eq. 6, or the given model'),
        (quantity(last.held_out_rmse, unit), 'error with the effects found, on data not fitted'),
        (quantity(last.predicted_rmse, unit), 'error on the last motion, before it was fitted'),
        (quantity(report.noise_floor, unit), 'noise from sample to sample')])
    page.text('What was found: ' + ('; '.join(
        entry.in_words for entry in report.effects) or 'no effect beyond the model')
        + '. The page `refinement.html` beside this one describes the model.')
    page.heading('Rounds')
    page.text('Each round planned a motion for the questions that earlier recordings left open, '
              'recorded it, predicted its current with the model from the earlier recordings, and '
              'then fitted all recordings together. The prediction error is thus the error on '
              'motion that the model has not seen.')
    page.figure(_rounds_figure(improvement, unit), 'Error on the recording of each round before it '
                'was fitted, and on held-out parts after each fit. The dashed line is the noise '
                'from sample to sample.')
    page.table(['round', 'planned for', 'prediction error', 'held-out error', 'effects', 'verdict'],
               [[k + 1, effect_names(dict.fromkeys(itertools.chain(*round_.asked))),
                 quantity(round_.predicted_rmse, unit), quantity(round_.held_out_rmse, unit),
                 effect_names(round_.effects), round_.verdict]
                for k, round_ in enumerate(improvement.rounds)])
    page.bullets(last.reasons, 'What remains open:')
    page.made_by(f'Recordings: {", ".join(names)}')
    return page


@styled
def _rounds_figure(improvement: Improvement, unit: str) -> Figure:
    rounds = improvement.rounds
    figure, axes = new_figure(height=2.6, x='round', y=f'RMS error in motion ({unit})')
    numbers = range(1, len(rounds) + 1)
    curve(axes, numbers, [one.predicted_rmse for one in rounds], 'orange',
          'prediction, before the fit', 'o-')
    curve(axes, numbers, [one.held_out_rmse for one in rounds], 'blue', 'held out, after the fit',
          's-')
    axes.axhline(improvement.result.report.noise_floor, color='0.5', linestyle='--')
    largest = np.nanmax([(one.predicted_rmse, one.held_out_rmse) for one in rounds])
    axes.set_ylim(0.0, 1.25 * float(largest))
    axes.set_xticks(list(numbers))
    axes.legend(loc='upper right', ncols=2)
    return figure
