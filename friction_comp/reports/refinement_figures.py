# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The figures of the refinement page, as drawings and as interactive plots."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np

from friction_comp.model.effects.spectrum import highest_frequency, position_spectrum
from friction_comp.reports.figures import COLOURS, new_figure, scatter, styled
from friction_comp.reports.interactive import Line, Panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from friction_comp.refinement.refine import RefineResult
    from friction_comp.samples import Samples

Rows = Sequence[Sequence[Panel]]
# Shortest and longest time that is drawn, s, and the number of reversals in it.
_SHORTEST, _LONGEST, _REVERSALS = 4.0, 60.0, 8
# Colours of the parts of a model, Eq. 6 first.
_PARTS = ('violet', 'green', 'pink', 'red', 'yellow', 'orange', 'blue', 'grey')
_DOTS = 1500


class DrawnFigure(NamedTuple):
    """A drawing and its curves for the interactive plot."""

    figure: Figure
    live: Rows


def excerpt(result: RefineResult) -> slice:
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
def time_figure(result: RefineResult) -> DrawnFigure:
    """Draw measured and predicted current over time, and the part of each effect."""
    samples, unit = result.samples, result.report['unit']
    part = excerpt(result)
    time, measured = samples.time[part], samples.current[part]
    curves = [('measured', 'grey', measured),
              ('before', 'orange', measured - result.before[part]),
              ('after', 'blue', measured - result.after[part])]
    model, parts = result.model, []
    with_arm = model.with_arm(samples)
    parts.append(('Eq. 6', np.asarray(model.sigmoid(np.asarray(samples.velocity)))[part]))
    for effect in model.effects:
        current = effect.current(with_arm)[part]
        name = effect.name.replace('_', ' ')
        same = [k for k, (other, _) in enumerate(parts) if other == name]
        if same:
            parts[same[0]] = (name, parts[same[0]][1] + current)
        else:
            parts.append((name, current))
    figure, (above, below) = new_figure(rows=2, height=2.4, sharex=True)
    for name, colour, values in curves:
        above.plot(time, values, color=COLOURS[colour], label=name, linewidth=1.1)
    colours = [_PARTS[k % len(_PARTS)] for k in range(len(parts))]
    for (name, values), colour in zip(parts, colours):
        below.plot(time, values, color=COLOURS[colour], label=name, linewidth=1.1)
    for axes, label in ((above, f'current ({unit})'), (below, f'part of it ({unit})')):
        axes.set_ylabel(label)
        axes.legend(loc='upper left', bbox_to_anchor=(1.0, 1.0))
    below.set_xlabel('time (s)')
    x = 'time (s)'
    return DrawnFigure(figure, [
        [Panel(x, f'current ({unit})', [
            Line(name, time, values, colour) for name, colour, values in curves])],
        [Panel(x, f'part of it ({unit})', [
            Line(name, time, values, colour)
            for (name, values), colour in zip(parts, colours)])]])


@styled
def friction_figure(result: RefineResult) -> DrawnFigure:
    """Draw friction over velocity: measured without the effects, and Eq. 6 before and after."""
    samples, unit = result.samples, result.report['unit']
    velocity = np.asarray(samples.velocity)
    friction = np.array(samples.current, dtype=float)
    with_arm = result.model.with_arm(samples)
    for effect in result.model.effects:
        friction -= effect.current(with_arm)
    v, y = _subsample(velocity[result.usable], friction[result.usable])
    speeds = np.linspace(velocity[result.usable].min(), velocity[result.usable].max(), 801)
    lines = [('before', 'orange', result.start.sigmoid(speeds)),
             ('after', 'blue', result.model.sigmoid(speeds))]
    figure, axes = new_figure(height=3.0)
    scatter(axes, v, y, 'grey')
    for name, colour, values in lines:
        axes.plot(speeds, values, color=COLOURS[colour], label=name)
    low, high = np.percentile(y, (0.5, 99.5))
    axes.set_ylim(low - 0.2 * (high - low), high + 0.2 * (high - low))
    axes.set_xlabel('velocity (rad/s)')
    axes.set_ylabel(f'friction ({unit})')
    axes.legend()
    return DrawnFigure(figure, [[Panel('velocity (rad/s)', f'friction ({unit})', [
        Line('measured minus effects', v, y, 'grey', style='dots'),
        *(Line(name, speeds, np.asarray(values), colour) for name, colour, values in lines)])]])


