# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What `refine` says of one joint, on the terminal and on its page: what to do, the numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
import math
from pathlib import Path
import re
import shlex
from typing import Any, NamedTuple

from matplotlib.figure import Figure
import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.friction_numbers import FrictionNumbers, quantity_in
from friction_comp.model.motor_check import check_for_motor
from friction_comp.refinement.result import Finding, FoundEffect, RefinementReport, RefineResult
from friction_comp.reports.figures import (
    curve,
    measured_and_predicted,
    panels,
    scatter,
    styled,
    zero,
)
from friction_comp.reports.html import Report, value
from friction_comp.terminal import aligned, number, quantity

# Name and unit of each number, A standing for the unit of current.
NAMES = {'coulomb': ('Coulomb', 'A'), 'coulomb_with_load': ('… with load', 'A'),
         'viscous': ('viscous', 'A·s/rad'), 'offset': ('offset', 'A'),
         'breakaway': ('breakaway', 'A'),
         'viscous_asymmetry': ('viscous, half of + minus −', 'A·s/rad'),
         'stribeck': ('Stribeck, at standstill', 'A'),
         'stribeck_speed': ('Stribeck speed', 'rad/s'), 'transition': ('transition', 'rad/s'),
         'inertia': ('inertia', 'A·s²/rad')}
# What cannot be judged, by words of the note that says so; `standstill` never can.
_NOT_JUDGED = {'presliding': 'starts and turns', 'No load': 'load',
               'Motor temperature': 'temperature', 'warm up': 'warm-up'}
_SLOW_REVERSALS = '10 slow reversals (a sine of 0.1 Hz) at 500 Hz or more'
# The first number of a sentence with its unit, and the rest.
_SIZE = re.compile(r'(?:([+−-]?\d[\d.e+−-]*) ([^\s,;]+)[,;]? ?)?(.*)', re.DOTALL)
# The note on columns that were chosen by their names, which stands first.
_CHOSEN = re.compile(r'.*?: columns guessed from their names: (.*) \(override.*\)$')
# Signals over which errors are drawn, with their labels.
_SIGNALS = {'position': 'position (rad)', 'velocity': 'velocity (rad/s)',
            'acceleration': 'acceleration (rad/s²)', 'load': 'load (N·m)', 'time': 'time (s)',
            'temperature': 'motor temperature (°C)'}
# Number of ranges of a variable in which errors are averaged.
_RANGES = 40


class Row(NamedTuple):
    """A number of the model as text."""

    key: str
    name: str
    value: str      # with unit
    interval: str   # 95 %; '' where there is none
    remark: str


def friction_rows(friction: FrictionNumbers) -> list[Row]:
    """Return a row for each number of friction, and for the inertia, of those that are known."""
    remarks = {'transition': 'speed over which friction changes sign'}
    if friction.offset is None:
        remarks |= {'coulomb': 'with the offset: the motion was in one direction',
                    'offset': 'not known: the motion was in one direction'}
    keys = ['coulomb', 'viscous', 'offset']
    if friction.coulomb_with_load is not None:
        keys.insert(1, 'coulomb_with_load')
        remarks |= {'coulomb': ', '.join(filter(None, ('without load', remarks.get('coulomb')))),
                    'coulomb_with_load': 'mean in the recorded motion'}
    rows = [_row(friction, key, remarks.get(key, '')) for key in keys]
    known = friction.breakaway
    if known is not None:
        sides = known['positive'], known['negative']
        spread = math.hypot(*(side['std'] for side in sides))
        low, high = (number(side['mean']) for side in sides)
        middle = known['friction']
        rows.append(_row(friction, 'breakaway', f'half of what lies between {low} and {high}',
                         middle, [middle - spread, middle + spread] if spread else None))
    if friction.presliding is not None:
        middle, spread = (1e3 * friction.presliding.get(name, 0.0) for name in ('distance', 'std'))
        rows.append(Row('presliding', 'presliding', *number_texts(middle, [
            max(middle - 2.0 * spread, 0.0), middle + 2.0 * spread] if spread else None, 'mrad'),
            'from rest until the gear slides'))
    rows.append(_row(friction, 'transition', remarks['transition']))
    if friction.inertia is not None:
        rows.append(_row(friction, 'inertia', f'of {friction.inertia_holds}'))
    return rows


