# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page that refinement writes."""

from __future__ import annotations

import math
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.model.effects.spectrum import highest_frequency, position_spectrum
from friction_comp.refinement.units import in_unit
from friction_comp.reports.figures import COLOURS, new_figure, scatter, styled
from friction_comp.reports.html import number, quantity, Report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.refinement.refine import RefineResult
    from friction_comp.samples import Samples


def refinement_report(result: RefineResult, names: list[str]) -> Report:
    """Return the page on a `RefineResult`.

    Parameters
    ----------
    result : RefineResult
    names : list of str
        Of the recordings.

    Returns
    -------
    Report
    """
    report = result.report
    joint = f"joint {report['joint']}" if report['joint'] else 'the joint'
    page = Report(f'What the friction model of {joint} lacked',
                  f'Refined on {", ".join(names)}')
    before, after, unit = report['before'], report['after'], report['unit']
    first, _, rest = summary(report).partition('\n\n')
    page.verdict(f"**Verdict: {report['verdict']}.** {first}")
    page.numbers([
        (quantity(before['held_out_rmse'], unit), 'error before, on data not fitted'),
        (quantity(after['held_out_rmse'], unit), 'error after, on data not fitted'),
        (quantity(after['elsewhere_motion_rmse'], unit), 'to expect elsewhere, in motion'),
        (quantity(report['noise_floor'], unit), 'noise from sample to sample'),
        (f"{number(100 * max(after['held_out_r2'], 0.0), 4)} %", 'of the current explained')])
    page.text('Why this verdict:\n\n' + verdict_words(report))
    page.text(rest)
    if report['effects']:
        page.table(['effect', 'number', 'value', '95 % interval'], interval_rows(report))
        page.table(
            ['effect', f'RMS with it, held out ({unit})', 'chosen in'],
            [[effect['name'].replace('_', ' '), effect['held_out_rmse'],
              f"{100 * effect['chosen']:.0f} % of the searches"] for effect in report['effects']],
            'The whole search is repeated on parts of the recording drawn at random: an effect is '
            'named where most of these searches choose it.')
    page.heading('Errors')
    page.table(
        ['model', f'RMS, fitted ({unit})', f'RMS, held out ({unit})', f'worst part ({unit})',
         f'at standstill ({unit})', f'with standstill ({unit})', f'elsewhere ({unit})',
         f'largest, held out ({unit})', 'R², held out'],
        [[row['model'], row['fit_rmse'], row['held_out_rmse'], row['worst_part_rmse'],
          row['standstill_rmse'], row['overall_rmse'], row['elsewhere_rmse'],
          row['held_out_max'], row['held_out_r2']]
         for row in (before, after)])
    page.text(f"Held out: {report['held_out']}. Of {report['samples']} samples "
              f"{report['samples_in_motion']} are fitted: those in which the joint moves and the "
              'current signal is not clipped. Where the joint sticks, current is not friction: '
              'the error there is given by itself. Elsewhere: what to expect where the model was '
              'not fitted, by how much errors grow in thirds of position, speed, time and '
              'acceleration that are left out of the fit.')
    page.figure(steps_figure(result), 'Error on data not fitted as effects were added, one at a '
                'time. The dashed line is the noise from sample to sample.')
    page.heading('What is left, before and after')
    spoken = {entry['variable'] for part in ('effects', 'unexplained') for entry in report[part]}
    for name, label in (('velocity', 'velocity (rad/s)'), ('position', 'position (rad)'),
                        ('acceleration', 'acceleration (rad/s²)'), ('load', 'load (N·m)'),
                        ('time', 'time since the start (s)'),
                        ('temperature', 'motor temperature (°C)')):
        wanted = name != 'acceleration' or name in spoken
        if wanted and getattr(result.samples, name) is not None:
            page.figure(residual_figure(result, name, label),
                        f'Residual over {name}: measured minus predicted current of data not '
                        'fitted. The lines are averages over ranges, positive direction and '
                        'negative direction apart.')
    figure = spectrum_figure(result)
    if figure is not None:
        page.figure(figure, 'Spectrum of the residual over position: ripple shows as a peak at '
                    'its number of periods a turn.')
    page.heading('The model')
    page.text(model_words(result.model, unit))
    page.code(formula(result.model, unit))
    if result.model.effects:
        page.text(online_words(result.model))
    page.heading('What the recordings cannot tell')
    page.text(honesty(report))
    return page


