# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reports of the demo's scenes about the hand and the direction, and of a follower."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure
import numpy as np
from scipy.signal import butter, sosfiltfilt

from friction_comp.number_text import number
from friction_comp.reports.figures import COLOURS, INK, new_figure, styled, thin
from friction_comp.reports.html import Report
from friction_comp.reports.moving_joint import moving_joint, MovingScene
from friction_comp.samples import Samples
from friction_comp.statistics import rms

_FAINT = '#9aa5b1'
_SHOWN = 0.01  # rad/s of the reference in the picture
_BAND = 20.0  # Hz: of the torque whose peak is compared; steps of the reference are above
_HAND_COLOURS = ('grey', 'violet', 'blue', 'green')


class HandTrial:
    """One recorded exercise: what the hand gave in each movement; `title` is its name."""

    def __init__(self, title: str, samples: Samples) -> None:
        self.title, self.time, self.position = title, samples.time, samples.position
        # The recorder may have begun before the exercise.
        velocity = np.nan_to_num(np.asarray(samples.reference_velocity, dtype=float))
        self.direction = np.nan_to_num(np.asarray(samples.direction, dtype=float))
        rate = 1.0 / float(np.median(np.diff(self.time)))
        torque = np.nan_to_num(np.asarray(samples.load, dtype=float))
        self.torque = sosfiltfilt(butter(2, _BAND, fs=rate, output='sos'), torque)
        way = np.sign(velocity)
        starts = np.flatnonzero(np.diff(way, prepend=0.0, append=0.0))
        self._reference = self.time, velocity
        self.movements = [(slice(a, b), float(way[a])) for a, b in zip(starts, starts[1:])
                          if way[a] != 0.0]
        """Samples and direction of each movement that the reference made."""

    @property
    def peak(self) -> float:
        """Mean over the movements of the largest torque in their direction, N·m."""
        return float(np.mean([(sign * self.torque[part]).max() for part, sign in self.movements]))

    @property
    def _steady(self) -> slice:
        """All movements but the first and the last."""
        return slice(self.movements[1][0].start, self.movements[-2][0].stop)

    @property
    def rms(self) -> float:
        """RMS torque of a movement to and fro, N·m, without its beginning and its end."""
        return rms(self.torque[self._steady])

    def inertial_rms(self, inertia: float) -> float:
        """Return the RMS torque that a joint of an inertia in kg·m² takes without friction, N·m."""
        time, velocity = (values[self._steady] for values in self._reference)
        return inertia * rms(np.gradient(velocity, time))

    def removed(self, bare: HandTrial, inertia: float) -> float:
        """Return the share of friction's part in the RMS torque that is removed."""
        return (bare.rms - self.rms) / (bare.rms - inertia)

    def scene(self, colour: str, count: int) -> MovingScene:
        """Return the animation of `count` movements."""
        first = self.movements[1 if count > 1 else 0][0].start
        part = slice(first, self.movements[count if count > 1 else 0][0].stop)
        return MovingScene(self.title, self.time[part] - self.time[first], self.position[part],
                           self.torque[part], colour)


def to_and_fro_report(trials: dict[str, HandTrial], inertia: float) -> Report:
    """Return the report; trials without help first, `inertia` is the RMS without friction, N·m."""
    bare, *others = trials.values()
    page = Report('To and fro, at the tempo of everyday movement',
                  'The same firm hand, joint and movement; only what the motor adds differs')
    page.verdict(f'Without help the hand gives **{number(bare.rms)} N·m** (RMS), where a joint '
                 f'without friction would take {number(inertia)} N·m. ' + '; '.join(
                     f'{one.title}: **{number(one.rms)} N·m**' for one in others) + '.')
    page.movie(moving_joint([one.scene(colour, 2) for one, colour in zip(
        trials.values(), _HAND_COLOURS)]), 'One movement to and fro. The orange arrow is the '
        'torque that the hand applies; the curve below shows it over time.')
    page.figure(loops_figure(trials), 'Torque of the hand over the angle, all movements. The area '
                'is the work that friction takes from the hand.')
    page.table(['', 'RMS (N·m)', 'of friction removed'],
               [[one.title, f'{one.rms:.3f}', f'{100.0 * one.removed(bare, inertia):.0f} %']
                for one in trials.values()])
    return page


@styled
def loops_figure(trials: dict[str, HandTrial]) -> Figure:
    """Draw the torque of the hand over the angle, for each trial."""
    figure, axes = new_figure(1, len(trials), width=10.0, height=3.0, sharex=True, sharey=True,
                              x='angle (deg)', y='torque of the hand (N·m)')
    for axis, one, colour in zip(np.ravel(axes), trials.values(), _HAND_COLOURS):
        part = one._steady
        angle = np.degrees(one.position[part])
        angle = angle - 0.5 * (angle.min() + angle.max())
        loop = thin(angle, one.torque[part], points=400)
        axis.fill(*loop, color=COLOURS[colour], alpha=0.3, linewidth=0)
        axis.plot(*loop, color=COLOURS[colour])
        axis.axhline(0.0, color=COLOURS['grey'], linewidth=0.8)
        axis.set_title(f'{one.title}\n{one.rms:.2f} N·m RMS', color=COLOURS[colour])
    return figure


