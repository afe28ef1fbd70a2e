# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page on a model that was improved round by round."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import TYPE_CHECKING

from friction_comp.reports.figures import COLOURS, new_figure, styled
from friction_comp.reports.html import quantity, Report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from friction_comp.excitation.improve import Improvement


def improvement_report(improvement: Improvement, names: Sequence[str],
                       command: Sequence[str] = ()) -> Report:
    """Return the page; what refinement found is a page of its own, refinement.html beside it.

    Parameters
    ----------
    improvement : Improvement
    names : sequence of str
        Of the recordings.
    command : sequence of str
        Lines for the foot.
    """
    last, report = improvement.rounds[-1], improvement.result.report
    unit = report['unit']
    page = Report(f"The friction model of {report['joint'] or 'the joint'}, improved by motion")
    ended = improvement.ended or 'there are further rounds'
    rounds = len(improvement.rounds)
    page.verdict(f'**After {rounds} round{"s" * (rounds > 1)}, {improvement.seconds:g} s of '
                 f'motion: {last.verdict}.** {ended.capitalize()}.')
    page.numbers([
        (quantity(report['before']['held_out_rmse'], unit),
         'error before: Eq. 6, or the model given'),
        (quantity(last.held_out, unit), 'error with the effects found, on data not fitted'),
        ('–' if math.isnan(last.predicted) else quantity(last.predicted, unit),
         'error on the last motion, before it was fitted'),
        (quantity(report['noise_floor'], unit), 'noise from sample to sample')])
    page.text('What was found: ' + ('; '.join(
        entry['in_words'] for entry in report['effects']) or 'no effect beyond the model')
        + '. The page `refinement.html` beside this one shows the model itself.')
    page.heading('Rounds')
    page.text('Each round planned a motion for what the recordings before it left open, predicted '
              'that motion with the model that these had given, and then fitted all of them '
              'together. The error of the prediction is that of motion which the model has not '
              'seen.')
    page.figure(_figure(improvement, unit), 'Error of each round before it was fitted, and on data '
                'not fitted once all rounds were. The dashed line is the noise from sample to '
                'sample.')
    page.table(['round', 'motion told apart', 'predicted with', 'held out', 'effects', 'verdict'],
               [[k + 1, _asked(one.asked), '–' if math.isnan(one.predicted)
                 else quantity(one.predicted, unit), quantity(one.held_out, unit),
                 ', '.join(name.replace('_', ' ') for name in one.effects) or 'none',
                 one.verdict] for k, one in enumerate(improvement.rounds)])
    if last.reasons:
        page.text('What is left:\n\n' + '\n'.join(f'- {reason}' for reason in last.reasons))
    page.made_by(*command, f'Recordings: {", ".join(names)}')
    return page


def _asked(pairs: Sequence[tuple[str, str]]) -> str:
    names = dict.fromkeys(name.replace('_', ' ') for pair in pairs for name in pair)
    return ', '.join(names)


@styled
def _figure(improvement: Improvement, unit: str) -> Figure:
    rounds = improvement.rounds
    figure, axes = new_figure(1, 1, height=2.6)
    numbers = range(1, len(rounds) + 1)
    axes.plot(numbers, [one.predicted for one in rounds], 'o-', color=COLOURS['orange'],
              label='predicted before it was fitted')
    axes.plot(numbers, [one.held_out for one in rounds], 's-', color=COLOURS['blue'],
              label='held out, all rounds fitted')
    axes.axhline(improvement.result.report['noise_floor'], color='0.5', linestyle='--')
    most = max(value for one in rounds for value in (one.predicted, one.held_out)
               if value == value)
    axes.set_ylim(0.0, 1.25 * most)
    axes.set_xticks(list(numbers))
    axes.set_xlabel('round')
    axes.set_ylabel(f'RMS error in motion ({unit})')
    axes.legend(loc='upper right', ncols=2)
    return figure
