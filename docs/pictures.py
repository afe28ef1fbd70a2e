# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Draws pictures of README and docs.

python3 docs/pictures.py first sources said        writes docs/first.svg and so on
python3 docs/pictures.py to_and_fro=DIR            DIR: the output of that scene of the demo
"""

import json
from pathlib import Path
import sys

import numpy as np

from friction_comp.demo.pages import HandTrial, loops_figure
from friction_comp.demo.scenes import recorded, WAYS
from friction_comp.direction.sources import DesiredMotion, ForceDirection, PlannedDirection
from friction_comp.recordings.reader import read_recording
from friction_comp.refinement import refine
from friction_comp.reports.figures import (
    COLOURS,
    curve,
    INK,
    legend,
    panels,
    scatter,
    styled,
    to_svg,
)

ROOT = Path(__file__).resolve().parent.parent
# Of the first picture.
DESCRIPTION = """\
Above: torque over time, measured and predicted, which nearly coincide. Below: friction over
velocity, a step at zero and a straight line on either side."""
# The person begins to push at 2.3 s; the joint moves from 2.55 to 4.2 s.
PUSH, MOVES, ENDS, LAST = 2.3, 2.55, 4.2, 5.5
CALIBRATED = 4.0


def to_file(figure, title, description):
    """Return a figure as the content of an SVG file for light and dark pages."""
    text = to_svg(figure)
    start = text.index('>') + 1
    return f"""{text[:start]}
