# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``history``: shows a drive's friction over all recordings kept with its model file.

``refine --history`` keeps averages of the recordings in MODEL.history.npz, about 200 kB each.
"""

from __future__ import annotations

from pathlib import Path

from friction_comp.errors import InputError
from friction_comp.tools.common import Arguments, print_results, write_results


def main(argv: list[str] | None = None) -> int:
    """Write report.html and report.json; returns 0."""
    parser = Arguments('history', __doc__, (
        'output/next/model.yaml --output output/history',
        "output/next/model.yaml --note 'new grease' --output output/history")).add_output()
    parser.add_argument('model', metavar='MODEL', type=Path,
                        help='model file with a history next to it')
    parser.add_argument('--note', metavar='TEXT',
                        help='remark on maintenance, stored with the date')
    parser.add_argument('--joint', metavar='NAME', help='joint, if the model file has several')
    arguments = parser.parse(argv)
    from friction_comp.evaluation.drive_history import recorded_friction
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.number_text import quantity
    from friction_comp.recordings.history import History
    from friction_comp.reports.history_report import history_report

    model = FrictionModel.load(arguments.model, arguments.joint)
    model.check_joint(arguments.joint, arguments.model)
    history = History.beside(arguments.model, model.drive, model.joint)
    if not history.recordings:
        raise InputError(f'{History.path_of(arguments.model)}: no recordings are kept beside this '
                         'model; `refine --history` keeps them')
    if arguments.note:
        history.note(arguments.note)
        history.save(arguments.model)
    recorded = recorded_friction(history, model)
    if not recorded:
        raise InputError(f'{arguments.model}: in none of the recordings kept does the joint slide')
    unit = model.unit
    content = {'model': str(arguments.model), 'unit': unit,
               'recordings': [vars(one) for one in recorded],
               'notes': [{'day': day, 'text': text} for day, text in history.notes]}
    write_results(arguments, content, history_report(
        str(arguments.model), recorded, history.notes, unit))
    return print_results(arguments, content, [
        f"{one.day}  {100 * one.level:5.1f} ± {196 * one.level_error:.1f} % of the model's friction"
        f'{", an offset included" if one.one_way else ""}, error {quantity(one.error, unit)}  '
        f'{one.name}' for one in recorded]
        + ['An offset counts as friction where the joint moved in one direction only.'] * any(
            one.one_way for one in recorded))
