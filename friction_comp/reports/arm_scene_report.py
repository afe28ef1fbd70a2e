# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the demo's arm: the person's torque without and with compensation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.reports.figures import COLOURS, new_figure, styled, thin
from friction_comp.reports.html import Report
from friction_comp.reports.refinement_report import effect_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from friction_comp.refinement.whole_arm import ArmResult
    from friction_comp.samples import Samples

# Lengths of upper arm and forearm in the drawing, m; number of poses drawn.
_LENGTHS = np.array([0.28, 0.25])
_POSES = 7
# Diameter of the disc of a torque of 1 N·m, points.
_POINTS_PER_TORQUE = 9.0


def peaks_of(alone: Mapping[str, Samples], helped: Mapping[str, Samples]
             ) -> dict[str, dict[str, dict[str, float]]]:
    """Return the person's RMS and peak torque by joint and recording, N·m."""
    def summarise(samples: Samples) -> dict[str, float]:
        load = np.asarray(samples.load)
        return {'rms': float(np.sqrt(np.mean(load ** 2))), 'peak': float(np.abs(load).max())}
    return {joint: {'alone': summarise(alone[joint]), 'helped': summarise(helped[joint])}
            for joint in alone}


def arm_scene_report(alone: Mapping[str, Samples], helped: Mapping[str, Samples],
                     result: ArmResult, exercise: Path) -> Report:
    """Return the page.

    Parameters
    ----------
    alone, helped : dict of str to Samples
        The same exercise without and with compensation, by joint.
    result : ArmResult
        The refined model used in the second one.
    exercise : Path
    """
    peaks = peaks_of(alone, helped)
    page = Report('A person guides an arm, without help and with it',
                  f'Exercise {exercise.name}: three joints, moved by MuJoCo')
    total = {name: np.sqrt(sum(peak[name]['rms'] ** 2 for peak in peaks.values()))
             for name in ('alone', 'helped')}
    page.verdict("With the arm's weight and friction compensated by the motors, guiding it takes "
                 f'**{100 * (1 - total["helped"] / total["alone"]):.0f} % less** torque from '
                 'the person (RMS of all joints).')
    page.numbers([(f'{peak["alone"]["rms"]:.2f} → {peak["helped"]["rms"]:.2f} N·m', f'{joint}, RMS')
                  for joint, peak in peaks.items()])
    page.figure(_pose_figure(alone, helped), 'The arm from the side, over time from left to '
                'right. The size of the discs at shoulder and elbow shows the torque of the person '
                'there: above without help, below with it.')
    page.figure(_torque_figure(alone, helped), 'Torque of the person at each joint.')
    page.table(['joint', 'RMS alone (N·m)', 'RMS helped (N·m)', 'peak alone (N·m)',
                'peak helped (N·m)', 'added to the model of the drive'],
               [[joint, peak['alone']['rms'], peak['helped']['rms'], peak['alone']['peak'],
                 peak['helped']['peak'],
                 effect_names(result.results[joint].report['effects'])]
                for joint, peak in peaks.items()])
    fitted = result.report()['rigid_bodies']
    page.table(['link of', 'mass by its URDF (kg)', 'mass found (kg)'],
               [[body['joint'], body['mass_urdf'], body['mass']] for body in fitted],
               'The load on the cuff is not in the URDF. Only those sums of masses along the arm '
               'are certain that its motion shows.')
    return page


@styled
def _pose_figure(alone: Mapping[str, Samples], helped: Mapping[str, Samples]) -> Figure:
    figure, axes = new_figure(2, 1, width=8.4, height=2.1, sharex=True)
    for axis, recorded, colour in zip(axes, (alone, helped), ('orange', 'green')):
        joints: list[Any] = [recorded['lift'], recorded['bend']]
        count = len(joints[0])
        # Poses from the first repetition.
        for k, sample in enumerate(np.linspace(count // 40, count // 2, _POSES).astype(int)):
            _draw_pose(axis, 0.55 * k, [joint.position[sample] for joint in joints],
                       [joint.load[sample] for joint in joints], COLOURS[colour])
        axis.set_aspect('equal')
        axis.set_ylim(-0.65, 0.25)
        axis.axis('off')
    return figure


def _draw_pose(axes: Axes, left: float, angles: list[float], torques: list[float],
               colour: str) -> None:
    total = np.cumsum(angles)
    x = left + np.cumsum([0.0, *_LENGTHS * np.sin(total)])
    y = np.cumsum([0.0, *-_LENGTHS * np.cos(total)])
    axes.plot([left, left], [0.0, 0.2], color=COLOURS['grey'], linewidth=7.0, alpha=0.5,
              solid_capstyle='round')
    axes.plot(x, y, color=COLOURS['grey'], linewidth=5.0, solid_capstyle='round')
    for k, torque in enumerate(torques):
        axes.plot(x[k], y[k], 'o', color=colour, alpha=0.75,
                  markersize=max(1.0, _POINTS_PER_TORQUE * abs(torque)))


@styled
def _torque_figure(alone: Mapping[str, Samples], helped: Mapping[str, Samples]) -> Figure:
    figure, axes = new_figure(len(alone), 1, width=8.4, height=1.7, sharex=True, squeeze=False)
    for axis, joint in zip(axes[:, 0], alone):
        for recorded, colour, name in ((alone, 'orange', 'without help'),
                                       (helped, 'green', 'with it')):
            samples: Any = recorded[joint]
            axis.plot(*thin(samples.time - samples.time[0], samples.load),
                      color=COLOURS[colour], label=name)
        axis.set_ylabel(f'{joint} (N·m)')
    axes[0, 0].legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=2)
    axes[-1, 0].set_xlabel('time (s)')
    return figure