def effect_rows(report: RefinementReport) -> list[Row]:
    """Return a row for each effect that was found but the inertia, the largest first."""
    sizes = {one.name: one.size or 0.0 for one in report.friction.beside}
    rows: list[Row] = []
    for effect in sorted(report.effects, key=lambda one: -sizes.get(one.name, math.inf)):
        if effect.name == 'inertia':
            continue
        said = effect.in_words.partition(': ')[2]
        # What follows the first number with its unit is a remark.
        found = _SIZE.match(said)
        amount, unit, remark = found.groups('') if found else ('', '', said)
        texts, ends = (f'{amount} {unit}'.strip(), ''), amplitude_interval(effect)
        if ends and amount:
            texts = number_texts(float(amount.replace('\u2212', '-')), ends, unit)
        rows.append(Row(f'{effect.name} {len(rows)}', _called(effect), *texts, remark))
    return rows


def _called(effect: FoundEffect) -> str:
    name = effect.in_words.partition(': ')[0]
    return name[0].lower() + name[1:]


def amplitude_interval(effect: FoundEffect) -> list[float] | None:
    """Return the 95 % interval of an effect's one coefficient, or of the size of a sine."""
    bounds = effect.intervals.get('coefficients')
    units = set(EFFECTS[effect.name].units) if effect.name in EFFECTS else set()
    if not bounds or len(units) != 1 or len(bounds) > 2 or any(None in ends for ends in bounds):
        return None
    if len(bounds) == 1:
        return list(bounds[0])
    least = [0.0 if low <= 0.0 <= high else min(abs(low), abs(high)) for low, high in bounds]
    return [math.hypot(*least), math.hypot(*(max(abs(low), abs(high)) for low, high in bounds))]


def _row(friction: FrictionNumbers, key: str, remark: str, found: float | None = None,
         ends: list[float] | None = None) -> Row:
    """Return the row of a number; its unit is that of `NAMES`, with `friction.unit` for A.

    Its remark begins with what a current gives at the joint, where that is known.
    """
    (name, unit), own, gain = NAMES[key], friction.unit, friction.torque_per_current
    if found is None:
        found, ends = getattr(friction, key), friction.intervals.get(key)
    if found is None:
        return Row(key, name, '–', '', remark)
    torque = 'kg·m²' if key == 'inertia' else unit.replace('A', 'N·m', 1)
    # A force in N is that of a linear axis, whose N·m are N.
    is_torque = own in ('N·m', 'N')
    if gain and not is_torque and 'A' in unit:
        remark = ', '.join(filter(None, (f'{number(gain * found)} {torque}', remark)))
    return Row(key, name, *number_texts(
        found, ends, torque if is_torque else unit.replace('A', own, 1)), remark)


def number_texts(found: float, ends: Sequence[float] | None, unit: str) -> tuple[str, str]:
    """Return a value with its unit, and its interval, with as many digits as that justifies."""
    if ends is None:
        return f'{number(found)} {unit}', ''
    half = 0.5 * (ends[1] - ends[0])
    # A second digit of the interval's half only where the first is small.
    wanted = -math.floor(math.log10(half / 3.0)) if half > 0.0 else 3
    # No more than four digits, also where there is no noise.
    most = 3 - math.floor(math.log10(max(abs(found), half, 1e-9)))
    places = max(min(wanted, most), 0)
    low, middle, high = (f'{one:.{places}f}'.replace('-', '\u2212')
                         for one in (ends[0], found, ends[1]))
    return f'{middle} {unit}', f'{low} to {high}'


def recorded(result: RefineResult) -> str:
    """Return how long was recorded, and in how many rows."""
    samples = result.samples
    seconds = sum(samples.time[part][-1] - samples.time[part][0] for part in samples.segments())
    return f'{seconds:.3g} s, {len(samples)} rows'


