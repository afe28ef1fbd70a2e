# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page on a model that was improved round by round: the rounds, then what refinement found."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import TYPE_CHECKING

from friction_comp.reports.figures import COLOURS, new_figure, styled
from friction_comp.reports.html import Report
from friction_comp.reports.refinement_report import refinement_report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from friction_comp.excitation.improve import Improvement


def improvement_report(improvement: Improvement, names: list[str], command: Sequence[str] = ()
                       ) -> Report:
    """Return the page.

    Parameters
    ----------
    improvement : Improvement
    names : list of str
        Of the recordings.
    command : sequence of str
        Lines for the foot.
    """
    page = refinement_report(improvement.result, names, command)
    last = improvement.rounds[-1]
    ended = improvement.ended or 'there are further rounds'
    page.verdict(f'**After {len(improvement.rounds)} rounds, {improvement.seconds:g} s of motion: '
                 f'{last.verdict}.** {ended.capitalize()}.')
    page.heading('Rounds')
    page.text('Each round planned a motion for what the recordings before it left open, predicted '
              'that motion with the model that these had given, and then fitted all of them '
              'together. The error of the prediction is that of motion which the model has not '
              'seen.')
    page.figure(_figure(improvement), 'Error of each round before it was fitted, and on data not '
                'fitted once all rounds were. The dashed line is the noise from sample to sample.')
    page.table(['round', 'asked', 'predicted with (mA)', 'held out, fitted (mA)', 'effects',
                'verdict'],
               [[k + 1, _asked(one.asked), '' if math.isnan(one.predicted)
                 else f'{1e3 * one.predicted:.3g}', 1e3 * one.held_out,
                 ', '.join(name.replace('_', ' ') for name in one.effects) or 'none',
                 one.verdict] for k, one in enumerate(improvement.rounds)])
    if last.reasons:
        page.text('What is left:\n\n' + '\n'.join(f'- {reason}' for reason in last.reasons))
    return page


def _asked(pairs: Sequence[tuple[str, str]]) -> str:
    names = dict.fromkeys(name.replace('_', ' ') for pair in pairs for name in pair)
    return ', '.join(names)


@styled
def _figure(improvement: Improvement) -> Figure:
    rounds = improvement.rounds
    figure, axes = new_figure(1, 1, height=2.6)
    numbers = range(1, len(rounds) + 1)
    axes.plot(numbers, [1e3 * one.predicted for one in rounds], 'o-', color=COLOURS['orange'],
              label='predicted before it was fitted')
    axes.plot(numbers, [1e3 * one.held_out for one in rounds], 's-', color=COLOURS['blue'],
              label='held out, all rounds fitted')
    axes.axhline(1e3 * improvement.result.report['noise_floor'], color='0.5', linestyle='--')
    axes.set_ylim(bottom=0.0)
    axes.set_xticks(list(numbers))
    axes.set_xlabel('round')
    axes.set_ylabel('RMS error in motion (mA)')
    axes.legend(loc='best')
    return figure
