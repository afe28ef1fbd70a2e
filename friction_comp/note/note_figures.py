# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The note's figures 2, 4 and 5, and two of our own, drawn from outcomes."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from friction_comp.reports.figures import band, COLOURS, new_figure, styled, thin

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from friction_comp.evaluation.conditions import Condition
    from friction_comp.note.condition_runs import ConditionRun
    from friction_comp.note.experiment_set import ExperimentOutcome

_TRIALS = (('kinetic', 'grey', 'd = 0'), ('paper', 'orange', 'd = ±1, printed law'),
           ('continuous', 'blue', 'd = ±1, continuous law'), ('inertia', 'green', 'inertia alone'))
_LAWS = (('paper', 'orange', 'printed law'), ('continuous', 'blue', 'continuous law'))


@styled
def ramp_figure(outcome: ExperimentOutcome) -> Figure:
    """Fig. 2: current ramp, velocity, and the instants at which the joint breaks free."""
    ramps = outcome.ramps
    figure, (upper, lower) = new_figure(2, 1, height=2.1, sharex=True)
    # Velocity as seen by eye: over 20 ms, not from count to count.
    window = 20
    speed = np.zeros(len(ramps.time))
    speed[window:] = (ramps.position[window:] - ramps.position[:-window]) / (
        ramps.time[window:] - ramps.time[:-window])
    time, current, speed = thin(ramps.time, 1e3 * ramps.current, np.degrees(speed))
    upper.plot(time, current, color=COLOURS['blue'], linewidth=0.8)
    upper.set_ylabel('motor current (mA)')
    lower.plot(time, speed, color=COLOURS['orange'])
    lower.set_ylabel('velocity (deg/s)')
    lower.set_xlabel('time (s)')
    records = ramps.records
    for k in range(min(2, len(records))):
        for axes in (upper, lower):
            axes.axvline(records.time[k], color=COLOURS['grey'], linestyle='--', linewidth=1.0)
        upper.annotate(f'{1e3 * records.current[k]:.1f} mA',
                       (records.time[k], 1e3 * records.current[k]), xytext=(6, 0),
                       textcoords='offset points', fontsize=8.5)
    return figure


@styled
def friction_figure(outcomes: list[ExperimentOutcome]) -> Figure:
    """Fig. 4: look-up table, fit and breakaway of every configuration."""
    figure, axes = new_figure(1, 1, height=4.2)
    for outcome, colour in zip(outcomes, ('blue', 'green', 'orange')):
        speeds = np.degrees([point.speed for point in outcome.table.points])
        currents = [1e3 * point.current for point in outcome.table.points]
        fine = np.linspace(-105.0, 105.0, 1001)
        number = outcome.experiment.number
        axes.plot(speeds, currents, 'o', markersize=3.5, color=COLOURS[colour],
                  label=f'configuration {number}: table')
        axes.plot(fine, 1e3 * outcome.model.sigmoid(np.radians(fine)), color=COLOURS[colour],
                  linewidth=1.0, label='fit of Eq. 6')
        both = outcome.breakaway
        axes.errorbar(
            [0.0, 0.0], [1e3 * both.positive_mean, 1e3 * both.negative_mean],
            [1e3 * both.positive_std, 1e3 * both.negative_std], fmt='_', markersize=14,
            color=COLOURS[colour], capsize=3, label='breakaway ± standard deviation')
    axes.set_xlabel('joint velocity (deg/s)')
    axes.set_ylabel('motor current (mA)')
    axes.legend(ncols=3, loc='upper left', fontsize=7.5)
    return figure