def reading(report: RefinementReport) -> list[str]:
    """Return how the columns of tables were read."""
    chosen = [found[1] for line in report.warnings if (found := _CHOSEN.match(line))]
    return [*(f'columns {one}' for one in chosen), *(f'read as {one}' for one in report.assumed)]


def action(report: RefinementReport) -> tuple[str, str]:
    """Return the verdict as what to do, and why."""
    word = report.verdict[0].upper() + report.verdict[1:]
    return word, (' this model for motions like the recorded one.' if report.verdict == 'trust'
                  else f': {report.reasons[0]}')


def errors(report: RefinementReport) -> list[tuple[str, str, str]]:
    """Return key, name and text of the errors that matter most."""
    unit, before, after = report.unit, report.before, report.after
    alone = 'friction curve alone' if 'sigmoid' in before.model else 'the given model'
    found = [('error', 'error while moving', quantity(after.held_out_rmse, unit)),
             ('noise', 'noise', quantity(report.noise_floor, unit)),
             ('before', alone, quantity(before.held_out_rmse, unit))]
    if after.elsewhere_motion_rmse > 1.2 * after.held_out_rmse:
        found.insert(1, ('elsewhere', 'in other motion', quantity(
            after.elsewhere_motion_rmse, unit)))
    return found


def not_judged(report: RefinementReport) -> list[str]:
    """Return what the recording does not let anybody judge, in a word each."""
    return ['standstill', *dict.fromkeys(filter(None, map(_not_judged, report.findings)))]


def _not_judged(finding: Finding) -> str:
    return next((said for words, said in _NOT_JUDGED.items()
                 if finding.code == 'not_known' and words in finding.text), '')


def remarks(report: RefinementReport) -> list[str]:
    """Return what else to know: neither a reason of the verdict nor in `not_judged`."""
    said = {finding.text for finding in report.findings if _not_judged(finding)} | {
        line for line in report.warnings if _CHOSEN.match(line)}
    return [
        *(f'the error still depends on {entry.variable}: {entry.note} '
          f'({100 * entry.strength:.0f} % of the rest)' for entry in report.unexplained
          if not any(entry.note in reason for reason in report.reasons)),
        *(line for line in report.warnings if line not in said)]


def next_steps(model: FrictionModel, verdict: str, record: Sequence[str], missing: Sequence[str],
               output: Path) -> list[tuple[str, str]]:
    """Return what to do next with the files in the folder `output`: a word, and how.

    `record` is what to record, and `missing` what a compensator would need to know in addition.
    """
    file = shlex.quote(str(output / 'model.yaml'))
    run, refused = 'python3 -m friction_comp', refusal(model)
    steps = [('record', line) for line in record]
    if verdict != 'record again':
        steps += [('simulate', f'{run} export {file} --to mujoco --output joint.xml' if model.gain
                   else 'first refine with --torque-constant and --gear-ratio, or a torque'),
                  ('feed ahead', f'{run} predict PLAN.csv --model {file} --output torque.csv'),
                  ('compensate', f'not with this file: {refused}' if refused else
                   f'first find {" and ".join(missing)}: record {_SLOW_REVERSALS}'
                   if missing else f'give the compensator the model: model_files [{file}]')]
    return steps


def refusal(model: FrictionModel) -> str:
    """Return why the compensator would refuse a model, '' if it would not."""
    try:
        check_for_motor(model, model.joint)
    except InputError as error:
        return str(error)
    return ''


def _next_steps(result: RefineResult, output: Path) -> list[tuple[str, str]]:
    report = result.report
    return next_steps(result.model, report.verdict, report.record_again,
                      [name for name in ('breakaway', 'presliding')
                       if getattr(report.friction, name) is None], output)


def step_lines(steps: Sequence[tuple[str, str]]) -> list[str]:
    """Return steps as lines for a terminal."""
    return ['next', *(f'  {word:<12}{how}' for word, how in steps)]


def add_steps(page: Report, steps: Sequence[tuple[str, str]]) -> None:
    """Add what to do next to a page."""
    page.heading('What next')
    page.table(['', ''], [[f'**{word}**', f'`{how}`' if how.startswith('python3') else how]
                          for word, how in steps])


