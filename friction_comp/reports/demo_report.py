# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The main page of the demo: the effect of compensation and of the refined model."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure
import numpy as np

from friction_comp.evaluation.conditions import evaluate
from friction_comp.model.friction_model import FrictionModel
from friction_comp.number_text import number
from friction_comp.refinement.result import FoundEffect, RefineResult
from friction_comp.reports.evaluation_words import peak_text
from friction_comp.reports.figures import band, COLOURS, curve, new_figure, styled
from friction_comp.reports.html import Report
from friction_comp.reports.refinement_figures import residual_figure
from friction_comp.reports.refinement_report import effect_names, formula, limitations, model_words
from friction_comp.samples import Samples

_COLOURS = ('grey', 'violet', 'blue', 'green')


class EvaluatedTrial:
    """One recorded trial, evaluated on its own; `title` is its name in the report."""

    def __init__(self, name: str, title: str, samples: Samples) -> None:
        self.name, self.title = name, title
        self.evaluation = evaluate([samples], [name])
        conditions = self.evaluation.conditions
        # Means over both movements, N·m. Where the joint was stuck, the peak is a lower bound.
        self.peak_torque = float(np.mean([c.peak_torque for c in conditions]))
        self.rms_torque = float(np.mean([c.rms_torque for c in conditions]))
        self.stuck = sum(c.stuck for c in conditions)
        self.false_starts = sum(c.false_starts for c in conditions)

    def half_interval(self, name: str) -> float | None:
        """Return half the 95 % interval of a measure's mean over both movements, if known."""
        conditions = self.evaluation.conditions
        halves = [half for c in conditions if name in c.figures
                  and (half := c.figures[name].half) is not None]
        complete = len(halves) == len(conditions)
        return float(np.hypot.reduce(halves)) / len(halves) if complete else None

    @property
    def peak(self) -> str:
        """Peak torque in N·m as text."""
        return peak_text(self.peak_torque, self.stuck)


def residuals(refined: RefineResult) -> tuple[float, float]:
    """Return the model's error on data not fitted before and after refinement, A."""
    return refined.report.before.held_out_rmse, refined.report.after.held_out_rmse


def table_rows(trials: list[EvaluatedTrial], refined: RefineResult) -> list[list[str]]:
    """Return the rows of the demo's table: name, peak and RMS torque (N·m), error (mA)."""
    before, after = (number(1e3 * value) for value in residuals(refined))
    errors = {'compensated': before, 'refined': after}
    return [[trial.title, trial.peak, number(trial.rms_torque),
             errors.get(trial.name, '')] for trial in trials]


@styled
def torque_figure(trials: list[EvaluatedTrial]) -> Figure:
    """Draw the back-driving torque of all trials, movements side by side."""
    figure, axes = new_figure(1, 2, width=8.4, height=3.4, sharey='row',
                              x='time since the movement began (s)', y='back-driving torque (N·m)')
    for axis, movement in zip(axes, ('positive', 'negative')):
        for trial, colour in zip(trials, _COLOURS):
            for condition in trial.evaluation.conditions:
                if condition.movement == movement:
                    band(axis, condition.time, condition.torque, condition.torque_std,
                         colour, trial.title)
        axis.axhline(0.0, color=COLOURS['grey'], linewidth=0.8)
        axis.set_title(f'Movement in the {movement} direction')
    axes[0].legend(loc='best')
    return figure


@styled
def identification_figure(model: FrictionModel) -> Figure:
    """Draw look-up table, fitted curve and breakaway currents."""
    figure, axes = new_figure(height=3.2, x='joint velocity (rad/s)', y='motor current (mA)')
    table, breakaway = model.lookup_table, model.breakaway
    # An identified model has both.
    assert table is not None
    assert breakaway is not None
    speeds, currents = np.array(table['speeds']), np.array(table['currents'])
    fine = np.linspace(1.05 * speeds.min(), 1.05 * speeds.max(), 801)
    curve(axes, fine, 1e3 * model.sigmoid(fine), 'blue', 'fitted curve')
    curve(axes, speeds, 1e3 * currents, 'orange', 'look-up table', 'o')
    axes.errorbar(
        [0.0, 0.0], [1e3 * breakaway.positive_mean, 1e3 * breakaway.negative_mean],
        [1e3 * breakaway.positive_std, 1e3 * breakaway.negative_std], fmt='s', capsize=4,
        color=COLOURS['green'], label='breakaway')
    axes.legend(loc='upper left')
    return figure


