# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page on friction that was fitted to a table of steady states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from friction_comp.model.friction_model import FrictionModel
from friction_comp.number_text import interval_text, number, quantity
from friction_comp.reports.figures import curve, new_figure, styled
from friction_comp.reports.friction_words import NAMES
from friction_comp.reports.html import Report
from friction_comp.samples import Samples


def value_rows(report: dict[str, Any]) -> list[list[str]]:
    """Return name, value with unit, and 95 % interval of each value."""
    friction, unit = report['friction'], report['unit']
    return [[name, f'{number(friction[key], 4)} {own.replace("A", unit, 1)}',
             interval_text(friction['intervals'][key], 4)]
            for key, (name, own) in NAMES.items() if friction.get(key) is not None]


def steady_state_report(report: dict[str, Any], model: FrictionModel, speeds: np.ndarray,
                        currents: np.ndarray, names: Sequence[str]) -> Report:
    """Return the page; `report` is the content of report.json."""
    page = Report('Friction at constant speeds', ', '.join(names), model.is_linear)
    unit = report['unit']
    page.verdict(f'**Verdict: {report["verdict"]}.** {report["reasons"][0]}')
    page.table(['', 'value', '95 % interval'], value_rows(report), 'Friction in sliding')
    page.figure(_figure(model, speeds, currents, unit), 'The rows of the table, and the fitted '
                'curve.')
    page.text(f'Each row predicted by a fit to all others: '
              f'{quantity(report["after"]["held_out_rmse"], unit)} RMS; Coulomb and viscous '
              f'friction alone: {quantity(report["before"]["held_out_rmse"], unit)}. Inertia, '
              'weight and breakaway do not show in such a table, and the sign change of friction '
              'is assumed to be faster than the slowest speed.')
    page.bullets(report['record_again'], 'What to record next:')
    return page


@styled
def _figure(model: FrictionModel, speeds: np.ndarray, currents: np.ndarray, unit: str) -> Figure:
    figure, axes = new_figure(x='velocity (rad/s)', y=f'friction ({unit})')
    top = float(np.max(np.abs(speeds)))
    grid = np.linspace(-top if speeds.min() < 0 else 0.0, top if speeds.max() > 0 else 0.0, 1001)
    fitted = model.current(Samples(np.arange(1001.0), grid, grid, velocity=grid))
    curve(axes, grid, fitted, 'blue', 'fit')
    curve(axes, speeds, currents, 'orange', 'table', 'o')
    axes.legend()
    return figure
