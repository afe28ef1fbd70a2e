# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The report of a drive's history: friction, error and temperature of each recording."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
import numpy as np

from friction_comp.evaluation.drive_history import RecordedFriction
from friction_comp.number_text import quantity
from friction_comp.reports.figures import COLOURS, curve, new_figure, styled
from friction_comp.reports.html import Report

# Largest number of dates on the axis of the figure.
_MOST_LABELS = 16


def history_report(model: str, recordings: Sequence[RecordedFriction],
                   notes: Sequence[tuple[str, str]], unit: str = 'A') -> Report:
    """Return the report on recordings in order of date; `notes` are pairs of ISO date and text."""
    first, last = recordings[0], recordings[-1]
    plural = 's' * (len(recordings) != 1)
    report = Report('History of a drive', f'{model}, {len(recordings)} recording{plural} from '
                    f'{first.day} to {last.day}')
    text = f"In the latest recording, friction is **{100 * last.level:.0f} %** of the model's"
    if len(recordings) > 1:
        text += f'; in the first it was {100 * first.level:.0f} %'
    report.verdict(f"{text}. The model's error in the latest is {quantity(last.error, unit)} RMS.")
    listed = '; '.join(f'{note} ({day})' for day, note in notes)
    scale, shown = (1e3, 'mA') if unit == 'A' else (1.0, unit)
    errors = [scale * recording.error for recording in recordings]
    if any(recording.one_way for recording in recordings):
        report.text('In ' + ', '.join(one.name for one in recordings if one.one_way) + ' the joint '
                    'moved in one direction only: an offset counts as friction there.')
    report.figure(_figure(recordings, notes, errors, shown), 'Each dot is a recording; bars are '
                  '95 % intervals.' + (f' Dashed lines: {listed}.' if listed else ''))
    report.table(['recording', 'date', 'data kept (s)', 'friction (% of the model)',
                  f'error ({shown})', 'motor (°C)'],
                 [[recording.name, recording.day, round(recording.seconds),
                   round(100.0 * recording.level, 1), error, recording.temperature]
                  for recording, error in zip(recordings, errors)])
    return report


@styled
def _figure(recordings: Sequence[RecordedFriction], notes: Sequence[tuple[str, str]],
            errors: Sequence[float], unit: str) -> Figure:
    warm = [recording.temperature for recording in recordings]
    labels = ['friction\n(% of the model)', f'error ({unit})', 'motor (°C)']
    rows = 2 + any(value is not None for value in warm)
    figure, axes = new_figure(rows, height=2.1, y=labels[:rows], sharex=True)
    order = np.arange(1, len(recordings) + 1)
    axes[0].errorbar(order, [100.0 * recording.level for recording in recordings],
                     [196.0 * recording.level_error for recording in recordings], fmt='o',
                     color=COLOURS['blue'], capsize=3)
    axes[0].axhline(100.0, color=COLOURS['grey'], linewidth=0.8)
    curve(axes[1], order, errors, 'orange', style='o')
    axes[1].set_ylim(0.0, 1.2 * max(errors))
    if rows == 3:
        curve(axes[2], order, np.array(warm, dtype=float), 'red', style='o')
    for day, _ in notes:
        before = sum(recording.day < day for recording in recordings)
        for each in axes:
            each.axvline(before + 0.5, color=COLOURS['violet'], linestyle='--', linewidth=1.0)
    step = -(-len(recordings) // _MOST_LABELS)
    axes[-1].set_xticks(order[::step], [recording.day for recording in recordings[::step]],
                        rotation=30, ha='right')
    return figure
