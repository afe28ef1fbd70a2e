# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page of `refine` on one joint: what to do, the numbers, and how well they predict."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_numbers import quantity_in
from friction_comp.number_text import interval_text, number, quantity
from friction_comp.refinement.result import RefinementReport, RefineResult
from friction_comp.reports import refinement_words as words
from friction_comp.reports.figures import curve, legend, panels, scatter, styled, zero
from friction_comp.reports.html import Report, value

# Units of the effects' constants.
_UNITS = {'velocity': 'rad/s', 'reference': 'rad/s', 'speed': 'rad/s', 'transition': 'rad/s',
          'distance': 'rad', 'position': 'rad', 'width': 'rad', 'frequency': 'per turn',
          'time_constant': 's', 'reference_temperature': '°C'}
# Signals over which errors are drawn, with their labels.
_SIGNALS = {'position': 'position (rad)', 'velocity': 'velocity (rad/s)',
            'acceleration': 'acceleration (rad/s²)', 'load': 'load (N·m)', 'time': 'time (s)',
            'temperature': 'motor temperature (°C)'}
# Shortest and longest excerpt over time, s, and the number of reversals that it should contain.
_SHORTEST, _LONGEST, _REVERSALS = 4.0, 60.0, 8
# Number of ranges of a variable in which errors are averaged.
_RANGES = 40


def refinement_page(result: RefineResult, names: Sequence[str], output: Path) -> Report:
    """Return the page; `names` are the recordings, and `output` is the folder of the results."""
    report, linear = result.report, result.model.is_linear
    unit, quantity_ = report.unit, 'force' if linear else quantity_in(report.unit)
    page = Report(f'Friction of {f"joint {report.joint}" if report.joint else "the joint"}',
                  f'{", ".join(names)}: {words.recorded(result)}', linear)
    verdict, why = words.action(report)
    page.verdict(f'**{verdict}**{why}')
    page.numbers([(value(key, text), name) for key, name, text in words.errors(report)])
    page.bullets(report.reasons[1:], 'Also:')
    page.text(f'Cannot be judged: {", ".join(words.not_judged(report))}.')
    for line in report.assumed:
        page.text(f'Read as {line}.')
    page.table(['friction', 'value', '95 % interval'], _number_rows(
        words.friction_rows(report.friction)))
    effects = words.effect_rows(report)
    if effects:
        page.table(['also acting', 'value', '95 % interval'], _number_rows(effects))
    else:
        page.text('No effect beyond the friction curve shows in the recordings.')
    page.code(report.friction.formula)
    page.heading('What next')
    page.table(['', ''], [[f'**{word}**', f'`{how}`' if how.startswith('python3') else how]
                          for word, how in words.next_steps(report, output)])
    page.heading('Measured and predicted')
    page.figure(_time_figure(result, quantity_), f'An excerpt. Dots: measured {quantity_}; line: '
                'predicted, each part by a fit to all others. Below: the difference, in motion.')
    page.figure(_friction_figure(result), f'Friction over velocity. Dots: measured {quantity_} '
                'without the other effects; line: the friction curve. Below: the difference.')
    shown = _shown_signals(result)
    page.figure(_error_figure(result, shown), f'Measured minus predicted {quantity_} over '
                f'{", ".join(shown)}. Dots: this model; lines: averages over ranges, solid in the '
                'positive and dotted in the negative direction; broken: the same of the '
                f'{words.errors(report)[-1][1]}, in the positive direction.')
    page.heading('How sure it is')
    page.table(['error', words.errors(report)[-1][1], 'this model'], _error_rows(report))
    page.text(f'Held out are {report.held_out}. Of {report.samples} rows '
              f'{report.samples_in_motion} are fitted: those in which the joint moves and the '
              f'{quantity_} is at no limit. A joint that sticks is held by whatever acts on it, so '
              'that the error at standstill says little.')
    if report.effects:
        page.table(
            ['effect', 'error with it', 'found in'],
            [[effect.name.replace('_', ' '), quantity(effect.held_out_rmse, unit),
              f'{100 * effect.chosen:.0f} % of the searches'] for effect in report.effects],
            'The search is repeated on parts of the recording drawn at random; an effect is '
            'reported only if most searches find it.')
        rows = list(_constant_rows(report))
        if rows:
            page.table(['effect', 'parameter', 'value', '95 % interval'], rows)
    page.bullets(
        [f'{" and ".join(pair.between)}: {number(pair.correlation, 2)}'
         for pair in report.correlations],
        'The recording determines these pairs together better than each alone (correlation):')
    page.bullets(f'{effect.name.replace("_", " ")}: not applied by the compensator, since {reason}'
                 for effect in result.model.effects if (reason := effect.not_fed_back))
    page.bullets(words.remarks(report), 'Remarks:')
    page.made_by(f'Recordings: {", ".join(names)}')
    return page


