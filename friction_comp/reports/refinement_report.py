# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The report of `refine` on one joint."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import count

import numpy as np

from friction_comp.compensation.feed_forward import feed_forward
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.friction_numbers import FrictionNumbers, quantity_in
from friction_comp.model.measured import LINE
from friction_comp.number_text import interval_text, number, quantity
from friction_comp.refinement.findings import in_unit
from friction_comp.refinement.result import RefinementReport, RefineResult
from friction_comp.refinement.thresholds import LEAST_SHARE
from friction_comp.reports import refinement_figures as figures
from friction_comp.reports.friction_words import number_rows
from friction_comp.reports.html import Report

# Units of the effects' constants.
_UNITS = {'velocity': 'rad/s', 'reference': 'rad/s', 'speed': 'rad/s', 'transition': 'rad/s',
          'distance': 'rad', 'position': 'rad', 'width': 'rad', 'frequency': 'per turn',
          'time_constant': 's', 'reference_temperature': '°C'}


def refinement_report(result: RefineResult, names: list[str]) -> Report:
    """Return the report on a `RefineResult`; `names` are the names of the recordings."""
    report = result.report
    joint = f'joint {report.joint}' if report.joint else 'the joint'
    page = Report(f'What the friction model of {joint} lacked',
                  f'Refined on {", ".join(names)}', result.model.is_linear)
    before, after, unit = report.before, report.after, report.unit
    first, _, rest = summary(report).partition('\n\n')
    page.verdict(f'**Verdict: {report.verdict}.** {first}')
    _add_numbers(page, report.friction)
    for line in report.assumed:
        page.text(f'Taken for granted: {line}.')
    page.numbers([
        (quantity(before.held_out_rmse, unit), 'error before, on data not fitted'),
        (quantity(after.held_out_rmse, unit), 'error after, on data not fitted'),
        (quantity(after.elsewhere_motion_rmse, unit), 'error to expect in other movements'),
        (quantity(report.noise_floor, unit), 'noise from sample to sample'),
        (f'{number(100 * max(after.held_out_r2, 0.0), 4)} %',
         f'of the {quantity_in(unit)} explained')])
    page.bullets(report.reasons, 'Why this verdict:')
    page.bullets(report.record_again, 'What to record:')
    page.text(rest)
    page.figure(figures.time_figure(result), 'Measured and predicted current in an excerpt from '
                'the middle of the recording; each part was predicted by a fit to all others. '
                'Below: the contribution of each effect of the new model.')
    page.figure(figures.friction_figure(result), 'Friction over velocity: the measured current '
                'minus the effects, and Eq. 6 before and after.')
    page.heading('Parameters')
    page.table(['effect', 'parameter', 'before', 'after', 'unit', '95 % interval'],
               _parameter_rows(result))
    page.bullets(
        [f"{' and '.join(pair.between)}: {number(pair.correlation, 2)}"
         for pair in report.correlations],
        'Of these pairs of parameters, the recording determines the sum or the difference better '
        'than each alone (correlation over parts drawn at random):')
    if report.effects:
        page.table(
            ['effect', f'held-out RMS error with it ({unit})', 'chosen in'],
            [[effect.name.replace('_', ' '), effect.held_out_rmse,
              f'{100 * effect.chosen:.0f} % of the searches'] for effect in report.effects],
            'The whole search is repeated on parts of the recording drawn at random. An effect is '
            'reported only if most of these searches choose it.')
    page.heading('Errors')
    page.table(
        ['model', f'RMS, fitted ({unit})', f'RMS, held out ({unit})', f'worst part ({unit})',
         f'at standstill ({unit})', f'with standstill ({unit})', f'elsewhere ({unit})',
         f'largest, held out ({unit})', 'R², held out'],
        [[row.model.replace('_', ' '), *(getattr(row, key) for key in (
            'fit_rmse', 'held_out_rmse', 'worst_part_rmse', 'standstill_rmse', 'overall_rmse',
            'elsewhere_rmse', 'held_out_max', 'held_out_r2'))] for row in (before, after)])
    page.text(f'Held out: {report.held_out}. Of {report.samples} samples '
              f'{report.samples_in_motion} are fitted: those in which the joint moves and the '
              'current signal is not clipped. While the joint sticks, the current does not show '
              'the friction of the model, so the error at standstill is given separately. '
              'Elsewhere: the error to expect where the model was not fitted, from the growth of '
              'errors when a third of position, speed, time or acceleration is left out of the '
              'fit.')
    page.heading('The residual, before and after')
    page.text('The residual is the measured minus the predicted current of data not fitted. The '
              'lines are its averages over ranges.')
    named = {effect.variable for effect in report.effects} | {
        entry.variable for entry in report.unexplained}
    for name, label in (('velocity', 'velocity (rad/s)'), ('position', 'position (rad)'),
                        ('acceleration', 'acceleration (rad/s²)'), ('load', 'load (N·m)'),
                        ('time', 'time since the start (s)'),
                        ('temperature', 'motor temperature (°C)')):
        wanted = name != 'acceleration' or name in named
        if wanted and getattr(result.samples, name) is not None:
            page.figure(figures.residual_figure(result, name, label), f'Residual over {name}.')
    k, size = figures.spectrum(result, result.after)
    # Where the position hardly varied, there is none.
    if len(k):
        page.figure(figures.spectrum_figure(result), 'Spectrum of the residual over position: '
                    'ripple shows as a peak at its number of periods per turn. '
                    + _largest_ripple(result, k, size))
    _add_feed_forward(page, result, unit)
    page.heading('The model')
    page.bullets(model_words(result.model, unit))
    page.code(formula(result.model, unit))
    # The compensator cannot apply every effect.
    page.bullets(f'{effect.name}: ' + (
        f'not applied by the compensator, since {reason}' if (reason := effect.not_fed_back)
        else 'applied by the compensator') for effect in result.model.effects)
    page.heading('What the recordings cannot tell')
    page.bullets(limitations(report))
    page.made_by(f'Recordings: {", ".join(names)}')
    return page


