# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A guided movement and the exercise that was made of it."""

from __future__ import annotations

from matplotlib.figure import Figure
import numpy as np

from friction_comp.exercise.exercise_script import ExerciseScript
from friction_comp.exercise.taught_exercise import Taught
from friction_comp.reports.figures import COLOURS, INK, new_figure, shade_directions, styled, thin


@styled
def taught_figure(taught: Taught, script: ExerciseScript) -> Figure:
    """Return a figure with a row for each joint: path, waypoints, and coloured directions."""
    figure, axes = new_figure(rows=len(script.joints), height=2.4, sharex=True, squeeze=False,
                              x='time, s', y=[f'{joint}, deg' for joint in script.joints])
    time = np.linspace(0.0, script.duration, 1500)
    states = [script.at(float(t)) for t in time]
    position = np.degrees([state[0] for state in states])
    direction = np.array([state[2] for state in states])
    for j, row in enumerate(axes[:, 0]):
        row.plot(*thin(taught.time, np.degrees(taught.path[:, j])), color=COLOURS['grey'],
                 linewidth=4.0, alpha=0.6, label='guided')
        row.plot(time, position[:, j], color=INK, linewidth=1.2, label='exercise')
        row.plot(taught.waypoints, np.interp(taught.waypoints, time, position[:, j]), 'o',
                 color=INK, markersize=4, label='waypoint')
        shade_directions(row, time, direction[:, j])
    axes[0, 0].legend(loc='upper right', fontsize=8, ncol=3)
    return figure
