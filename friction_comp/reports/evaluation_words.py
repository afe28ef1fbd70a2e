# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An evaluation in words, with numbers and intervals."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from friction_comp.evaluation.repetitions import FIGURES
from friction_comp.reports.html import number

if TYPE_CHECKING:
    from friction_comp.evaluation.compare import Comparison
    from friction_comp.evaluation.conditions import Condition, Evaluation
    from friction_comp.evaluation.intervals import Interval
    from friction_comp.evaluation.repetitions import Help
    from friction_comp.evaluation.trend import Trend


def summary(evaluation: Evaluation) -> str:
    """Return in plain words what the trials show, the verdict first."""
    words = [verdict(evaluation)]
    words.extend(_trend_words(trend, evaluation) for trend in evaluation.trends if trend.sure)
    words.extend(_stuck_words(evaluation))
    starts = sum(c.false_starts for c in evaluation.conditions)
    words.append('The joint never started by itself.' if not starts else
                 f'**In {starts} repetitions the joint started by itself.** A lower '
                 '`breakaway_gain` or a new identification is called for.' if evaluation.measured
                 else f'In {starts} repetitions the joint set out early, by itself or pushed.')
    against = [c for c in evaluation.conditions if c.help.announced < 0]
    if against:
        words.append(
            f'{sum(c.repetitions for c in against)} movements went against the direction '
            'announced; they are listed apart.')
    return ' '.join(words)


def condition_line(condition: Condition) -> str:
    """Return one condition in a line of a terminal."""
    figures = [f'{FIGURES[name][0]} {figure_of(condition, name)} {FIGURES[name][1]}'.strip()
               for name in ('peak_torque', 'rms_torque', 'residual_current', 'onset',
                            'smoothness') if name in condition.figures]
    count = f'{condition.repetitions} repetition{"s" if condition.repetitions > 1 else ""}'
    if condition.stuck:
        count += f', in {condition.stuck} the joint did not set out'
    return f'{condition.help.label}, {condition.movement} movement ({count}): {", ".join(figures)}'


def figure_of(condition: Condition, name: str) -> str:
    """Return a figure of a condition with its interval; a bound where the joint did not set out."""
    text = with_interval(condition.figures.get(name))
    return f'>\u00a0{text}' if name == 'peak_torque' and condition.stuck else text


def compared_peaks(evaluation: Evaluation) -> tuple[str, str] | None:
    """Return the peak torque in N·m without the announced direction and with it, as written."""
    compared, two = evaluation.compared('peak_torque'), evaluation.pair()
    if compared is None or two is None:
        return None
    before, after = (peak_text(value, evaluation.stuck(known))
                     for value, known in zip(compared, two))
    return before, after


def peak_text(torque: float, stuck: int, digits: int = 3) -> str:
    """Return a peak torque in N·m, as a bound where the joint did not set out each time."""
    return f'{"> " if stuck else ""}{number(torque, digits)}'


def verdict(evaluation: Evaluation) -> str:
    """Return in a sentence how much announcing the direction helps the person."""
    compared, change = evaluation.compared('peak_torque'), evaluation.peak_reduction
    two = evaluation.pair()
    if compared is not None and change is not None and two is not None:
        before, after = compared
        verb = 'less' if change >= 0 else 'more'
        alike = (two[0].law, two[0].model) == (two[1].law, two[1].model)
        plain, assisted = (('without (d = 0)', 'the direction announced (d = ±1)') if alike else
                           (f'with {_law(evaluation, two[0])}',
                            f'the direction announced (d = ±1, {_law(evaluation, two[1])})'))
        more = ['more than ' if evaluation.stuck(known) else '' for known in two]
        least = 'at least ' if evaluation.is_bound else ''
        words = (f'With {assisted} it took {more[1]}**{number(after)} N·m** to set the joint in '
                 f'motion instead of {more[0]}**{number(before)} N·m** {plain}: '
                 f'{least}**{abs(100 * change):.0f} % {verb}**')
        test = next((c for c in evaluation.comparisons if c.figure == 'peak_torque'
                     and (c.first, c.second) == two), None)
        if test is None or test.probability is None:
            return words + ', of too few repetitions to rule out chance.'
        span = test.difference
        if not test.sure and span.low is not None and span.high is not None and (
                span.low * span.high > 0):
            return words + (f'; the difference is {with_interval(span)} N·m. {test.pairs} pairs '
                            'are too few to rule out chance among so many comparisons '
                            f'({probability(test)}).')
        if not test.sure:
            return words + f', which may be chance ({probability(test)}, {test.pairs} pairs).'
        return words + f', more than chance ({probability(test)}, {test.pairs} pairs).'
    if not evaluation.measured:
        return ('**The back-driving torque was not measured.** What follows is what position, '
                'current and reference tell: when the joint set out and how smoothly it went, not '
                'what it cost the person.')
    return ('What the announced direction brings cannot be said: no movement was recorded both '
            'with it (d = ±1) and without (d = 0, or no compensation). All comparisons are below.')