def summary(report: dict[str, Any]) -> str:
    """Return the findings for a reader who builds robots, not statistics."""
    before, after = report['before']['held_out_rmse'], report['after']['held_out_rmse']
    unit = report['unit']
    if report['verdict'] == 'record again':
        lines = ['Of these recordings no model of friction can be trusted: see the reasons.']
    elif not report['effects']:
        lines = [f'The model describes the drive as well as these recordings can tell: it misses '
                 f'the measured current by {quantity(before, unit)} RMS, and no further effect '
                 'makes that better on data it was not fitted to.']
    else:
        gain = 100.0 * (1.0 - after / before) if before > 0 else 0.0
        found = '\n'.join(f"- {effect['in_words']}" for effect in report['effects'])
        lines = [f'The model missed the measured current by **{quantity(before, unit)}** RMS. With '
                 f'what was found in the recordings it misses by **{quantity(after, unit)}**, '
                 f'that is {gain:.0f} % less, on stretches it was not fitted to.',
                 'What was found, the largest first:', found]
    if report['unexplained']:
        names = ', '.join(entry['variable'] for entry in report['unexplained'])
        lines.append(f'Something remains that still changes with **{names}** and that none of the '
                     'known effects describes.')
    if report['ambiguous']:
        lines.append('Some findings have a second explanation that fits as well: see the last '
                     'section for the recording that would decide.')
    return '\n\n'.join(lines)


def verdict_words(report: dict[str, Any]) -> str:
    """Return reasons of the verdict, and how to record what would change it."""
    lines = [f'- {line}' for line in report['reasons']]
    if report['record_again']:
        lines += ['', 'What to record:', '']
        lines += [f'- {line}' for line in report['record_again']]
    return '\n'.join(lines)


def interval_rows(report: dict[str, Any]) -> list[list[Any]]:
    """Return a row for every number that was found: effect, name, value, interval."""
    rows = []
    for effect in report['effects']:
        name, bounds = effect['name'].replace('_', ' '), effect['intervals']
        for key, value in effect['parameters'].items():
            # What was not searched has no interval, or one without width.
            if key != 'coefficients' and bounds.get(key) not in (None, [value, value]):
                rows.append([name, key.replace('_', ' '), number(value), between(bounds[key])])
        rows += [[name, f'coefficient {place + 1}', number(value), between(ends)]
                 for place, (value, ends) in enumerate(zip(
                     effect['parameters'].get('coefficients', ()),
                     bounds.get('coefficients', ())))]
    return rows


def between(interval: list[float | None]) -> str:
    """Return an interval in words."""
    low, high = interval
    if low is None or high is None:
        return 'the recordings do not tell'
    return f'{number(low)} to {number(high)}'


@styled
def steps_figure(result: RefineResult) -> Figure:
    """Return the error over the steps of the choice."""
    figure, axes = new_figure(height=2.6)
    labels = [f'+ {name.replace("_", " ")}' if k else name
              for k, (name, _) in enumerate(result.trail)]
    errors = [error for _, error in result.trail]
    axes.plot(range(len(errors)), errors, 'o-', color=COLOURS['blue'])
    axes.axhline(result.report['noise_floor'], color=COLOURS['grey'], linestyle='--')
    axes.set_xticks(range(len(errors)), labels, rotation=20, ha='right')
    axes.set_ylabel(f"RMS error ({result.report['unit']})")
    axes.set_ylim(bottom=0.0)
    return figure


@styled
def residual_figure(result: RefineResult, name: str, label: str) -> Figure:
    """Return the residual over a signal, before beside after."""
    figure, both = new_figure(columns=2, height=2.8, sharey=True)
    rows = result.usable
    x = getattr(result.samples, name)[rows]
    samples: Any = result.samples
    side = samples.velocity[rows] > 0
    # Between two runs nothing was measured, and no line is drawn.
    run = _runs(samples)[rows]
    if name != 'time' or np.any(np.diff(run[np.argsort(x, kind='stable')]) < 0):
        run = np.zeros(len(x), dtype=int)
    for axes, residual, title in zip(both, (result.before, result.after), ('before', 'after')):
        y = residual[rows]
        scatter(axes, x, y, 'grey')
        for mask, colour, words in ((side, 'blue', 'positive'), (~side, 'orange', 'negative')):
            if mask.sum() > 20 and name != 'velocity':
                axes.plot(*averages(x[mask], y[mask], run[mask]), color=COLOURS[colour],
                          label=words)
        if name == 'velocity':
            axes.plot(*averages(x, y, run), color=COLOURS['blue'])
        axes.set_title(title)
        axes.set_xlabel(label)
    limit = float(np.percentile(np.abs(result.before[rows]), 99.5))
    both[0].set_ylim(-1.2 * limit, 1.2 * limit)
    both[0].set_ylabel(f"measured − predicted ({result.report['unit']})")
    if name != 'velocity':
        both[1].legend(loc='upper right')
    return figure


def _runs(samples: Samples) -> np.ndarray:
    """Return the number of the run of each sample, shape (N,): a gap of 0.5 s ends one."""
    run = np.empty(len(samples), dtype=int)
    for place, part in enumerate(samples.segments(max(20.0, 0.5 / samples.sample_time))):
        run[part] = place
    return run