def demo_report(trials: list[EvaluatedTrial], refined: RefineResult, model: FrictionModel,
                undeclared: str | Path) -> Report:
    """Return the page.

    The four trials are without compensation, with the kinetic term, compensated, and with the
    refined model. `model` is the identified one; `undeclared` has what only the simulation knew.
    """
    _, kinetic, compensated, last = trials
    before, after = residuals(refined)
    effects = refined.report.effects
    page = Report('The whole loop, on a simulated joint',
                  'Identify, compensate, evaluate, refine, compensate again')
    page.verdict(_summary(trials, effects))
    page.numbers([
        (f'{kinetic.peak} N·m', 'to start the joint, direction unknown (d = 0)'),
        (f'{compensated.peak} N·m', 'with the direction known (d = ±1)'),
        (f'{last.peak} N·m', 'with the refined model as well'),
        (f'{number(1e3 * before)} → {number(1e3 * after)} mA', 'model error, by refinement')])
    page.table(
        ['', 'peak (N·m)', '±', 'RMS (N·m)', '±', 'model error (mA)'],
        [[name, peak, number(trial.half_interval('peak_torque'), 2), rms,
          number(trial.half_interval('rms_torque'), 2), error]
         for trial, (name, peak, rms, error) in zip(trials, table_rows(trials, refined))],
        'Back-driving torque: peak of the ensemble average, and RMS during movement, each averaged '
        "over both directions, with half the 95 % interval of the repetitions' mean (±). Model "
        'error: on data not fitted.')
    page.figure(torque_figure(trials), 'Back-driving torque of all trials, mean and standard '
                'deviation over the repetitions.')
    page.heading('Identified')
    page.text('Constant velocities in both directions give the kinetic friction, and slow current '
              'ramps give the breakaway friction. The simulated joint also has effects that this '
              f'procedure does not measure: those in `{Path(undeclared).name}`.')
    page.figure(identification_figure(model), 'Friction curve and breakaway currents as the '
                'identification action measured them.')
    page.heading('What the model lacked')
    page.table(['effect', 'depends on', 'error with it (mA)', 'description'],
               [[effect.name.replace('_', ' '), effect.variable,
                 1e3 * effect.held_out_rmse, effect.in_words]
                for effect in effects] or [['none', '', None, '']])
    for name, label in (('position', 'position (rad)'), ('velocity', 'velocity (rad/s)')):
        page.figure(residual_figure(refined, name, label), f'Residual over {name}.')
    page.heading('The refined model')
    page.bullets(model_words(refined.model))
    page.code(formula(refined.model))
    page.heading('What the recordings cannot tell')
    page.bullets(limitations(refined.report))
    return page


def _summary(trials: list[EvaluatedTrial], effects: list[FoundEffect]) -> str:
    none, kinetic, compensated, last = trials
    more, stuck = ('', '') if not none.stuck else (
        'more than ', f' (the joint did not move in {none.stuck} of '
        f'{sum(c.repetitions for c in none.evaluation.conditions)} movements)')
    refined = 'The recordings show no effect that the identified model lacks.'
    if effects:
        named = effect_names(effect.name for effect in effects)
        refined = (f'With the effects that the recordings show in addition ({named}) it is '
                   f'**{last.peak} N·m**.')
    starts = sum(trial.false_starts for trial in trials)
    return (
        f'Without compensation the person needs {more}**{number(none.peak_torque)} N·m**{stuck} '
        'to set the joint in motion. Compensating kinetic friction alone leaves '
        f'{kinetic.peak} N·m, since the direction of friction is unknown before the joint moves. '
        f'With the direction known it is **{compensated.peak} N·m**. {refined} ' + (
            f'In {starts} movements the joint started before the person pushed.' if starts else
            'In no trial did the joint start by itself.'))