def _add_numbers(page: Report, friction: FrictionNumbers) -> None:
    rows = number_rows(friction)
    torque = any(row.torque for row in rows)
    page.table(
        ['', 'value', '95 % interval', *(['at the joint'] if torque else []), ''],
        [[cell.replace(' ', '\u00a0') for cell in (
            f'**{row.name}**', row.value, row.interval, *([row.torque] if torque else []))]
         + [row.remark] for row in rows],
        'Friction of the joint in sliding. Coulomb and viscous friction are the straight line '
        'through the friction at the speeds of the recording.')
    page.text(f'`{friction.formula}`')


def _add_feed_forward(page: Report, result: RefineResult, unit: str) -> None:
    """Add a table of the currents that the law feeds forward with both models."""
    feeds = {'before': feed_forward(result.start), 'after': feed_forward(result.model)}
    page.heading('What the compensator feeds forward')
    page.table(
        ['model', f'at rest, both directions ({unit})', f'sliding ({unit})',
         f'friction by the model, sliding ({unit})'],
        [[name, *(' and '.join(f'{value:.3g}' for value in values) for values in (
            feed.rest, feed.sliding, feed.friction))] for name, feed in feeds.items()],
        f"The continuous law is run on each model, without gravity and other carried torques: at "
        'rest with the direction announced, and sliding at '
        f"{feeds['after'].speed:.3g} rad/s. At rest it needs the breakaway currents of "
        'identification.')
    page.bullets(feeds['after'].compared(feeds['before']),
                 'With the new model the motor gets clearly more or less than before:')
    page.bullets(feeds['after'].lacking(result.model),
                 'The law feeds forward clearly more or less than the new model says:')


def effect_names(names: Iterable[str]) -> str:
    """Return the names of effects as text with their counts, or 'nothing'."""
    counts = Counter(name.replace('_', ' ') for name in names)
    return ', '.join(f'{name} × {times}' if times > 1 else name
                     for name, times in counts.items()) or 'nothing'


def summary(report: RefinementReport) -> str:
    """Return a summary of the report as paragraphs."""
    before, after = report.before.held_out_rmse, report.after.held_out_rmse
    unit = report.unit
    if report.verdict == 'record again':
        lines = ['No friction model of these recordings can be trusted: see the reasons.']
    elif not report.effects:
        lines = ['The model describes the drive as well as these recordings can tell: its error is '
                 f'{quantity(before, unit)} RMS, and no further effect lowers it on data that were '
                 'not fitted.']
    else:
        gain = 100.0 * (1.0 - after / before) if before > 0 else 0.0
        effects = ''.join(f'- {effect.in_words}\n' for effect in report.effects)
        lines = [f'The error of the model was **{quantity(before, unit)}** RMS. With the effects '
                 f'found in the recordings it is **{quantity(after, unit)}**, {gain:.0f} % less, '
                 'on data that were not fitted.',
                 'What was found, the largest first:', effects]
    if report.unexplained:
        names = ', '.join(entry.variable for entry in report.unexplained)
        lines.append(f'The remaining error depends on **{names}** in a way that none of the known '
                     'effects describes.')
    if report.ambiguous:
        lines.append('Some findings have a second explanation that fits equally well; the last '
                     'section says which recording would decide between them.')
    return '\n\n'.join(lines)


