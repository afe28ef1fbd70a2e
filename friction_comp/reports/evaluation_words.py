# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Describes an evaluation in words, with numbers and intervals."""

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
    """Return a summary of the trials in words, the verdict first."""
    words = [verdict(evaluation)]
    words.extend(_trend_sentence(trend, evaluation) for trend in evaluation.trends
                 if trend.significant)
    words.extend(_stuck_sentences(evaluation))
    starts = sum(c.false_starts for c in evaluation.conditions)
    words.append('The joint never started by itself.' if not starts else
                 f'**In {starts} repetitions the joint started by itself.** Lower '
                 '`breakaway_gain` or identify again.' if evaluation.measured
                 else f'In {starts} repetitions the joint started early, by itself or pushed.')
    against = [c for c in evaluation.conditions if c.help.announced < 0]
    if against:
        words.append(
            f'{sum(c.repetitions for c in against)} movements went against the announced '
            'direction; they are listed separately.')
    return ' '.join(words)


def condition_line(condition: Condition) -> str:
    """Return one condition as a line for the terminal."""
    figures = [f'{FIGURES[name][0]} {figure_of(condition, name)} {FIGURES[name][1]}'.strip()
               for name in ('peak_torque', 'rms_torque', 'residual_current', 'onset',
                            'smoothness') if name in condition.figures]
    count = f'{condition.repetitions} repetition{"s" if condition.repetitions > 1 else ""}'
    if condition.stuck:
        count += f', in {condition.stuck} the joint did not move'
    return f'{condition.help.label}, {condition.movement} movement ({count}): {", ".join(figures)}'


def figure_of(condition: Condition, name: str) -> str:
    """Return a figure of a condition with its interval, or a bound where the joint was stuck."""
    text = with_interval(condition.figures.get(name))
    return f'>\u00a0{text}' if name == 'peak_torque' and condition.stuck else text


def compared_peaks(evaluation: Evaluation) -> tuple[str, str] | None:
    """Return the peak torques without and with the announced direction as text, N·m."""
    torques, pair = evaluation.compared('peak_torque'), evaluation.pair()
    if torques is None or pair is None:
        return None
    before, after = (peak_text(value, evaluation.stuck(condition))
                     for value, condition in zip(torques, pair))
    return before, after


def peak_text(torque: float, stuck: int, digits: int = 3) -> str:
    """Return a peak torque in N·m as text, as a bound where the joint was stuck."""
    return f'{"> " if stuck else ""}{number(torque, digits)}'


def verdict(evaluation: Evaluation) -> str:
    """Return the effect of announcing the direction in a sentence."""
    torques, change = evaluation.compared('peak_torque'), evaluation.peak_reduction
    pair = evaluation.pair()
    if torques is not None and change is not None and pair is not None:
        before, after = torques
        verb = 'less' if change >= 0 else 'more'
        same_law = (pair[0].law, pair[0].model) == (pair[1].law, pair[1].model)
        plain, assisted = 'without (d = 0)', 'the direction announced (d = ±1)'
        if not same_law:
            first, second = (_label_without_direction(evaluation, condition) for condition in pair)
            plain, assisted = f'with {first}', f'the direction announced (d = ±1, {second})'
        more = ['more than ' if evaluation.stuck(condition) else '' for condition in pair]
        least = 'at least ' if evaluation.is_bound else ''
        words = (f'With {assisted} it took {more[1]}**{number(after)} N·m** to set the joint in '
                 f'motion instead of {more[0]}**{number(before)} N·m** {plain}: '
                 f'{least}**{abs(100 * change):.0f} % {verb}**')
        test = next((c for c in evaluation.comparisons if c.figure == 'peak_torque'
                     and (c.first, c.second) == pair), None)
        if test is None or test.probability is None:
            return words + ', from too few repetitions to rule out chance.'
        difference = test.difference
        apart = (difference.low is not None and difference.high is not None
                 and difference.low * difference.high > 0)
        if not test.significant and apart:
            return words + (f'; the difference is {with_interval(difference)} N·m. {test.pairs} '
                            'pairs are too few to rule out chance among so many comparisons '
                            f'({probability(test)}).')
        if not test.significant:
            return words + f', which may be chance ({probability(test)}, {test.pairs} pairs).'
        return words + f', a significant difference ({probability(test)}, {test.pairs} pairs).'
    if not evaluation.measured:
        return ('**The back-driving torque was not measured.** Position, current and reference '
                'show when the joint started and how smoothly it moved, but not how much torque '
                'the person needed.')
    return ('The effect of announcing the direction is unknown: no movement was recorded both '
            'with it (d = ±1) and without (d = 0, or no compensation). All comparisons are below.')


