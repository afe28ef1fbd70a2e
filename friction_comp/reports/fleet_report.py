# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The part of a page that compares the units of a fleet: what varies, and which unit is out."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

from friction_comp.fleet.population import ParameterSpread, Population, UnitValue
from friction_comp.number_text import interval_text, number
from friction_comp.reports.figures import COLOURS, new_figure, styled
from friction_comp.reports.html import Report

# Units up to which each has a row in a table, and its name and interval in the figure.
_MOST_ROWS, _MOST_NAMES = 100, 60


def fleet_verdict(population: Population) -> str:
    """Return in one or two sentences which units are out and what varies most."""
    count, out = len(population.units), population.out
    joint = f' (joint {population.joint})' if population.joint else ''
    text = f'**None of {count} units is out**{joint}.'
    if out:
        text = f'**{len(out)} of {count} units {"is" if len(out) == 1 else "are"} out**{joint}: ' \
            + '; '.join(f'{unit}: {", ".join(names)}' for unit, names in out.items()) + '.'
    varying = sorted((one for one in population.parameters if one.varies and
                      one.scale == 'logarithmic'), key=lambda one: -one.spread)
    if varying:
        text += ' From unit to unit vary most: ' + ', '.join(
            f'{one.name} ({_spread(one)[0]})' for one in varying[:3]) + '.'
    return text


def add_fleet(page: Report, population: Population) -> None:
    """Add the comparison of a joint's units to a page."""
    joint = f': {population.joint}' if population.joint else ''
    page.heading(f'Unit by unit{joint}')
    out = [(parameter, value) for parameter in population.parameters
           for value in parameter.units if value.out]
    if out:
        page.table(
            ['unit', 'parameter', 'value', '95 % interval', 'population', 'range of 95 % of units',
             'unit', 'probability by chance'],
            [[value.unit, one.name, value.value, interval_text(value.interval), one.mean,
              interval_text(one.range), one.unit, f'{value.p:.1g}'] for one, value in
             sorted(out, key=lambda entry: (entry[1].unit, entry[1].p))],
            'Units that are out, and by what. The probability is that of such a deviation of one '
            'unit in one parameter.')
    page.figure(_figure(population), 'Each dot is a unit with its 95 % interval, the band is the '
                'range in which 95 % of further units are expected, the line is the mean. Units '
                'that are out are red and named.')
    page.table(
        ['parameter', 'mean', '95 % interval', 'unit', 'spread', '95 % interval',
         'range of 95 % of units', 'varies'],
        [[one.name, one.mean, interval_text(one.mean_interval), one.unit, *_spread(one),
          interval_text(one.range), 'yes' if one.varies else 'not seen']
         for one in population.parameters],
        'The population, without the units that are out. The spread is the standard deviation '
        'between units, without what errors of measurement explain; "varies" says whether it can '
        'be told from zero.')
    repeated = population.recordings > len(population.units)
    page.text(
        f'{population.recordings} recordings of {len(population.units)} units were fitted with the '
        'same effects and constants, so that each parameter means the same in every unit. '
        + ('What differs between recordings of one unit counts as error of its value. ' if repeated
           else 'With one recording of each unit, what differs from day to day counts as a '
           'difference between units: record some units twice to tell these apart. ')
        + 'In a fleet without an odd unit, one is called out in 5 of 100 pages like this one, all '
        'parameters and joints together (generalised extreme Studentised deviate on a '
        'random-effects model); more often if a parameter is far from normally distributed.')
    if len(population.units) <= _MOST_ROWS:
        page.table(
            ['unit', *(f'{one.name} ({one.unit})' for one in population.parameters)],
            [[unit, *(_cell(one.units[k]) for one in population.parameters)]
             for k, unit in enumerate(population.units)],
            'Values with 95 % intervals; what is out is bold.')
    page.text('`fleet.json` holds all of this; '
              f'`{population.file_name}.yaml` is its mean as a model.')


@styled
def _figure(population: Population) -> Figure:
    parameters, count = population.parameters, len(population.units)
    figure, axes = new_figure(
        len(parameters), width=8.4, height=1.35, sharex=True, squeeze=False,
        x='' if count <= _MOST_NAMES else 'units, in the order of their names')
    for one, axis in zip(parameters, axes[:, 0]):
        _draw(axis, one, count)
    axes[-1, 0].set_xlim(-1.0, count)
    if count <= _MOST_NAMES:
        axes[-1, 0].set_xticks(range(count), population.units, rotation=90, fontsize=6.5)
    return figure


def _draw(axis: Axes, one: ParameterSpread, count: int) -> None:
    values = np.array([unit.value for unit in one.units])
    ends = np.array([unit.interval for unit in one.units]).T
    out = np.array([unit.out for unit in one.units])
    axis.axhspan(*one.range, color=COLOURS['grey'], alpha=0.18, linewidth=0)
    axis.axhline(one.mean, color=COLOURS['grey'], linewidth=0.8)
    for chosen, colour in ((~out, 'blue'), (out, 'red')):
        where = np.nonzero(chosen)[0]
        bars = np.abs(ends[:, chosen] - values[chosen]) if count <= _MOST_ROWS else None
        axis.errorbar(where, values[chosen], bars, fmt='o', markersize=3.0, linewidth=0.9,
                      color=COLOURS[colour])
    for k in np.nonzero(out)[0]:
        axis.annotate(one.units[k].unit, (k, values[k]), xytext=(4, 2), fontsize=7,
                      textcoords='offset points', color=COLOURS['red'],
                      ha='right' if k > 0.8 * count else 'left')
    # An interval of one unit must not make the differences between all others invisible.
    low, high = min(values.min(), one.range[0]), max(values.max(), one.range[1])
    margin = 0.2 * (high - low) + 1e-12
    axis.set_ylim(low - margin, high + margin)
    axis.set_title(f'{one.name} ({one.unit})', fontsize=8.5, fontweight='normal')
    axis.tick_params(labelsize=7.5)
    axis.grid(axis='x', visible=False)


def _spread(one: ParameterSpread) -> tuple[str, str]:
    """Return the spread, and its interval."""
    values, unit = [one.spread, *one.spread_interval], one.unit
    if one.scale == 'logarithmic':
        values, unit = [100.0 * math.expm1(value) for value in values], '%'
    return f'{number(values[0], 2)} {unit}', f'{interval_text(values[1:], 2)} {unit}'


def _cell(value: UnitValue) -> str:
    text = f'{number(value.value)} ({interval_text(value.interval)})'
    return f'**{text}**' if value.out else text