def averages(x: np.ndarray, y: np.ndarray, run: np.ndarray,
             number: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles of ranges with as many samples each, and the averages in them.

    Where no sample lies between two ranges for more than a tenth of the whole, and between two
    runs, there is a NaN, so that no line is drawn across.

    Parameters
    ----------
    x, y : ndarray, shape (N,)
    run : ndarray of int, shape (N,)
        All the same where runs do not follow one another along x.
    number : int
        Of ranges, about.
    """
    order = np.argsort(x, kind='stable')
    pieces = [piece for piece in np.array_split(order, number) if len(piece)]
    wide = 0.1 * float(np.ptp(x))
    middles: list[float] = []
    means: list[float] = []
    last, before = -np.inf, None
    for piece in pieces:
        own = x[piece]
        cuts = np.nonzero((np.diff(own) > wide) | (np.diff(run[piece]) != 0))[0] + 1
        for part in np.split(piece, cuts):
            if middles and (np.min(x[part]) - last > max(wide, 1e-300) or run[part[0]] != before):
                middles.append(np.nan)
                means.append(np.nan)
            middles.append(x[part].mean())
            means.append(y[part].mean())
            last, before = np.max(x[part]), run[part[-1]]
    return np.array(middles), np.array(means)


@styled
def spectrum_figure(result: RefineResult) -> Figure | None:
    """Return the spectrum over position; None where the position hardly varied."""
    rows = result.usable
    samples: Any = result.samples
    highest = highest_frequency(samples.velocity[rows], samples.sample_time,
                                result.scene.resolution)
    figure, axes = new_figure(height=2.8)
    for residual, words, colour in ((result.before, 'before', 'orange'),
                                    (result.after, 'after', 'blue')):
        y = residual[rows]
        k, power = position_spectrum(samples.position[rows], y - y.mean(),
                                     np.ones(int(rows.sum())), highest, periods=0.5)
        if not len(k):
            return None
        k, size = coarse(k, np.sqrt(2.0 * power / rows.sum()))
        axes.plot(k, size, color=COLOURS[colour], label=words)
    axes.set_xscale('log')
    axes.set_xlabel('periods a turn')
    axes.set_ylabel(f"amplitude ({result.report['unit']})")
    axes.set_ylim(bottom=0.0)
    axes.legend()
    return figure


def coarse(k: np.ndarray, size: np.ndarray, number: int = 700) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest values in ranges of equal ratio, so that no peak is lost."""
    place = (np.log(k / k[0]) / max(math.log(k[-1] / k[0]), 1e-12) * number).astype(int)
    first = np.nonzero(np.diff(place, prepend=-1))[0]
    return k[first], np.maximum.reduceat(size, first)


def model_words(model: FrictionModel, unit: str = 'A') -> str:
    """Return the model as a list in words."""
    s = model.sigmoid
    lines = [f'- Friction by Eq. 6: {number(s.upper)} {unit} towards positive and '
             f'{number(s.lower)} {unit} towards negative speed, {number(s.viscous)} {unit} more '
             'per rad/s']
    lines += [f'- {in_unit(effect.describe(), unit)}' for effect in model.effects]
    return '\n'.join(lines)


def formula(model: FrictionModel, unit: str = 'A') -> str:
    """Return the model as a formula with its numbers."""
    s = model.sigmoid
    lines = [f'i(t) = {s.viscous:.4g}·v {s.lower:+.4g} '
             f'{s.upper - s.lower:+.4g}/(1 + exp(-{s.steepness:.4g}·(v - {s.shift:.3g})))']
    lines += [f'       {effect.formula()}' for effect in model.effects]
    lines.append('')
    lines.append(f'i in {unit}, q in rad, v in rad/s, t in s, T in °C, τ_b in N·m')
    return '\n'.join(lines)


def online_words(model: FrictionModel) -> str:
    """Return what the compensator does with the effects."""
    lines = []
    for effect in model.effects:
        reason = effect.why_left_out()
        lines.append(f'- {effect.name}: ' + (
            f'left out by the compensator, since {reason}' if reason else
            'applied by the compensator'))
    return '\n'.join(lines)


def honesty(report: dict[str, Any]) -> str:
    """Return what remains open."""
    lines = [f"- **{entry['variable']}**: {entry['note']} "
             f"({100 * entry['strength']:.0f} % of the remaining variance)."
             for entry in report['unexplained']]
    lines += [f"- **{' or '.join(dict.fromkeys(entry['between']))}**: {entry['why']}. To decide: "
              f"{entry['experiment']}." for entry in report['ambiguous']]
    lines += [f'- {line}' for line in report['warnings']]
    return '\n'.join(lines) or 'Nothing of note.'