@styled
def parts_figure(result: RefineResult) -> DrawnFigure:
    """Draw the error of each held-out part, and of standstill."""
    report = result.report
    unit = report['unit']
    figure, axes = new_figure(height=2.6)
    lines = []
    for side, colour, shift in (('before', 'orange', -0.2), ('after', 'blue', 0.2)):
        errors = np.array(report[side]['part_rmse'], dtype=float)
        part = np.arange(1, len(errors) + 1)
        axes.bar(part + shift, errors, 0.38, color=COLOURS[colour], label=side)
        lines.append(Line(side, part, errors, colour))
        still = report[side]['standstill_rmse']
        if still is not None:
            axes.bar(len(errors) + 2 + shift, still, 0.38, color=COLOURS[colour])
            lines.append(Line(f'{side}, at standstill', np.array([len(errors) + 1.7, len(
                errors) + 2.3]), np.array([still, still]), colour, style='dashed'))
    count = len(report['after']['part_rmse'])
    ticks, words = [*range(1, count + 1)], [str(k) for k in range(1, count + 1)]
    if report['after']['standstill_rmse'] is not None:
        ticks, words = [*ticks, count + 2], [*words, 'standstill']
    axes.set_xticks(ticks, words)
    axes.set_xlabel('part of the recording')
    axes.set_ylabel(f'RMS error ({unit})')
    axes.legend()
    return DrawnFigure(figure, [[Panel('part of the recording', f'RMS error ({unit})', lines)]])


