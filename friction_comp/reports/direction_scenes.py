# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The report of the demo's scene in which a hand moves a joint to and fro."""

from __future__ import annotations

from matplotlib.figure import Figure
import numpy as np
from scipy.signal import butter, sosfiltfilt

from friction_comp.number_text import number
from friction_comp.reports.figures import COLOURS, new_figure, styled, thin
from friction_comp.reports.html import Report
from friction_comp.samples import Samples
from friction_comp.statistics import rms

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


def to_and_fro_report(trials: dict[str, HandTrial], inertia: float) -> Report:
    """Return the report; trials without help first, `inertia` is the RMS without friction, N·m."""
    bare, *others = trials.values()
    page = Report('To and fro, at the tempo of everyday movement',
                  'The same firm hand, joint and movement; only what the motor adds differs')
    page.verdict(f'Without help the hand gives **{number(bare.rms)} N·m** (RMS), where a joint '
                 f'without friction would take {number(inertia)} N·m. ' + '; '.join(
                     f'{one.title}: **{number(one.rms)} N·m**' for one in others) + '.')
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