def _number_rows(rows: Sequence[words.Row]) -> list[list[str]]:
    return [[f'**{row.name}**' + (f', {row.remark}' if row.remark else ''),
             value(row.key, row.value).replace(' ', '\u00a0'),
             row.interval.replace(' ', '\u00a0')] for row in rows]


def _error_rows(report: RefinementReport) -> list[list[str]]:
    unit, before, after = report.unit, report.before, report.after
    named = {'held_out_rmse': ('while moving, on parts not fitted', 'before', 'error'),
             'elsewhere_motion_rmse': ('in other motion, expected', '', 'elsewhere'),
             'worst_part_rmse': ('in the worst part', '', ''),
             'held_out_max': ('the largest', '', ''),
             'standstill_rmse': ('at standstill', '', ''),
             'fit_rmse': ('where it was fitted', '', '')}
    rows = []
    for name, (label, *keys) in named.items():
        if getattr(after, name) is None:
            continue
        texts = ['' if name == 'elsewhere_motion_rmse' and errors is before
                 else quantity(getattr(errors, name), unit) for errors in (before, after)]
        rows.append([label, *(value(key, text) if key else text for key, text in zip(keys, texts))])
    return [*rows, ['noise from row to row', '', value('noise', quantity(
        report.noise_floor, unit))]]


def _constant_rows(report: RefinementReport) -> Iterator[list[str]]:
    """Yield effect, parameter, value with unit and interval, but for what the first table has."""
    for effect in report.effects:
        if effect.name == 'inertia':
            continue
        name, values, bounds = effect.name.replace('_', ' '), effect.parameters, effect.intervals
        # A constant that was not searched has no interval, or one of zero width.
        for key, constant in values.items():
            if key != 'coefficients' and bounds.get(key) not in (None, [constant, constant]):
                yield [name, key.replace('_', ' '), f'{number(constant)} {_UNITS.get(key, "")}',
                       interval_text(bounds[key])]
        known = EFFECTS[effect.name].coefficient_names if effect.name in EFFECTS else ()
        labels = [*known, *((f'coefficient {k}', '') for k in range(len(known) + 1, 9))]
        coefficients = values.get('coefficients', ())
        if len(coefficients) > 1:
            for (label, own), coefficient, ends in zip(
                    labels, coefficients, bounds.get('coefficients', ())):
                yield [name, label, f'{number(coefficient)} {own.replace("A", report.unit, 1)}',
                       interval_text(ends)]


@styled
def _time_figure(result: RefineResult, quantity_: str) -> Figure:
    samples, unit, part = result.samples, result.report.unit, _excerpt(result)
    time, measured = samples.time[part], samples.current[part]
    error = result.after[part]
    figure, (above, below) = panels(
        [f'{quantity_} ({unit})', f'error ({unit})'], 'time (s)', (2.3, 0.8))
    curve(above, time, measured - error, 'predicted', 'predicted', linewidth=1.2)
    scatter(above, time, measured, label='measured')
    scatter(below, time, np.where(result.usable[part], error, np.nan))
    zero(below)
    legend(above)
    return figure


