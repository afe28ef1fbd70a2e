# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The pages of the demo's scenes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
import numpy as np
from scipy.signal import butter, sosfiltfilt

from friction_comp.arm.fit import ArmResult
from friction_comp.evaluation.conditions import Evaluation
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.result import RefineResult
from friction_comp.reports import refinement_page
from friction_comp.reports.evaluation_page import evaluation_page
from friction_comp.reports.figures import COLOURS, curve, legend, panels, styled, thin, zero
from friction_comp.reports.html import Report, value
from friction_comp.samples import Samples
from friction_comp.statistics import rms

# Of the hand's ways, in their order.
_HAND_COLOURS = ('no help', 'other', 'unknown', 'known')


# The main scene.

def loop_page(evaluation: Evaluation, refined: RefineResult, model: FrictionModel,
              undeclared: str | Path) -> Report:
    """Return the page of `evaluate` with what was identified and refined.

    `model` is the identified one; `undeclared` has what only the simulation knew.
    """
    report = refined.report
    page = evaluation_page([evaluation])
    page.title, page.subtitle = ('The whole loop, on a simulated joint',
                                 'Identify, compensate, evaluate, refine, compensate again')
    page.heading('Identified')
    page.text('Constant velocities in both directions give the kinetic friction, and slow current '
              'ramps give the breakaway friction. The simulated joint also has effects that this '
              f'procedure does not measure: those in `{Path(undeclared).name}`.')
    page.figure(_identified_figure(model), 'Dots: look-up table; line: friction curve; squares: '
                'breakaway, with its standard deviation.')
    page.heading('Found in the recording of the identification')
    page.numbers([(value(key, text), name) for key, name, text in refinement_page.errors(report)])
    page.table(['', 'value', '95 % interval'],
               refinement_page.number_rows([
                   row for row in (*refinement_page.friction_rows(report.friction),
                                   *refinement_page.effect_rows(report))
                   if row.key != 'breakaway']))     # measured: in the figure above
    page.bullets(refinement_page.remarks(report))
    return page


@styled
def _identified_figure(model: FrictionModel) -> Figure:
    figure, (axes,) = panels(['motor current (mA)'], 'joint velocity (rad/s)', 2.6)
    table, breakaway = model.lookup_table, model.breakaway
    # An identified model has both.
    assert table is not None
    assert breakaway is not None
    speeds, currents = np.array(table['speeds']), np.array(table['currents'])
    fine = np.linspace(1.05 * speeds.min(), 1.05 * speeds.max(), 801)
    curve(axes, fine, 1e3 * model.sigmoid(fine), 'predicted', 'friction curve')
    curve(axes, speeds, 1e3 * currents, 'measured', 'look-up table', 'o')
    axes.errorbar(
        [0.0, 0.0], [1e3 * breakaway.positive_mean, 1e3 * breakaway.negative_mean],
        [1e3 * breakaway.positive_std, 1e3 * breakaway.negative_std], fmt='s', capsize=4,
        color=COLOURS['measured'], label='breakaway')
    legend(axes)
    return figure


# A hand that goes to and fro.

class HandTrial:
    """One recorded exercise: what the hand gave in each movement; `title` is its name."""

    def __init__(self, title: str, samples: Samples) -> None:
        self.title, self.time, self.position = title, samples.time, samples.position
        # The recorder may have begun before the exercise.
        velocity = np.nan_to_num(np.asarray(samples.reference_velocity, dtype=float))
        rate = 1.0 / float(np.median(np.diff(self.time)))
        torque = np.nan_to_num(np.asarray(samples.load, dtype=float))
        # Steps of the reference are above 20 Hz.
        self.torque = sosfiltfilt(butter(2, 20.0, fs=rate, output='sos'), torque)
        way = np.sign(velocity)
        starts = np.flatnonzero(np.diff(way, prepend=0.0, append=0.0))
        self._reference = self.time, velocity
        moved = [slice(a, b) for a, b in zip(starts, starts[1:]) if way[a] != 0.0]
        # All movements but the first and the last.
        self.steady = slice(moved[1].start, moved[-2].stop)

    @property
    def rms(self) -> float:
        """RMS torque of a movement to and fro, N·m, without its beginning and its end."""
        return rms(self.torque[self.steady])

    def inertial_rms(self, inertia: float) -> float:
        """Return the RMS torque that a joint of an inertia in kg·m² takes without friction, N·m."""
        time, velocity = (values[self.steady] for values in self._reference)
        return inertia * rms(np.gradient(velocity, time))

    def removed(self, bare: HandTrial, inertia: float) -> float:
        """Return the share of friction's part in the RMS torque that is removed."""
        return (bare.rms - self.rms) / (bare.rms - inertia)


