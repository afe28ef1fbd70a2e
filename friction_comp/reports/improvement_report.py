# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page on a model that was improved in rounds."""

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
    """Return the page; the refined model has a page of its own, refinement.html beside it.

    Parameters
    ----------
    improvement : Improvement
    names : sequence of str
        Names of the recordings.
    command : sequence of str
        Lines for the footer.
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
         'error before: Eq. 6, or the given model'),
        (quantity(last.held_out, unit), 'error with the effects found, on data not fitted'),
        ('–' if math.isnan(last.predicted) else quantity(last.predicted, unit),
         'error on the last motion, before it was fitted'),
        (quantity(report['noise_floor'], unit), 'noise from sample to sample')])
    page.text('What was found: ' + ('; '.join(
        entry['in_words'] for entry in report['effects']) or 'no effect beyond the model')
        + '. The page `refinement.html` beside this one describes the model.')
    page.heading('Rounds')
    page.text('Each round planned a motion for the questions that earlier recordings left open, '
              'predicted it with the model of these recordings, and then fitted all of them '
              'together. The error of the prediction is the error on motion that the model has '
              'not seen.')
    page.figure(_figure(improvement, unit), 'Error of each round before it was fitted, and on data '
                'not fitted after all rounds. The dashed line is the noise from sample to sample.')
    page.table(['round', 'planned for', 'error predicted', 'error held out', 'effects', 'verdict'],
               [[k + 1, _effect_names(round_.asked), '–' if math.isnan(round_.predicted)
                 else quantity(round_.predicted, unit), quantity(round_.held_out, unit),
                 ', '.join(name.replace('_', ' ') for name in round_.effects) or 'none',
                 round_.verdict] for k, round_ in enumerate(improvement.rounds)])
    if last.reasons:
        page.text('What remains open:\n\n' + '\n'.join(f'- {reason}' for reason in last.reasons))
    page.made_by(*command, f'Recordings: {", ".join(names)}')
    return page


def _effect_names(pairs: Sequence[tuple[str, str]]) -> str:
    names = dict.fromkeys(name.replace('_', ' ') for pair in pairs for name in pair)
    return ', '.join(names)


@styled
def _figure(improvement: Improvement, unit: str) -> Figure:
    rounds = improvement.rounds
    figure, axes = new_figure(1, 1, height=2.6)
    numbers = range(1, len(rounds) + 1)
    axes.plot(numbers, [round_.predicted for round_ in rounds], 'o-', color=COLOURS['orange'],
              label='predicted before it was fitted')
    axes.plot(numbers, [round_.held_out for round_ in rounds], 's-', color=COLOURS['blue'],
              label='held out, all rounds fitted')
    axes.axhline(improvement.result.report['noise_floor'], color='0.5', linestyle='--')
    largest = max(value for round_ in rounds for value in (round_.predicted, round_.held_out)
                  if value == value)
    axes.set_ylim(0.0, 1.25 * largest)
    axes.set_xticks(list(numbers))
    axes.set_xlabel('round')
    axes.set_ylabel(f'RMS error in motion ({unit})')
    axes.legend(loc='upper right', ncols=2)
    return figure