def _excerpt(result: RefineResult) -> slice:
    """Return a stretch with a few reversals from the middle of the recording."""
    samples: Any = result.samples
    part = max(samples.segments(20.0), key=lambda segment: segment.stop - segment.start)
    time = samples.time[part]
    duration = max(float(np.ptp(time)), 1e-9)
    signs = np.sign(samples.velocity[part][result.usable[part]])
    reversals = max(int(np.count_nonzero(np.diff(signs))), 1)
    length = float(np.clip(_REVERSALS * duration / reversals, _SHORTEST, _LONGEST))
    begin, end = np.searchsorted(time, time[0] + 0.5 * (
        duration + np.array([-1.0, 1.0]) * min(length, duration)))
    return slice(part.start + int(begin), part.start + int(end))


@styled
def _friction_figure(result: RefineResult) -> Figure:
    samples, usable, unit = result.samples, result.usable, result.report.unit
    friction = np.array(samples.current, dtype=float)
    with_arm = result.model.with_arm(samples)
    for effect in result.model.effects:
        friction -= effect.current(with_arm)
    velocity, friction = np.asarray(samples.velocity)[usable], friction[usable]
    speeds = np.linspace(velocity.min(), velocity.max(), 801)
    figure, (above, below) = panels(
        [f'friction ({unit})', f'error ({unit})'], 'velocity (rad/s)', (2.3, 0.8))
    curve(above, speeds, result.model.sigmoid(speeds), 'predicted', 'friction curve', linewidth=1.2)
    scatter(above, velocity, friction, label='measured')
    scatter(below, velocity, friction - result.model.sigmoid(velocity))
    zero(below)
    for axes, values in ((above, friction), (below, friction - result.model.sigmoid(velocity))):
        low, high = np.percentile(values, (0.5, 99.5))
        axes.set_ylim(low - 0.2 * (high - low), high + 0.2 * (high - low))
    legend(above)
    return figure


def _shown_signals(result: RefineResult) -> list[str]:
    """Return the signals over which errors are shown: position, and what effects depend on."""
    report = result.report
    named = {effect.variable for effect in report.effects} | {
        entry.variable for entry in report.unexplained}
    return [name for name in _SIGNALS if getattr(result.samples, name) is not None
            and (name in ('position', 'time') or name in named)]


@styled
def _error_figure(result: RefineResult, shown: Sequence[str]) -> Figure:
    samples, rows, unit = result.samples, result.usable, result.report.unit
    positive = np.asarray(samples.velocity)[rows] > 0
    figure, axes = panels([f'error ({unit})'] * len(shown), [_SIGNALS[name] for name in shown], 1.2)
    limit = float(np.percentile(np.abs(result.after[rows]), 99.5))
    for panel, name in zip(axes, shown):
        x = getattr(samples, name)[rows]
        scatter(panel, x, result.after[rows])
        for residual, colour, mask, style in (
                (result.before, 'before', positive, '--'),
                (result.after, 'predicted', positive, '-'),
                (result.after, 'predicted', ~positive, ':')):
            if mask.sum() > 20:
                curve(panel, *averages(x[mask], residual[rows][mask]), colour, style=style)
        panel.set_ylim(-2.5 * limit, 2.5 * limit)
        zero(panel)
    return figure


def averages(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return means of x and y in about `_RANGES` ranges of equal counts, NaN where x has a gap."""
    order = np.argsort(x, kind='stable')
    x, y = x[order], y[order]
    apart = np.diff(x) > max(0.1 * float(np.ptp(x)), 1e-300)
    ends = np.linspace(0, len(x), _RANGES + 1).astype(int)
    edges = np.union1d(ends, np.nonzero(apart)[0] + 1)
    middles, means = (np.add.reduceat(values, edges[:-1]) / np.diff(edges) for values in (x, y))
    gaps = np.nonzero(apart[edges[1:-1] - 1])[0] + 1
    return np.insert(middles, gaps, np.nan), np.insert(means, gaps, np.nan)