@styled
def trial_figure(outcomes: list[ExperimentOutcome]) -> Figure:
    """Fig. 5: trajectories and back-driving torques, mean and standard deviation."""
    figure, rows = new_figure(len(outcomes) + 1, 2, height=2.3, sharex='col')
    for column, name in enumerate(('positive', 'negative')):
        for outcome, colour in zip(outcomes, ('blue', 'green', 'orange')):
            condition = _condition(outcome.trials['continuous'], name)
            if condition.reference is not None:
                rows[0][column].plot(
                    *thin(condition.time, np.degrees(condition.reference)),
                    color=COLOURS['grey'], linestyle='--', linewidth=1.0)
            band(rows[0][column], condition.time, np.degrees(condition.position),
                 np.degrees(condition.position_std), colour,
                 f'configuration {outcome.experiment.number}')
        rows[0][column].set_title(f'{name} direction')
        for row, outcome in zip(rows[1:], outcomes):
            for trial, colour, label in _TRIALS:
                condition = _condition(outcome.trials[trial], name)
                band(row[column], condition.time, condition.torque, condition.torque_std, colour,
                     label)
            row[column].set_title(f'configuration {outcome.experiment.number}')
        rows[-1][column].set_xlabel('time since the movement began (s)')
    rows[0][0].set_ylabel('position (deg)')
    rows[0][0].legend()
    for row in rows[1:]:
        row[0].set_ylabel('τ$_b$ (N·m)')
    rows[1][0].legend(fontsize=7.5)
    return figure


@styled
def gain_figure(outcomes: list[ExperimentOutcome]) -> Figure:
    """Peak torque and false starts against the breakaway gain, safe region marked."""
    figure, rows = new_figure(2, len(outcomes), height=2.4, sharex=True, squeeze=False)
    for column, outcome in enumerate(outcomes):
        upper, lower = rows[0][column], rows[1][column]
        for law, colour, label in _LAWS:
            gains, peaks, starts, tried = (np.array(a) for a in zip(*outcome.sweep[law]))
            upper.plot(gains, peaks, 'o-', markersize=3.5, color=COLOURS[colour], label=label)
            lower.plot(gains, 100.0 * starts / tried, 'o-', markersize=3.5,
                       color=COLOURS[colour], label=label)
            limit, bottom = safe_gain(outcome, law), 0.0 if law == 'paper' else 0.03
            for axes in (upper, lower) if limit is not None else ():
                # The safe region of each law as a strip at the bottom of the axes.
                axes.axvspan(gains[0], limit, ymin=bottom, ymax=bottom + 0.03,
                             color=COLOURS[colour], alpha=0.6, linewidth=0)
        for axes in (upper, lower):
            axes.axvline(0.9, color=COLOURS['grey'], linestyle='--', linewidth=1.0)
        upper.set_title(f'configuration {outcome.experiment.number}')
        upper.set_ylim(bottom=0.0)
        lower.set_ylim(-6.0, 106.0)
        lower.set_xlabel('breakaway gain')
    rows[0][0].set_ylabel('peak torque (N·m)')
    rows[1][0].set_ylabel('false starts [%]')
    rows[0][0].legend(fontsize=7.5)
    return figure


@styled
def mechanism_figure(outcomes: list[ExperimentOutcome]) -> Figure:
    """Peak with d = 0 when slow motion gets no kinetic compensation."""
    figure, columns = new_figure(1, len(outcomes), height=2.6, squeeze=False)
    for axes, outcome in zip(columns[0], outcomes):
        speeds, peaks = (np.array(a) for a in zip(*outcome.dead))
        axes.plot(np.degrees(speeds), peaks, 'o-', color=COLOURS['blue'], markersize=3.5)
        level = outcome.breakaway.positive_mean * outcome.model.drive.torque_per_current
        axes.axhline(level, color=COLOURS['grey'], linestyle='--', linewidth=1.0)
        axes.annotate('breakaway torque', (np.degrees(speeds[-1]), level), xytext=(0, -11),
                      textcoords='offset points', fontsize=8, ha='right')
        axes.set_ylim(0.0, 1.15 * max(level, peaks.max()))
        axes.set_title(f'configuration {outcome.experiment.number}')
        axes.set_xlabel('left out up to (deg/s)')
    columns[0][0].set_ylabel('peak torque, d = 0 (N·m)')
    return figure


def safe_gain(outcome: ExperimentOutcome, law: str) -> float | None:
    """Return the largest gain of the sweep below which no start was false; None if none is."""
    safe = itertools.takewhile(lambda entry: not entry[2], outcome.sweep[law])
    return max((gain for gain, *_ in safe), default=None)


def _condition(trial: ConditionRun, name: str) -> Condition:
    return next(c for c in trial.evaluation.conditions if c.movement == name)
