# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Draws README's picture of measured and predicted torque: `python3 docs/first_picture.py`."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure
import numpy as np

from friction_comp.recordings import read_recording
from friction_comp.refinement import refine
from friction_comp.reports.figures import curve, new_figure, styled, to_file

# Text in the colour of light and dark pages.
DESCRIPTION = """\
Left: torque over time, measured and predicted, which nearly coincide. Right: friction over
velocity, a step at zero and a straight line on either side."""
ROOT = Path(__file__).resolve().parent.parent


@styled
def picture() -> Figure:
    """Return torque over time, and friction over velocity, of the example log."""
    result = refine(read_recording(ROOT / 'examples' / 'log.csv'))
    samples, model, friction = result.samples, result.model, result.report.friction
    others = sum(effect.current(samples) for effect in model.effects)
    # A third of the samples is as easy to read as all of them.
    velocity = np.asarray(samples.velocity)
    moves = np.flatnonzero(result.usable)[::3]
    predicted = model.sigmoid(velocity) + others
    part = (samples.time > 4.0) & (samples.time < 12.0)
    figure, (left, right) = new_figure(columns=2, width=8.4, height=2.6)
    curve(left, samples.time[part], samples.current[part], 'grey', 'measured', linewidth=3.0)
    curve(left, samples.time[part], predicted[part], 'blue', 'predicted')
    left.set(xlabel='time (s)', ylabel='torque (N·m)', ylim=(-5.5, 8.5))
    left.legend(loc='upper right', ncols=2)
    curve(right, velocity[moves], (samples.current - others)[moves], 'grey',
          'measured, without the other effects', '.', markersize=2)
    speeds = np.linspace(velocity.min(), velocity.max(), 400)
    curve(right, speeds, friction.coulomb * np.sign(speeds) + friction.viscous * speeds
          + friction.offset, 'blue', 'Coulomb + viscous + offset')
    right.set(xlabel='velocity (rad/s)', ylabel='friction (N·m)')
    right.legend(loc='upper left')
    return figure


if __name__ == '__main__':
    (ROOT / 'docs' / 'first.svg').write_text(
        to_file(picture(), 'Measured and predicted torque of examples/log.csv', DESCRIPTION),
        encoding='utf-8')