<!-- Copyright 2026 The friction_comp authors, SPDX-License-Identifier: Apache-2.0 -->
<title>{title}</title>
<desc>{description}</desc>
<style>
  svg {{ color: {INK}; background: #ffffff }}
  @media (prefers-color-scheme: dark) {{ svg {{ color: #e4e9ee; background: #161c22 }} }}
</style>{text[start:]}"""


def position(time):
    """Return the joint's angle, rad."""
    share = np.clip((time - MOVES) / (ENDS - MOVES), 0.0, 1.0)
    return 0.7 * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def torque(time):
    """Return the person's torque as a share of breakaway: a rise, and a part that moves on."""
    rise = np.clip((time - PUSH) / 0.25, 0.0, 1.0)
    return rise * (1.0 - 0.6 * np.clip((time - MOVES) / 0.2, 0.0, 1.0)) * (time < ENDS - 0.3)


def sensed():
    """Return times, the sensor's values, and what was announced."""
    random, source = np.random.default_rng(1), ForceDirection((0.0, 1023.0))
    begin, rows, said = -CALIBRATED - 0.5, [], []
    for k in range(round((LAST - begin) * 100)):
        time = begin + 0.01 * (k + 1)
        source.motion.add(time, float(position(time)))
        value = np.rint(500.0 + 120.0 * torque(time) + random.normal())
        source.add(time, [value])
        if abs(time + CALIBRATED) < 5e-3:
            source.begin_calibration()
        elif abs(time + 0.9) < 5e-3:
            assert not source.failure, source.failure
        rows.append((time, value))
        said.append(source.at(time).direction)
    return (*np.array(rows).T, np.array(said))


def planned(time):
    """Return what a plan announces."""
    grid = np.arange(0.0, LAST, 0.02)
    plan = PlannedDirection(['joint'], 1.0, 0.2)
    plan.take(['joint'], grid, position(grid)[:, None], 0.0, 0.0, np.zeros(1))
    return np.array([plan.at(t, position(np.array([t])))[0].direction for t in time])


def led(time):
    """Return what a leader announces."""
    leader, said = DesiredMotion(), []
    for t in time:
        leader.motion.add(t, float(position(t)))
        leader.take(t, float(position(t)))
        said.append(leader.at(t, float(position(t))).direction)
    return np.array(said)


@styled
def first():
    """Return torque over time, and friction over velocity, of the example log."""
    result = refine(read_recording(ROOT / 'examples' / 'log.csv'))
    samples, model, friction = result.samples, result.model, result.report.friction
    others = sum(effect.current(samples) for effect in model.effects)
    # A third of the samples is as easy to read as all of them.
    velocity = np.asarray(samples.velocity)
    moves = np.flatnonzero(result.usable)[::3]
    predicted = model.sigmoid(velocity) + others
    part = (samples.time > 4.0) & (samples.time < 12.0)
    figure, (above, below) = panels(
        ['torque (N·m)', 'friction (N·m)'], ['time (s)', 'velocity (rad/s)'], 1.8)
    curve(above, samples.time[part], predicted[part], 'predicted', 'predicted')
    scatter(above, samples.time[part], samples.current[part], label='measured')
    speeds = np.linspace(velocity.min(), velocity.max(), 400)
    curve(below, speeds, friction.coulomb * np.sign(speeds) + friction.viscous * speeds
          + friction.offset, 'predicted')
    scatter(below, velocity[moves], (samples.current - others)[moves])
    legend(above)
    return figure


@styled
def sources():
    """Return a movement, and when each source announces its direction."""
    time = np.arange(0.0, LAST, 0.01)
    figure, axes = panels(['plan (deg)', 'leader (deg)', 'force (counts)'], 'time (s)', 1.1)
    rows = {'plan': (time, np.degrees(position(time)), planned(time)),
            'leader': (time, np.degrees(position(time)), led(time)),
            'force': sensed()}
    for row, (when, signal, said) in zip(axes, rows.values()):
        shown = when > 0.0
        row.axvspan(MOVES, ENDS, color='#6b7885', alpha=0.12, linewidth=0)
        row.plot(when[shown], signal[shown], color='#1a2b3d', linewidth=1.0)
        low, high = row.get_ylim()
        high += 0.35 * (high - low)
        begin = when[shown][np.argmax(said[shown] != 0)]
        end = when[shown][len(said[shown]) - 1 - np.argmax(said[shown][::-1] != 0)]
        at = high - 0.14 * (high - low)
        row.annotate('', (end, at), (begin, at), arrowprops={
            'arrowstyle': '-|>', 'color': COLOURS['known'], 'linewidth': 4.0, 'shrinkA': 0,
            'shrinkB': 0, 'mutation_scale': 18})
        row.set_ylim(low, high)
        row.set_xlim(0.0, LAST)
    axes[0].set_title('grey: the joint moves; arrow: its direction is announced')
    return figure


@styled
def said():
    """Return the errors that refinement said and that were found, of the measured recordings."""
    found = json.loads((ROOT / 'docs' / 'figures' / 'said.json').read_text())['rows']
    figure, (row,) = panels(['true'], 'said, both as shares of the error of Coulomb + viscous', 3.0)
    ends = np.array([0.02, 2.0])
    for times in (1, 2):
        row.plot(ends, times * ends, color='#6b7885', linewidth=0.8, linestyle='-:'[times - 1])
        row.text(ends[1], times * ends[1], f' {times}', va='center', color='#6b7885')
    for verdict, marker, colour in (('trust', 'o', COLOURS['known']), ('trust in part', 's', INK),
                                    ('record again', 'x', '#c0392b')):
        shares = np.array([[one['said'], one['true']] for one in found
                           if one['verdict'] == verdict]) / np.array(
                               [[one['plain']] for one in found if one['verdict'] == verdict])
        row.plot(*shares.T, marker, color=colour, markersize=5, label=verdict)
    row.set(xscale='log', yscale='log')
    legend(row)
    return figure


def to_and_fro(folder):
    """Return the torque of a hand over the angle, with several laws, as an SVG file."""
    trials = {name: HandTrial(title, recorded(Path(folder) / 'recordings' / name))
              for name, title, *_ in WAYS}
    return to_file(loops_figure(trials), 'A hand moves a joint to and fro', (
        'Torque of a hand over the angle, to and fro at 0.6 Hz. RMS: '
        + ', '.join(f'{one.title} {one.rms:.2f}' for one in trials.values()) + ' N·m.'))


PICTURES = {
    'first': lambda _: to_file(
        first(), 'Measured and predicted torque of examples/log.csv', DESCRIPTION),
    'sources': lambda _: to_svg(sources()),
    'said': lambda _: to_svg(said()),
    'to_and_fro': to_and_fro}

if __name__ == '__main__':
    for argument in sys.argv[1:]:
        name, _, where = argument.partition('=')
        (ROOT / 'docs' / f'{name}.svg').write_text(PICTURES[name](where), encoding='utf-8')