def _stuck_sentences(evaluation: Evaluation) -> list[str]:
    """Return a sentence for each condition under which the joint was stuck in some movements."""
    lines = []
    for condition in dict.fromkeys(c.help for c in evaluation.conditions):
        stuck = evaluation.stuck(condition)
        if stuck:
            count = sum(r.help == condition for r in evaluation.repetitions)
            lines.append(f'With {evaluation.label(condition)} the joint did not move in {stuck} of '
                         f'{count} movements.')
    return lines


def _label_without_direction(evaluation: Evaluation, condition: Help) -> str:
    """Return a condition's label without its direction."""
    return ' · '.join(evaluation.words(condition)[1:]) or 'no law that the recording names'


def _trend_sentence(trend: Trend, evaluation: Evaluation) -> str:
    assert trend.per_week is not None
    name, unit = FIGURES[trend.figure]
    rises = trend.per_week.mean > 0
    # Smoothness is the only figure that is better when larger.
    judged = 'better' if rises == (trend.figure == 'smoothness') else 'worse'
    return (f'Over {len(trend.days)} days, {name} with {evaluation.label(trend.help)} '
            f'**{"rises" if rises else "falls"} by {number(abs(trend.per_week.mean))} {unit} '
            f'a week**, for the {judged} ({p_value_text(trend.probability or 0.0)}).')


def heading(name: str) -> str:
    """Return the name of a figure of `FIGURES` with its unit."""
    title, unit = FIGURES[name]
    return f'{title} ({unit})' if unit else title


def with_interval(value: Interval | None) -> str:
    """Return a mean with half its interval, with as many digits as are significant."""
    if value is None:
        return '–'
    if value.low is None or value.high is None:
        return number(value.mean)
    half = 0.5 * (value.high - value.low)
    size = max(abs(value.mean), half)
    if not size:
        return '0'
    # As many decimals as the interval justifies, but no more than four digits in total.
    most = 3 - math.floor(math.log10(size))
    wanted = 1 - math.floor(math.log10(half)) if half > 0 else most
    places = max(min(wanted, most), 0)
    mean = f'{value.mean:.{places}f}'.replace('-', '\u2212')
    half_text = f'{half:.{places}f}' if half == 0 or half >= 0.5 * 10.0 ** -places else (
        f'<\u202f{10.0 ** -places:.{places}f}')
    # No line break between a number and its interval.
    return f'{mean}\u00a0±\u00a0{half_text}'


def share(value: Interval) -> str:
    """Return the interval of a share in percent."""
    low, high = 100 * (value.low or 0.0), 100 * (value.high or 0.0)
    return f'{low:.0f}\u202f–\u202f{high:.0f}\u00a0%'


def p_value_text(probability: float) -> str:
    """Return a p-value as text."""
    return ('p < 0.001' if probability < 0.001 else f'p = {probability:.2g}').replace(
        ' ', '\u00a0')


def probability(comparison: Comparison) -> str:
    """Return a comparison's p-value as text, a dash where there are too few pairs."""
    return '–' if comparison.probability is None else p_value_text(comparison.probability)


def nonbreaking_label(evaluation: Evaluation, condition: Help) -> str:
    """Return a condition's label with line breaks allowed only before the model."""
    words = [word.replace(' ', '\u00a0') for word in evaluation.words(condition)]
    return ' '.join(['\u00a0·\u00a0'.join(words[:2]), *words[2:]])
