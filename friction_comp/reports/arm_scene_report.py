# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the demo's arm: the person's torque without and with help."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.reports.figures import COLOURS, new_figure, styled, thin
from friction_comp.reports.html import Report

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from friction_comp.refinement.whole_arm import ArmResult
    from friction_comp.samples import Samples

# Of upper arm and forearm in the drawing, m; where along the recording it is drawn.
_LENGTHS = (0.28, 0.25)
_MOMENTS = 7
# Diameter in points of a torque of 1 N·m.
_SIZE = 9.0


def peaks_of(alone: Mapping[str, Samples], helped: Mapping[str, Samples]
             ) -> dict[str, dict[str, dict[str, float]]]:
    """Return RMS and largest torque in N·m of the person, by joint and recording."""
    def of(samples: Samples) -> dict[str, float]:
        load = np.asarray(samples.load)
        return {'rms': float(np.sqrt(np.mean(load ** 2))), 'peak': float(np.abs(load).max())}
    return {joint: {'alone': of(alone[joint]), 'helped': of(helped[joint])} for joint in alone}


def arm_scene_report(alone: Mapping[str, Samples], helped: Mapping[str, Samples],
                     result: ArmResult, exercise: Path) -> Report:
    """Return the page.

    Parameters
    ----------
    alone, helped : dict of str to Samples
        The same exercise without and with compensation, by joint.
    result : ArmResult
        What was refined between them.
    exercise : Path
    """
    peaks = peaks_of(alone, helped)
    page = Report('A person guides an arm, without help and with it',
                  f'Exercise {exercise.name}: three joints, moved by MuJoCo')
    total = {name: np.sqrt(sum(own[name]['rms'] ** 2 for own in peaks.values()))
             for name in ('alone', 'helped')}
    page.verdict(f"With the arm's weight carried and its friction taken by the motors, guiding it "
                 f'takes **{100 * (1 - total["helped"] / total["alone"]):.0f} % less** torque of '
                 'the person (RMS of all joints).')
    page.numbers([(f'{own["alone"]["rms"]:.2f} → {own["helped"]["rms"]:.2f} N·m', f'{joint}, RMS')
                  for joint, own in peaks.items()])
    page.figure(_pictures(alone, helped), 'The arm from the side, from left to right as it is '
                'guided. Discs at shoulder and elbow are as large as the torque that the person '
                'gives there: above without help, below with it.')
    page.figure(_curves(alone, helped), 'Torque of the person at each joint.')
    page.table(['joint', 'RMS alone (N·m)', 'RMS helped (N·m)', 'peak alone (N·m)',
                'peak helped (N·m)', 'added to the model of the drive'],
               [[joint, own['alone']['rms'], own['helped']['rms'], own['alone']['peak'],
                 own['helped']['peak'], ', '.join(
                     entry['name'].replace('_', ' ')
                     for entry in result.results[joint].report['effects']) or 'nothing']
                for joint, own in peaks.items()])
    fitted = result.report()['rigid_bodies']
    page.table(['link of', 'mass by its URDF (kg)', 'mass found (kg)'],
               [[body['joint'], body['mass_urdf'], body['mass']] for body in fitted],
               'What the cuff carries is not in the URDF. Only sums of masses along the arm that '
               'its motion shows are certain.')
    return page


@styled
def _pictures(alone: Mapping[str, Samples], helped: Mapping[str, Samples]) -> Figure:
    figure, axes = new_figure(2, 1, width=8.4, height=2.1, sharex=True)
    for below, recorded, colour in zip(axes, (alone, helped), ('orange', 'green')):
        count = len(next(iter(recorded.values())))
        first = count // 40
        # The first of the repetitions.
        for k, at in enumerate(np.linspace(first, count // 2, _MOMENTS).astype(int)):
            _draw(below, 0.55 * k, {joint: float(samples.position[at])
                                    for joint, samples in recorded.items()},
                  {joint: float(np.asarray(samples.load)[at])
                   for joint, samples in recorded.items()}, COLOURS[colour])
        below.set_aspect('equal')
        below.set_ylim(-0.65, 0.25)
        below.axis('off')
    return figure


def _draw(axes: Axes, left: float, angle: dict[str, float], torque: dict[str, float],
          colour: str) -> None:
    places = [np.array([left, 0.0])]
    total = 0.0
    for joint, length in zip(('lift', 'bend'), _LENGTHS):
        total += angle[joint]
        places.append(places[-1] + length * np.array([np.sin(total), -np.cos(total)]))
    x, y = np.array(places).T
    axes.plot([left, left], [0.0, 0.2], color=COLOURS['grey'], linewidth=7.0, alpha=0.5,
              solid_capstyle='round')
    axes.plot(x, y, color=COLOURS['grey'], linewidth=5.0, solid_capstyle='round')
    for point, joint in zip(places, ('lift', 'bend')):
        axes.plot(*point, 'o', color=colour, alpha=0.75,
                  markersize=max(1.0, _SIZE * abs(torque[joint])))


@styled
def _curves(alone: Mapping[str, Samples], helped: Mapping[str, Samples]) -> Figure:
    figure, axes = new_figure(len(alone), 1, width=8.4, height=1.7, sharex=True, squeeze=False)
    for below, joint in zip(axes[:, 0], alone):
        for recorded, colour, name in ((alone, 'orange', 'without help'),
                                       (helped, 'green', 'with it')):
            samples: Any = recorded[joint]
            below.plot(*thin(samples.time - samples.time[0], samples.load),
                       color=COLOURS[colour], label=name)
        below.set_ylabel(f'{joint} (N·m)')
    axes[0, 0].legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=2)
    axes[-1, 0].set_xlabel('time (s)')
    return figure
