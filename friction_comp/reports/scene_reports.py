# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reports on the demo's other scenes: two joints, a drive that changes, and an arm."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np
from scipy.signal import find_peaks

from friction_comp.arm.whole_arm import ArmResult
from friction_comp.evaluation.conditions import Evaluation
from friction_comp.exercise.exercise_script import ExerciseScript
from friction_comp.exercise.taught_exercise import TURN
from friction_comp.reports.evaluation_report import evaluation_report
from friction_comp.reports.figures import COLOURS, new_figure, shade_directions, styled, thin
from friction_comp.reports.html import Report
from friction_comp.reports.refinement_report import effect_names
from friction_comp.samples import Samples
from friction_comp.statistics import rms

# Lengths of upper arm and forearm in the drawing, m; number of poses drawn.
_LENGTHS = np.array([0.28, 0.25])
_POSES = 7
# Diameter of the disc of a torque of 1 N·m, points.
_POINTS_PER_TORQUE = 9.0


def two_joints_report(evaluations: list[Evaluation], shown: dict[str, Samples],
                      exercise: Path) -> Report:
    """Return the report on an exercise; `shown` is a recording of it on one time base, by joint."""
    return evaluation_report(
        evaluations, f'Two joints that reverse on the way: {exercise.stem}',
        begin=lambda page: page.figure(
            exercise_figure(shown), 'Positions shown to the person (dashed), positions of the '
            'joints, and announced directions (shaded: blue positive, orange negative).'))


@styled
def exercise_figure(shown: Mapping[str, Samples]) -> Figure:
    """Draw positions and announced directions of the first 16 s, one joint above the other."""
    figure, axes = new_figure(
        len(shown), width=8.4, height=2.2, sharex=True, squeeze=False, x='time (s)',
        y=[f'{joint} (deg)' for joint in shown])
    for axis, samples in zip(axes[:, 0], shown.values()):
        part = samples.take(samples.time <= samples.time[0] + 16.0)
        if part.reference_position is not None:
            axis.plot(*thin(part.time, np.degrees(part.reference_position)), '--',
                      color=COLOURS['grey'], linewidth=1.0)
        axis.plot(*thin(part.time, np.degrees(part.position)), color=COLOURS['green'])
        if part.direction is not None:
            shade_directions(axis, part.time, part.direction)
    return figure


def peaks_of(alone: Mapping[str, Samples], helped: Mapping[str, Samples]
             ) -> dict[str, dict[str, dict[str, float]]]:
    """Return the person's RMS and peak torque by joint and recording, N·m."""
    return {joint: {
        name: {'rms': rms(load), 'peak': float(np.abs(load).max())}
        for name, load in (('alone', np.asarray(alone[joint].load)),
                           ('helped', np.asarray(helped[joint].load)))} for joint in alone}


def compared_with_taught(script: ExerciseScript, played: Mapping[str, Mapping[str, Samples]]
                         ) -> dict[str, Any]:
    """Return how an exercise agrees with the guided movement, and its replays with it.

    `played` holds, by name and joint, the recordings, `guided` first. Returned are the number of
    `waypoints`; `farthest`, by recording, how far its path stays away from a waypoint at most, deg;
    `reversals` of the guided movement, and how many of them are `announced`.
    """
    farthest, found, announced = {}, 0, 0
    for name, recording in played.items():
        path = np.column_stack([recording[joint].position for joint in script.joints])
        path = path - path[0]
        farthest[name] = max(float(np.degrees(np.abs(path - place).max(axis=1).min()))
                             for place in script.positions)
    grid = np.arange(0.0, script.duration, 0.01)
    said = np.array([script.at(float(time))[2] for time in grid])
    for j, joint in enumerate(script.joints):
        path = played['guided'][joint].position
        turns = np.sort(np.concatenate([
            find_peaks(sign * path, prominence=2.0 * TURN)[0] for sign in (1.0, -1.0)]))
        ways = np.sign(np.diff(path[[0, *turns, -1]]))
        own = said[:, j][said[:, j] != 0]
        signs = own[np.flatnonzero(np.diff(own, prepend=0))]
        found += len(turns)
        announced += len(turns) if np.array_equal(signs, ways) else 0
    return {'waypoints': len(script.times), 'farthest': farthest, 'reversals': found,
            'announced': announced}