def effect_names(names: Iterable[str]) -> str:
    """Return the names of effects as text with their counts, or 'nothing'."""
    counts = Counter(name.replace('_', ' ') for name in names)
    return ', '.join(f'{name} × {times}' if times > 1 else name
                     for name, times in counts.items()) or 'nothing'


def table_lines(rows: Sequence[Row]) -> list[str]:
    """Return rows as aligned lines for a terminal."""
    return aligned([row[1:] for row in rows], '  ')


def terminal_lines(result: RefineResult, names: Sequence[str], output: Path) -> list[str]:
    """Return what `refine` prints: how the recordings were read, what to do, numbers, what next."""
    report = result.report
    head = '; '.join([f'{", ".join(names)}: {recorded(result)}', *reading(report)])
    return [head, '', *summary_lines(report), '', *step_lines([
        ('look', str(output / 'report.html')), *_next_steps(result, output)])]


def summary_lines(report: RefinementReport) -> list[str]:
    """Return what was found in the recordings of a joint: verdict, errors, numbers."""
    first, *others = errors(report)
    verdict, why = action(report)
    lines = [verdict.upper() + why, *(f'  {line}' for line in report.reasons[1:])]
    lines += [f'  {first[1]:<19}{first[2]}; ' + ', '.join(
        f'{name} {text}' for _, name, text in others),
        f'  {"cannot be judged":<19}{", ".join(not_judged(report))}']
    numbers, effects = friction_rows(report.friction), effect_rows(report)
    table = table_lines([Row('', 'friction', 'value', '95 % interval', ''), *numbers, *effects])
    lines += ['', *table[:1 + len(numbers)], *(['also acting'] if effects else []),
              *table[1 + len(numbers):], f'  {report.friction.formula}']
    if not report.effects:
        lines.append('  no effect beyond the friction curve shows in the recordings')
    return lines + [f'note: {line}' for line in remarks(report)]


def refinement_page(result: RefineResult, names: Sequence[str], output: Path) -> Report:
    """Return the page; `names` are the recordings, and `output` is the folder of the results."""
    report, linear = result.report, result.model.is_linear
    unit, quantity_ = report.unit, 'force' if linear else quantity_in(report.unit)
    page = Report(f'Friction of {f"joint {report.joint}" if report.joint else "the joint"}',
                  f'{", ".join(names)}: {recorded(result)}', linear)
    verdict, why = action(report)
    page.verdict(f'**{verdict}**{why}')
    page.numbers([(value(key, text), name) for key, name, text in errors(report)])
    page.bullets(report.reasons[1:], 'Also:')
    page.text(f'Cannot be judged: {", ".join(not_judged(report))}.')
    page.text('; '.join(reading(report)))
    page.table(['friction', 'value', '95 % interval'], number_rows(
        friction_rows(report.friction)))
    effects = effect_rows(report)
    if effects:
        page.table(['also acting', 'value', '95 % interval'], number_rows(effects))
    else:
        page.text('No effect beyond the friction curve shows in the recordings.')
    page.code(report.friction.formula)
    add_steps(page, _next_steps(result, output))
    page.heading('Measured and predicted')
    page.figure(_time_figure(result, quantity_), f'An excerpt. Dots: measured {quantity_}; line: '
                'predicted, each regime of motion by a fit to all others. Below: the difference.')
    page.figure(_friction_figure(result), f'Friction over velocity. Dots: measured {quantity_} '
                'without the other effects; line: the friction curve. Below: the difference.')
    shown = _shown_signals(result)
    page.figure(_error_figure(result, shown), f'Measured minus predicted {quantity_} over '
                f'{", ".join(shown)}, with averages over ranges: solid in the positive, dotted in '
                'the negative direction. What the model lacks would show as a slope or wave.')
    page.heading('How sure it is')
    page.table(['error', errors(report)[-1][1], 'this model'], [
        [label, *(quantity(getattr(one, name), unit) for one in (report.before, report.after))]
        for name, label in (('held_out_rmse', 'while moving, in regimes not fitted'),
                            ('worst_part_rmse', 'in the worst regime'),
                            ('standstill_rmse', 'at standstill'),
                            ('fit_rmse', 'where it was fitted'))
        if getattr(report.after, name) is not None])
    page.text(f'Held out are {report.held_out}. Of {report.samples} rows '
              f'{report.samples_in_motion} are fitted: those in which the joint moves and the '
              f'{quantity_} is at no limit. A joint that sticks is held by whatever acts on it, so '
              'that the error at standstill says little.')
    if report.effects:
        page.table(
            ['effect', 'error with it', 'helps in'],
            [[_called(effect), quantity(effect.held_out_rmse, unit),
              f'{100 * effect.chosen:.0f} % of the regimes'] for effect in report.effects],
            'Each regime of motion is predicted by a fit to all others: the share of those that '
            'are predicted better with the effect.')
    page.bullets(f'{effect.name}: not applied by the compensator, since {reason}'
                 for effect in result.model.effects if (reason := effect.not_fed_back))
    page.bullets(remarks(report), 'Remarks:')
    page.made_by(f'Recordings: {", ".join(names)}')
    return page