def intention_report(trials: dict[str, HandTrial]) -> Report:
    """Return the report; for each source of directions its trial, with 'unknown' the first."""
    page = Report('A person moves a joint, and nobody announces where to',
                  'The same person, joint and law; only the source of the direction differs')
    least, most = trials['announced'].peak, trials['unknown'].peak
    page.verdict("Peak of the person's torque: " + '; '.join(
        f'{one.title}: **{number(one.peak)} N·m**' for one in trials.values()) + '.')
    page.movie(moving_joint([one.scene(colour, 1) for one, colour in zip(
        trials.values(), _HAND_COLOURS)]), 'The first movement. The orange arrow is the torque '
        'that the person applies; the curve below shows it over time.')
    page.table(['direction', "peak of the person's torque, N·m",
                'of what an announcement removes'],
               [[one.title, f'{one.peak:.2f}',
                 f'{100.0 * (most - one.peak) / max(most - least, 1e-9):.0f} %']
                for one in trials.values()])
    page.figure(intention_figure(trials), "The person's torque in the first movements, with its "
                'peaks; grey where the movement is shown, orange while a direction d is known.')
    return page


@styled
def intention_figure(trials: dict[str, HandTrial]) -> Figure:
    """Draw torque, peaks and known directions of the first two movements of each trial."""
    figure, axes = new_figure(len(trials), width=8.4, height=1.6, sharex=True, sharey=True,
                              x='time, s', y='N·m')
    size = 1.35 * max(float(np.abs(one.torque).max()) for one in trials.values())
    for axis, one, colour in zip(np.ravel(axes), trials.values(), _HAND_COLOURS):
        # From a second before the first movement, so that all rows begin alike.
        begin = one.time[one.movements[0][0].start] - 1.2
        end = one.time[one.movements[1][0].stop - 1] + 0.3
        shown = (one.time > begin) & (one.time < end)
        time, torque, said = one.time[shown] - begin, one.torque[shown], one.direction[shown]
        for part, sign in one.movements[:2]:
            known = said == sign
            axis.fill_between(time, 0.0, sign * size, where=known, color=COLOURS['orange'],
                              alpha=0.3, linewidth=0, step='post')
            if known.any():
                axis.text(time[known][0] + 0.06, 0.72 * sign * size, f'd = {sign:+.0f}',
                          color=COLOURS['orange'], va='center', fontweight='bold')
            axis.axvspan(one.time[part.start] - begin, one.time[part.stop - 1] - begin,
                         color=COLOURS['grey'], alpha=0.12, linewidth=0)
            top = part.start + int(np.argmax(sign * one.torque[part]))
            axis.plot(one.time[top] - begin, one.torque[top], 'o', color=COLOURS[colour])
            axis.annotate(f'{abs(one.torque[top]):.2f}', (one.time[top] - begin, one.torque[top]),
                          (8, 6 * sign), textcoords='offset points', fontweight='bold',
                          va='center', color=COLOURS[colour])
        axis.plot(*thin(time, torque, points=300), color=COLOURS[colour])
        axis.axhline(0.0, color=_FAINT, linewidth=0.8)
        axis.set_ylim(-size, size)
        axis.set_title(one.title, color=COLOURS[colour])
    return figure


def follow_report(runs: dict[str, dict[float, dict[str, Any]]]) -> Report:
    """Return the report; for each way to compensate, and each speed in rad/s, its run."""
    page = Report('A follower on slow references',
                  'An MIT-mode controller, 500 frames per second, and what is added to its torque')
    speeds = list(next(iter(runs.values())))
    for key, title in (('rms', 'RMS error'), ('stairs', 'height of the stairs')):
        page.table([f'{title}, mrad', *(f'{speed:g} rad/s' for speed in speeds)],
                   [[way, *(f'{1e3 * own[speed][key]:.1f}' for speed in speeds)]
                    for way, own in runs.items()])
    page.figure(_follow_figure(runs), f'Reference (grey) and joint, {_SHOWN:g} rad/s.')
    return page


@styled
def _follow_figure(runs: dict[str, dict[float, dict[str, Any]]]) -> Figure:
    figure, axes = new_figure(1, len(runs), width=10.0, height=2.8, sharex=True, sharey=True,
                              x='time, s', y='angle, deg')
    for axis, (way, own) in zip(np.ravel(axes), runs.items()):
        one = own[_SHOWN]
        axis.plot(*thin(one['time'], np.degrees(one['desired'])), color=_FAINT, linewidth=4.0)
        axis.plot(*thin(one['time'], np.degrees(one['position'])), color=INK)
        axis.set_title(way, fontsize=9)
    return figure