def taught_words(taught: dict[str, Any]) -> str:
    """Return the result of `compared_with_taught` in a sentence."""
    far = taught['farthest']
    return (f'the exercise has {taught["waypoints"]} waypoints, {far["guided"]:.2f} deg at most '
            f'from the guided path, and announces {taught["announced"]} of '
            f'{taught["reversals"]} reversals; the replay comes within {far["alone"]:.2f} deg of '
            f'each waypoint without help, {far["helped"]:.2f} deg with it')


def arm_scene_report(alone: Mapping[str, Samples], helped: Mapping[str, Samples],
                     result: ArmResult, exercise: Path, taught: dict[str, Any]) -> Report:
    """Return the report on a taught exercise; `taught` is from `compared_with_taught`."""
    peaks = peaks_of(alone, helped)
    page = Report('A person teaches an arm, and moves it without help and with it',
                  'Three joints, moved by MuJoCo')
    total = {name: np.sqrt(sum(peak[name]['rms'] ** 2 for peak in peaks.values()))
             for name in ('alone', 'helped')}
    page.verdict("With the arm's weight and friction compensated by the motors, guiding it takes "
                 f'**{100 * (1 - total["helped"] / total["alone"]):.0f} % less** torque from '
                 'the person (RMS of all joints).')
    page.numbers([(f'{peak["alone"]["rms"]:.2f} → {peak["helped"]["rms"]:.2f} N·m', f'{joint}, RMS')
                  for joint, peak in peaks.items()])
    page.figure(_pose_figure(alone, helped), 'The arm from the side; time runs from left to right. '
                'The size of the discs at shoulder and elbow shows the torque that the person '
                'applies there. Above: without help; below: with it.')
    page.figure(_torque_figure(alone, helped), 'Torque of the person at each joint.')
    words = taught_words(taught)
    page.text(f'{words[0].upper()}{words[1:]}.')
    page.figure(exercise_figure(helped), f'The taught exercise `{exercise.name}` (dashed), as '
                'replayed with help, and its announced directions (shaded: blue positive, orange '
                'negative).')
    page.table(['joint', 'RMS alone (N·m)', 'RMS helped (N·m)', 'peak alone (N·m)',
                'peak helped (N·m)', 'added to the model of the drive'],
               [[joint, peak['alone']['rms'], peak['helped']['rms'], peak['alone']['peak'],
                 peak['helped']['peak'],
                 effect_names(effect.name
                              for effect in result.results[joint].report.effects)]
                for joint, peak in peaks.items()])
    fitted = result.report()['rigid_bodies']
    page.table(['link after joint', 'mass in the URDF (kg)', 'mass found (kg)'],
               [[body['joint'], body['mass_urdf'], body['mass']] for body in fitted],
               'The load on the cuff is not in the URDF. Only sums of masses along the arm are '
               'certain.')
    return page


@styled
def _pose_figure(alone: Mapping[str, Samples], helped: Mapping[str, Samples]) -> Figure:
    figure, axes = new_figure(2, 1, width=8.4, height=2.1, sharex=True)
    for axis, recorded, colour in zip(axes, (alone, helped), ('orange', 'green')):
        joints: list[Any] = [recorded['lift'], recorded['bend']]
        count = len(joints[0])
        # The poses are from the first repetition.
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
    figure, axes = new_figure(
        len(alone), width=8.4, height=1.7, sharex=True, squeeze=False, x='time (s)',
        y=[f'{joint} (N·m)' for joint in alone])
    for axis, joint in zip(axes[:, 0], alone):
        for recorded, colour, name in ((alone, 'orange', 'without help'),
                                       (helped, 'green', 'with it')):
            samples: Any = recorded[joint]
            axis.plot(*thin(samples.time - samples.time[0], samples.load),
                      color=COLOURS[colour], label=name)
    axes[0, 0].legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=2)
    return figure