def _parameter_rows(result: RefineResult) -> list[list[str]]:
    """Return a row for each fitted parameter: effect, name, before, after, unit, interval."""
    unit, friction = result.report.unit, result.report.friction
    before, after = (dict(zip(LINE, model.sigmoid.line)) for model in (result.start, result.model))
    # The numbers of sliding friction may contain effects: then Eq. 6 has no interval of its own.
    rows = [['Eq. 6', name, number(before[key]), number(after[key]),
             own_unit.replace('A', unit, 1), 'unchanged' if before[key] == after[key] else
             interval_text(friction.intervals[key]) if key in friction.intervals
             and getattr(friction, key) == after[key] else '']
            for key, name, own_unit in (
                ('offset', 'offset', 'A'), ('coulomb', 'Coulomb friction', 'A'),
                ('viscous', 'viscous friction', 'A·s/rad'))]
    for old, new in zip(result.start.effects, result.model.effects):
        if old.name == new.name:
            rows += [[new.name, label, *map(number, pair), own_unit, '']
                     for (label, own_unit), *pair in zip(
                         _names_and_units(new.coefficient_names, unit), old.coefficients,
                         new.coefficients)]
    for effect in result.report.effects:
        name, values, bounds = effect.name, effect.parameters, effect.intervals
        names = EFFECTS[name].coefficient_names if name in EFFECTS else ()
        # A constant that was not searched has no interval, or one of zero width.
        rows += [[name, key.replace('_', ' '), '', number(value), _UNITS.get(key, ''),
                  interval_text(bounds[key])] for key, value in values.items()
                 if key != 'coefficients' and bounds.get(key) not in (None, [value, value])]
        rows += [[name, label, '', number(value), own_unit, interval_text(ends)]
                 for (label, own_unit), value, ends in zip(
                     _names_and_units(names, unit), values.get('coefficients', ()),
                     bounds.get('coefficients', ()))]
    return [[row[0].replace('_', ' '), *row[1:]] for row in rows]


def _names_and_units(names: Sequence[tuple[str, str]], unit: str) -> Iterator[tuple[str, str]]:
    """Yield names and units of an effect's coefficients, with `unit` for that of the current."""
    for name, own_unit in names:
        yield name, own_unit.replace('A', unit, 1)
    for index in count(len(names) + 1):
        yield f'coefficient {index}', ''


def _largest_ripple(result: RefineResult, k: np.ndarray, size: np.ndarray) -> str:
    """Return a sentence on the largest ripple of the residual's spectrum: no effect, and why."""
    mean_square = float(np.mean(result.after[result.usable] ** 2))
    if not mean_square:
        return ''
    largest = int(np.argmax(size))
    share = 0.5 * size[largest] ** 2 / mean_square
    reason = (f'an effect must remove at least {100 * LEAST_SHARE:.0f} %' if share < LEAST_SHARE
              else 'parts of the recording did not agree on it')
    amplitude = quantity(float(size[largest]), result.report.unit)
    return (f'The largest remaining ripple has an amplitude of {amplitude} and '
            f'{number(float(k[largest]))} periods per turn: {100 * share:.2g} % of the squared '
            f'error. It is not reported as an effect: {reason}.')


def model_words(model: FrictionModel, unit: str = 'A') -> list[str]:
    """Return a line of text on each part of the model."""
    s = model.sigmoid
    return [f'Friction curve (Eq. 6): {number(s.upper)} {unit} at positive and {number(s.lower)} '
            f'{unit} at negative velocity, and {number(s.viscous)} {unit} per rad/s',
            *(in_unit(effect.describe(), unit) for effect in model.effects)]


def formula(model: FrictionModel, unit: str = 'A') -> str:
    """Return the model as a formula with the values of its parameters."""
    s = model.sigmoid
    return '\n'.join([
        f'i(t) = {s.viscous:.4g}·v {s.lower:+.4g} '
        f'{s.upper - s.lower:+.4g}/(1 + exp(-{s.steepness:.4g}·(v - {s.shift:.3g})))',
        *(f'       {effect.formula()}' for effect in model.effects), '',
        f'i in {unit}, q in rad, v in rad/s, t in s, T in °C, τ_b in N·m'])


def limitations(report: RefinementReport) -> list[str]:
    """Return lines on what the recordings cannot determine."""
    return [
        *(f'**{entry.variable}**: {entry.note} '
          f'({100 * entry.strength:.0f} % of the remaining variance).'
          for entry in report.unexplained),
        *(f'**{question.variables}**: {question.why}. To decide: '
          f'{question.experiment}.' for question in report.ambiguous),
        *report.warnings] or ['Nothing of note.']