def _subsample(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    step = max(1, len(x) // _DOTS)
    return x[::step], y[::step]


@styled
def steps_figure(result: RefineResult) -> Figure:
    """Draw the error as effects are added."""
    figure, axes = new_figure(height=2.6)
    effects = result.report['effects']
    labels = ['before', *(f'+ {effect["name"].replace("_", " ")}' for effect in effects)]
    errors = [step['held_out_rmse'] for step in (result.report['before'], *effects)]
    axes.plot(range(len(errors)), errors, 'o-', color=COLOURS['blue'])
    axes.axhline(result.report['noise_floor'], color=COLOURS['grey'], linestyle='--')
    axes.set_xticks(range(len(errors)), labels, rotation=20, ha='right')
    axes.set_ylabel(f"RMS error ({result.report['unit']})")
    axes.set_ylim(bottom=0.0)
    return figure


@styled
def residual_figure(result: RefineResult, name: str, label: str) -> DrawnFigure:
    """Draw the residual over a signal, before and after side by side."""
    figure, both = new_figure(columns=2, height=2.8, sharey=True)
    rows = result.usable
    x = getattr(result.samples, name)[rows]
    samples: Any = result.samples
    side = samples.velocity[rows] > 0
    # No line is drawn across gaps.
    run = _runs(samples)[rows]
    if name != 'time' or np.any(np.diff(run[np.argsort(x, kind='stable')]) < 0):
        run = np.zeros(len(x), dtype=int)
    unit = result.report['unit']
    panels = []
    for axes, residual, title in zip(both, (result.before, result.after), ('before', 'after')):
        y = residual[rows]
        scatter(axes, x, y, 'grey')
        panel = Panel(label, f'measured − predicted ({unit})', [
            Line('samples', *_subsample(x, y), 'grey', style='dots')], title)
        panels.append(panel)
        for mask, colour, words in ((side, 'blue', 'positive'), (~side, 'orange', 'negative')):
            if mask.sum() > 20 and name != 'velocity':
                mean = averages(x[mask], y[mask], run[mask])
                axes.plot(*mean, color=COLOURS[colour], label=words)
                panel.lines.append(Line(f'{words} direction', *mean, colour))
        if name == 'velocity':
            mean = averages(x, y, run)
            axes.plot(*mean, color=COLOURS['blue'])
            panel.lines.append(Line('average', *mean, 'blue'))
        axes.set_title(title)
        axes.set_xlabel(label)
    limit = float(np.percentile(np.abs(result.before[rows]), 99.5))
    both[0].set_ylim(-1.2 * limit, 1.2 * limit)
    both[0].set_ylabel(f'measured − predicted ({unit})')
    if name != 'velocity':
        both[1].legend(loc='upper right')
    return DrawnFigure(figure, [panels])


def _runs(samples: Samples) -> np.ndarray:
    """Return the index of each sample's run, shape (N,); a gap of 0.5 s ends a run."""
    run = np.empty(len(samples), dtype=int)
    for index, part in enumerate(samples.segments(max(20.0, 0.5 / samples.sample_time))):
        run[part] = index
    return run


def averages(x: np.ndarray, y: np.ndarray, run: np.ndarray,
             count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Return the means of x and y in ranges with equal numbers of samples.

    NaN separates ranges with a gap of more than a tenth of the whole between them, and ranges of
    different runs, so that no line is drawn there.

    Parameters
    ----------
    x, y : ndarray, shape (N,)
    run : ndarray of int, shape (N,)
        Run of each sample; all equal where runs do not follow each other along x.
    count : int
        Approximate number of ranges.
    """
    order = np.argsort(x, kind='stable')
    pieces = [piece for piece in np.array_split(order, count) if len(piece)]
    wide = 0.1 * float(np.ptp(x))
    middles: list[float] = []
    means: list[float] = []
    last, before = -np.inf, None
    for piece in pieces:
        values = x[piece]
        cuts = np.nonzero((np.diff(values) > wide) | (np.diff(run[piece]) != 0))[0] + 1
        for part in np.split(piece, cuts):
            if middles and (np.min(x[part]) - last > max(wide, 1e-300) or run[part[0]] != before):
                middles.append(np.nan)
                means.append(np.nan)
            middles.append(x[part].mean())
            means.append(y[part].mean())
            last, before = np.max(x[part]), run[part[-1]]
    return np.array(middles), np.array(means)


@styled
def spectrum_figure(result: RefineResult) -> DrawnFigure | None:
    """Draw the spectrum over position; None where the position hardly varied."""
    unit = result.report['unit']
    figure, axes = new_figure(height=2.8)
    lines = []
    for residual, words, colour in ((result.before, 'before', 'orange'),
                                    (result.after, 'after', 'blue')):
        k, size = spectrum(result, residual)
        if not len(k):
            return None
        k, size = largest_in_ranges(k, size)
        axes.plot(k, size, color=COLOURS[colour], label=words)
        lines.append(Line(words, np.log10(k), size, colour))
    axes.set_xscale('log')
    axes.set_xlabel('periods per turn')
    axes.set_ylabel(f'amplitude ({unit})')
    axes.set_ylim(bottom=0.0)
    axes.legend()
    return DrawnFigure(figure, [[Panel(
        'periods per turn (logarithm to base 10)', f'amplitude ({unit})', lines)]])


def spectrum(result: RefineResult, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return numbers of periods per turn and the residual's amplitude at each, shape (K,)."""
    rows = result.usable
    samples: Any = result.samples
    highest = highest_frequency(samples.velocity[rows], samples.sample_time,
                                result.scene.resolution)
    y = residual[rows]
    k, power = position_spectrum(samples.position[rows], y - y.mean(),
                                 np.ones(int(rows.sum())), highest, periods=0.5)
    return k, np.sqrt(2.0 * np.asarray(power) / rows.sum())


def largest_in_ranges(k: np.ndarray, size: np.ndarray, count: int = 700
                      ) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest values in logarithmic ranges, so that no peak is lost."""
    range_index = (np.log(k / k[0]) / max(math.log(k[-1] / k[0]), 1e-12) * count).astype(int)
    first = np.nonzero(np.diff(range_index, prepend=-1))[0]
    return k[first], np.maximum.reduceat(size, first)
