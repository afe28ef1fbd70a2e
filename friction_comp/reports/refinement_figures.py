# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The figures of the report of `refine`."""

from __future__ import annotations

from itertools import cycle
import math
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from friction_comp.model.effects.position_effects import highest_frequency, position_spectrum
from friction_comp.model.friction_numbers import quantity_in
from friction_comp.refinement.result import RefineResult
from friction_comp.reports.figures import curve, new_figure, scatter, styled

# Shortest and longest excerpt over time, s, and the number of reversals that it should contain.
_SHORTEST, _LONGEST, _REVERSALS = 4.0, 60.0, 8
# Number of ranges of a variable in which the residual is averaged.
_RANGES = 40
# Colours of the contributions to the predicted current, Eq. 6 first.
_CONTRIBUTION_COLOURS = ('violet', 'green', 'pink', 'red', 'yellow', 'orange', 'blue', 'grey')


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
def time_figure(result: RefineResult) -> Figure:
    """Draw measured and predicted current over time, and the contribution of each effect."""
    samples, model, unit = result.samples, result.model, result.report.unit
    part = excerpt(result)
    time, measured = samples.time[part], samples.current[part]
    contributions = {'Eq. 6': np.asarray(model.sigmoid(np.asarray(samples.velocity)))[part]}
    with_arm = model.with_arm(samples)
    for effect in model.effects:
        name = effect.name.replace('_', ' ')
        contributions[name] = contributions.get(name, 0.0) + effect.current(with_arm)[part]
    figure, (above, below) = new_figure(
        rows=2, height=2.4, sharex=True, x='time (s)',
        y=(f'{quantity_in(unit)} ({unit})', f'contributions ({unit})'))
    for name, colour, values in (('measured', 'grey', measured),
                                 ('before', 'orange', measured - result.before[part]),
                                 ('after', 'blue', measured - result.after[part])):
        curve(above, time, values, colour, name, linewidth=1.1)
    for (name, values), colour in zip(contributions.items(), cycle(_CONTRIBUTION_COLOURS)):
        curve(below, time, values, colour, name, linewidth=1.1)
    for axes in (above, below):
        axes.legend(loc='upper left', bbox_to_anchor=(1.0, 1.0))
    return figure


@styled
def friction_figure(result: RefineResult) -> Figure:
    """Draw friction over velocity: measured minus the effects, and Eq. 6 before and after."""
    samples, usable = result.samples, result.usable
    friction = np.array(samples.current, dtype=float)
    with_arm = result.model.with_arm(samples)
    for effect in result.model.effects:
        friction -= effect.current(with_arm)
    velocity, friction = np.asarray(samples.velocity)[usable], friction[usable]
    speeds = np.linspace(velocity.min(), velocity.max(), 801)
    figure, axes = new_figure(x='velocity (rad/s)', y=f'friction ({result.report.unit})')
    scatter(axes, velocity, friction, 'grey', 'measured minus effects')
    curve(axes, speeds, result.start.sigmoid(speeds), 'orange', 'before')
    curve(axes, speeds, result.model.sigmoid(speeds), 'blue', 'after')
    low, high = np.percentile(friction, (0.5, 99.5))
    axes.set_ylim(low - 0.2 * (high - low), high + 0.2 * (high - low))
    # Friction rises from lower left to upper right; finding the best place takes seconds.
    axes.legend(loc='upper left')
    return figure


@styled
def residual_figure(result: RefineResult, name: str, label: str) -> Figure:
    """Draw the residual over a signal, before and after side by side."""
    samples, rows = result.samples, result.usable
    x = getattr(samples, name)[rows]
    positive = np.asarray(samples.velocity)[rows] > 0
    sides = [(np.ones(len(x), dtype=bool), 'blue', 'average')] if name == 'velocity' else [
        (positive, 'blue', 'positive direction'), (~positive, 'orange', 'negative direction')]
    figure, both = new_figure(columns=2, height=2.8, sharey=True, x=label,
                              y=f'measured − predicted ({result.report.unit})')
    for axes, residual, title in zip(both, (result.before, result.after), ('before', 'after')):
        y = residual[rows]
        scatter(axes, x, y, 'grey')
        for mask, colour, legend in sides:
            if mask.sum() > 20:
                curve(axes, *averages(x[mask], y[mask]), colour, legend)
        axes.set_title(title)
    limit = float(np.percentile(np.abs(result.before[rows]), 99.5))
    both[0].set_ylim(-1.2 * limit, 1.2 * limit)
    both[1].legend(loc='upper right')
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


@styled
def spectrum_figure(result: RefineResult) -> Figure:
    """Draw the residual's spectrum over position, where the position varied."""
    figure, axes = new_figure(height=2.8, x='periods per turn',
                              y=f'amplitude ({result.report.unit})')
    for residual, legend, colour in ((result.before, 'before', 'orange'),
                                    (result.after, 'after', 'blue')):
        curve(axes, *largest_in_ranges(*spectrum(result, residual)), colour, legend)
    axes.set_xscale('log')
    axes.set_ylim(bottom=0.0)
    axes.legend(loc='upper right')
    return figure


def spectrum(result: RefineResult, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a residual's spectrum: periods per turn and amplitudes, (K,); K may be 0."""
    rows = result.usable
    samples: Any = result.samples
    highest = highest_frequency(samples.velocity[rows], samples.sample_time,
                                result.coverage.resolution)
    y = residual[rows]
    k, power = position_spectrum(samples.position[rows], y - y.mean(),
                                 np.ones(int(rows.sum())), highest, periods=0.5)
    return k, np.sqrt(2.0 * np.asarray(power) / rows.sum())


def largest_in_ranges(k: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Thin out a spectrum to the largest value in each of 700 logarithmic ranges of k."""
    range_index = (np.log(k / k[0]) / max(math.log(k[-1] / k[0]), 1e-12) * 700).astype(int)
    first = np.nonzero(np.diff(range_index, prepend=-1))[0]
    return k[first], np.maximum.reduceat(size, first)