def to_and_fro_page(trials: dict[str, HandTrial], inertia: float) -> Report:
    """Return the page; trials without help first, `inertia` is the RMS without friction, N·m."""
    bare, *others = trials.values()
    shown = {one.title: value(one.title, f'{one.rms:.2f} N·m') for one in trials.values()}
    page = Report('To and fro, at the tempo of everyday movement',
                  'The same firm hand, joint and movement; only what the motor adds differs')
    page.verdict(f'Without help the hand gives **{shown[bare.title]}** (RMS), where a joint '
                 f'without friction would take {inertia:.2f} N·m. ' + '; '.join(
                     f'{one.title}: **{shown[one.title]}**' for one in others) + '.')
    page.figure(loops_figure(trials), 'Torque of the hand over the angle, all movements. The area '
                'is the work that friction takes from the hand.')
    page.table(['', 'RMS', 'of friction removed'],
               [[one.title, shown[one.title], f'{100.0 * one.removed(bare, inertia):.0f} %']
                for one in trials.values()])
    return page


@styled
def loops_figure(trials: dict[str, HandTrial]) -> Figure:
    """Draw the torque of the hand over the angle, for each trial."""
    figure, axes = panels(['torque (N·m)'] * len(trials), 'angle (deg)', 1.35)
    for axis, one, colour in zip(axes, trials.values(), _HAND_COLOURS):
        angle = np.degrees(one.position[one.steady])
        angle = angle - 0.5 * (angle.min() + angle.max())
        loop = thin(angle, one.torque[one.steady], points=400)
        axis.fill(*loop, color=COLOURS[colour], alpha=0.3, linewidth=0)
        axis.plot(*loop, color=COLOURS[colour])
        zero(axis)
        axis.text(0.01, 0.95, f'{one.title}: {one.rms:.2f} N·m RMS', transform=axis.transAxes,
                  color=COLOURS[colour], va='top', fontweight='bold')
    limit = max(float(np.abs(one.torque[one.steady]).max()) for one in trials.values())
    for axis in axes:
        axis.set_ylim(-1.1 * limit, 1.6 * limit)     # with room for the title
    return figure


# An arm that is taught.

def peaks_of(alone: Mapping[str, Samples], helped: Mapping[str, Samples]
             ) -> dict[str, dict[str, dict[str, float]]]:
    """Return the person's RMS and peak torque by joint and recording, N·m."""
    return {joint: {
        name: {'rms': rms(load), 'peak': float(np.abs(load).max())}
        for name, load in (('alone', np.asarray(alone[joint].load)),
                           ('helped', np.asarray(helped[joint].load)))} for joint in alone}


def arm_page(alone: Mapping[str, Samples], helped: Mapping[str, Samples], result: ArmResult
             ) -> Report:
    """Return the page on a taught exercise."""
    peaks = peaks_of(alone, helped)
    page = Report('A person teaches an arm, and moves it without help and with it',
                  'Three joints, moved by MuJoCo')
    total = {name: np.sqrt(sum(peak[name]['rms'] ** 2 for peak in peaks.values()))
             for name in ('alone', 'helped')}
    page.verdict("With the arm's weight and friction compensated by the motors, guiding it takes "
                 f'**{100 * (1 - total["helped"] / total["alone"]):.0f} % less** torque from '
                 'the person (RMS of all joints).')

    def shown(joint: str, way: str, figure: str) -> str:
        return value(f'{joint}, {way}, {figure}', f'{peaks[joint][way][figure]:.2f} N·m')
    page.figure(_torque_figure(alone, helped), 'Torque of the person at each joint.')
    page.table(['joint', 'RMS alone', 'helped', 'peak alone', 'helped', 'added to the model'],
               [[joint, *(shown(joint, way, figure) for figure in ('rms', 'peak')
                          for way in ('alone', 'helped')),
                 refinement_page.effect_names(
                     effect.name for effect in result.results[joint].report.effects)]
                for joint in peaks])
    page.table(['link after joint', 'mass in the URDF (kg)', 'mass found (kg)'],
               [[body['joint'], body['mass_urdf'], body['mass']]
                for body in result.report()['rigid_bodies']],
               'The load on the cuff is not in the URDF. Only sums of masses along the arm are '
               'certain.')
    return page


@styled
def _torque_figure(alone: Mapping[str, Samples], helped: Mapping[str, Samples]) -> Figure:
    figure, axes = panels([f'{joint} (N·m)' for joint in alone], 'time (s)', 1.3)
    for axis, joint in zip(axes, alone):
        for recorded, colour, name in ((alone, 'no help', 'without help'),
                                       (helped, 'known', 'with help')):
            samples: Any = recorded[joint]
            time, load = thin(samples.time - samples.time[0], samples.load)
            curve(axis, time, load, colour, name)
    legend(axes[0])
    return figure