def _stuck_words(evaluation: Evaluation) -> list[str]:
    """Return a sentence for each condition under which the joint did not always set out."""
    lines = []
    for known in dict.fromkeys(c.help for c in evaluation.conditions):
        stuck = evaluation.stuck(known)
        if stuck:
            count = sum(r.help == known for r in evaluation.repetitions)
            lines.append(f'With {evaluation.label(known)} the joint did not set out in {stuck} of '
                         f'{count} movements.')
    return lines


def _law(evaluation: Evaluation, known: Help) -> str:
    """Return a condition without its direction, which the sentence around it says."""
    return ' · '.join(evaluation.words(known)[1:]) or 'no law that the recording names'


def _trend_words(trend: Trend, evaluation: Evaluation) -> str:
    assert trend.per_week is not None
    name, unit = FIGURES[trend.figure]
    rises = trend.per_week.mean > 0
    # Smoothness is the only figure of which more is better.
    judged = 'better' if rises == (trend.figure == 'smoothness') else 'worse'
    return (f'Over {len(trend.days)} days, {name} with {evaluation.label(trend.help)} '
            f'**{"rises" if rises else "falls"} by {number(abs(trend.per_week.mean))} {unit} '
            f'a week**, for the {judged} ({chance(trend.probability or 0.0)}).')


def heading(name: str) -> str:
    """Return the name of a figure of `FIGURES` with its unit."""
    title, unit = FIGURES[name]
    return f'{title} ({unit})' if unit else title


def with_interval(value: Interval | None) -> str:
    """Return a mean with half of its interval, in as many digits as are significant."""
    if value is None:
        return '–'
    if value.low is None or value.high is None:
        return number(value.mean)
    half = 0.5 * (value.high - value.low)
    size = max(abs(value.mean), half)
    if not size:
        return '0'
    # As many decimals as the interval is worth, but no more than four digits in all.
    most = 3 - math.floor(math.log10(size))
    wanted = 1 - math.floor(math.log10(half)) if half > 0 else most
    places = max(min(wanted, most), 0)
    mean = f'{value.mean:.{places}f}'.replace('-', '\u2212')
    reach = f'{half:.{places}f}' if half == 0 or half >= 0.5 * 10.0 ** -places else (
        f'<\u202f{10.0 ** -places:.{places}f}')
    # No break between a number and what belongs to it.
    return f'{mean}\u00a0±\u00a0{reach}'


def share(value: Interval) -> str:
    """Return the interval of a share in per cent."""
    low, high = 100 * (value.low or 0.0), 100 * (value.high or 0.0)
    return f'{low:.0f}\u202f–\u202f{high:.0f}\u00a0%'


def chance(probability: float) -> str:
    """Return a probability as tables of statistics have it."""
    return ('p < 0.001' if probability < 0.001 else f'p = {probability:.2g}').replace(
        ' ', '\u00a0')


def probability(comparison: Comparison) -> str:
    """Return the probability of a difference by chance; a dash where there are too few pairs."""
    return '–' if comparison.probability is None else chance(comparison.probability)


def unbroken(evaluation: Evaluation, known: Help) -> str:
    """Return a condition's name that a narrow column breaks before the model only."""
    words = [word.replace(' ', '\u00a0') for word in evaluation.words(known)]
    return ' '.join(['\u00a0·\u00a0'.join(words[:2]), *words[2:]])