def number_rows(rows: Sequence[Row]) -> list[list[str]]:
    """Return rows of a table of a page."""
    return [[f'**{row.name}**' + (f', {row.remark}' if row.remark else ''),
             value(row.key, row.value), row.interval] for row in rows]


@styled
def _time_figure(result: RefineResult, quantity_: str) -> Figure:
    samples, unit, part = result.samples, result.report.unit, _excerpt(result)
    time, measured, error = samples.time[part], samples.current[part], result.after[part]
    return measured_and_predicted(
        (f'{quantity_} ({unit})', f'error ({unit})'), 'time (s)', (time, measured - error),
        'predicted', (time, measured), np.where(result.usable[part], error, np.nan))[0]


def _excerpt(result: RefineResult) -> slice:
    """Return a stretch with eight reversals, 4 to 60 s, from the middle of the recording."""
    samples: Any = result.samples
    part = max(samples.segments(), key=lambda segment: segment.stop - segment.start)
    time = samples.time[part]
    duration = max(float(np.ptp(time)), 1e-9)
    signs = np.sign(samples.velocity[part][result.usable[part]])
    reversals = max(int(np.count_nonzero(np.diff(signs))), 1)
    length = float(np.clip(8 * duration / reversals, 4.0, 60.0))
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
    speeds, sigmoid = np.linspace(velocity.min(), velocity.max(), 801), result.model.sigmoid
    error = friction - sigmoid(velocity)
    figure, axes = measured_and_predicted(
        (f'friction ({unit})', f'error ({unit})'), 'velocity (rad/s)', (speeds, sigmoid(speeds)),
        'friction curve', (velocity, friction), error)
    for panel, values in zip(axes, (friction, error)):
        panel.set_ylim(*_without_outliers(values))
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
    error = result.after[rows]
    for panel, name in zip(axes, shown):
        x = getattr(samples, name)[rows]
        scatter(panel, x, error)
        for mask, style in ((positive, '-'), (~positive, ':')):
            if mask.sum() > 20:
                curve(panel, *averages(x[mask], error[mask]), 'predicted', style=style)
        panel.set_xlim(*_without_outliers(x, 0.05))
        panel.set_ylim(*_without_outliers(error))
        zero(panel)
    return figure


def _without_outliers(values: np.ndarray, margin: float = 0.2) -> tuple[float, float]:
    low, high = np.percentile(values, (0.5, 99.5))
    return low - margin * (high - low), high + margin * (high - low)


def averages(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle of ranges of x, and the mean of y in each, NaN where it has too few."""
    count, edges = np.histogram(x, _RANGES)
    total, _ = np.histogram(x, _RANGES, weights=y)
    means = np.divide(total, count, out=np.full(_RANGES, np.nan), where=count >= 5)
    return 0.5 * (edges[1:] + edges[:-1]), means
