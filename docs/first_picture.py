# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Draws README's picture of measured and predicted torque: `python3 docs/first_picture.py`."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure
import numpy as np

from friction_comp.recordings import read_recording
from friction_comp.refinement import refine
from friction_comp.reports.figures import COLOURS, new_figure, styled, to_svg

# Text in the colour of light and dark pages.
HEAD = """
<!-- Copyright 2026 The friction_comp authors, SPDX-License-Identifier: Apache-2.0 -->
<title>Measured and predicted torque of examples/log.csv</title>
<desc>Left: torque over time, measured and predicted, which nearly coincide. Right: friction over
velocity, a step at zero and a straight line on either side.</desc>
<style>
  svg { color: #1a2b3d; background: #ffffff }
  @media (prefers-color-scheme: dark) { svg { color: #e4e9ee; background: #161c22 } }
</style>"""
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
    left.plot(samples.time[part], samples.current[part], color=COLOURS['grey'], linewidth=3.0,
              label='measured')
    left.plot(samples.time[part], predicted[part], color=COLOURS['blue'], label='predicted')
    left.set(xlabel='time (s)', ylabel='torque (N·m)', ylim=(-5.5, 8.5))
    left.legend(loc='upper right', ncols=2)
    right.plot(velocity[moves], (samples.current - others)[moves], '.', markersize=2,
               color=COLOURS['grey'], label='measured, without the other effects')
    speeds = np.linspace(velocity.min(), velocity.max(), 400)
    right.plot(speeds, friction.coulomb * np.sign(speeds) + friction.viscous * speeds
               + friction.offset, color=COLOURS['blue'], label='Coulomb + viscous + offset')
    right.set(xlabel='velocity (rad/s)', ylabel='friction (N·m)')
    right.legend(loc='upper left')
    return figure


if __name__ == '__main__':
    text = to_svg(picture())
    start = text.index('>', text.index('<svg')) + 1
    (ROOT / 'docs' / 'first.svg').write_text(
        text[text.index('<svg'):start] + HEAD + text[start:], encoding='utf-8')
