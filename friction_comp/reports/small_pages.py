# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Pages of one figure: a planned motion, and friction at constant speeds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from friction_comp.excitation.plan import JointPlan, Pair
from friction_comp.model.friction_model import FrictionModel
from friction_comp.number_text import quantity
from friction_comp.reports.figures import COLOURS, curve, measured_and_predicted, panels, styled
from friction_comp.reports.html import Report, value
from friction_comp.reports.refinement_page import add_steps, NAMES, number_rows, number_texts, Row
from friction_comp.samples import Samples


def excitation_page(plans: Sequence[JointPlan]) -> Report:
    """Return the page on a planned motion."""
    seconds = plans[0].seconds
    page = Report('Planned motion', f'{len(plans)} joint{"s" * (len(plans) > 1)}, {seconds:g} s')
    worst = min((share, pair, plan.limits.joint) for plan in plans
                for pair, share in plan.separation.items())
    page.verdict('**Check the motion for collisions, then play `trajectory.yaml`.** Hardest to '
                 f'distinguish: {_pair_text(worst[1])} of joint {worst[2]}; {100 * worst[0]:.2g} % '
                 'of one is independent of the other and of the friction curve.')
    for plan in plans:
        page.heading(f'Joint {plan.limits.joint}')
        page.figure(_plan_figure(plan), 'Position and velocity over time, and velocity over '
                    'position; broken: the limits.')
        page.table(
            ['effects', 'apart'],
            [[_pair_text(pair), f'{100 * share:.2g} %'] for pair, share in plan.separation.items()])
    page.text('The percentage is the part of one effect that is independent of the other: the '
              "smallest for several values of the effects' constants. It depends on the motion "
              'alone; whether `refine` finds an effect also depends on noise and on its size.')
    return page


def _pair_text(pair: Pair) -> str:
    return ' and '.join(pair).replace('_', ' ')


@styled
def _plan_figure(plan: JointPlan) -> Figure:
    motion, limits = plan.samples(50.0), plan.limits
    figure, (place, speed, both) = panels(
        ['position (rad)', 'velocity (rad/s)', 'velocity (rad/s)'],
        ['', 'time (s)', 'position (rad)'], (1.3, 1.3, 1.8))
    curve(place, motion.time, motion.position, 'predicted')
    curve(speed, motion.time, motion.velocity, 'predicted', linewidth=0.9)
    curve(both, motion.position, motion.velocity, 'predicted', style='.', markersize=2.5)
    for end in (limits.lowest, limits.highest):
        place.axhline(end, color=COLOURS['faint'], linestyle='--', linewidth=0.9)
        both.axvline(end, color=COLOURS['faint'], linestyle='--', linewidth=0.9)
    for end in (-limits.velocity, limits.velocity):
        for axes in (speed, both):
            axes.axhline(end, color=COLOURS['faint'], linestyle='--', linewidth=0.9)
    return figure


def steady_state_rows(report: dict[str, Any]) -> list[Row]:
    """Return a row for each number."""
    friction = report['friction']
    return [Row(key, name, *number_texts(
        friction[key], friction['intervals'][key], unit.replace('A', report['unit'], 1)), '')
        for key, (name, unit) in NAMES.items() if friction.get(key) is not None]


def steady_state_page(report: dict[str, Any], model: FrictionModel, speeds: np.ndarray,
                      currents: np.ndarray, name: str, steps: Sequence[tuple[str, str]]) -> Report:
    """Return the page on a table of steady states; `report` is the content of report.json."""
    page = Report(f'Friction of {f"joint {model.joint}" if model.joint else "the joint"} at '
                  'constant speeds', f'{name}: {len(speeds)} speeds', model.is_linear)
    unit = report['unit']
    page.verdict(f'**{report["verdict"][0].upper()}{report["verdict"][1:]}**: '
                 f'{report["reasons"][0]}')
    page.numbers([
        (value('error', quantity(report['after']['held_out_rmse'], unit)),
         'error of each row, predicted by a fit to all others'),
        (value('before', quantity(report['before']['held_out_rmse'], unit)),
         'Coulomb and viscous friction alone')])
    page.bullets(report['reasons'][1:], 'Also:')
    page.table(['friction', 'value', '95 % interval'], number_rows(steady_state_rows(report)))
    add_steps(page, steps)
    page.figure(_steady_figure(model, speeds, currents, unit), 'Dots: the rows of the table; '
                'line: the fitted curve. Below: the difference.')
    page.text('Inertia, weight and breakaway do not show in such a table, and the sign change of '
              'friction is assumed to be faster than the slowest speed.')
    return page


@styled
def _steady_figure(model: FrictionModel, speeds: np.ndarray, currents: np.ndarray, unit: str
                   ) -> Figure:
    def fitted(velocity: np.ndarray) -> np.ndarray:
        return model.current(Samples(np.arange(float(len(velocity))), velocity, velocity,
                                     velocity=velocity))
    top = float(np.max(np.abs(speeds)))
    grid = np.linspace(-top if speeds.min() < 0 else 0.0, top if speeds.max() > 0 else 0.0, 1001)
    return measured_and_predicted(
        (f'friction ({unit})', f'error ({unit})'), 'velocity (rad/s)', (grid, fitted(grid)), 'fit',
        (speeds, currents), currents - fitted(speeds))[0]
