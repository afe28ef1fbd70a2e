# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``refine``: finds in recordings which effects a model lacks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from friction_comp.errors import errors_name, InputError
from friction_comp.tools.common import (
    Arguments,
    command_line,
    output_folder,
    positive,
    progress,
    to_json,
)
from friction_comp.tools.recorded_drive import drive_of, layout_of, limited, unit_of
from friction_comp.tools.workers import add_workers


def main(argv: list[str] | None = None) -> int:
    """Refine a model and write report.json, report.html and model.yaml; returns 0.

    Raises
    ------
    InputError
        If recordings, model or output cannot be used.
    """
    parser = Arguments('refine', __doc__, (
        'examples/elbow --model config/armin_configuration_2.yaml --output output/refined',
        'examples/elbow --torque-constant 0.119 --gear-ratio 100 --output output/refined',
        'log.csv --columns time=t,position=q_2,velocity=dq_2,effort=tau_2 --unit position=deg '
        '--output output/refined',
        'examples/elbow --each --model config/armin_configuration_2.yaml --output output/each',
        'examples/elbow --model output/refined/model.yaml --history --output output/next')
    ).add_recordings(unit_help=(
        '. A unit alone, such as A or V, is that of the figures in the report; by default A where '
        'a torque constant, a gear ratio or a model is given (1 and 1 say that effort holds '
        'current), else N·m, which is what effort holds by the message')).add_drive(
    ).add_output().add_json()
    parser.add_argument('--model', metavar='FILE', type=Path,
                        help="model to start from; without it the note's sigmoid is fitted first")
    parser.add_argument('--urdf', metavar='FILE', type=Path,
                        help='description of the arm: all joints of the recording are refined, '
                        'beside its weight and inertia (needs Pinocchio)')
    parser.add_argument('--each', action='store_true',
                        help='refine each joint of each recording by itself, in parallel, with '
                        'one page on all; without it, all recordings together give one model')
    parser.add_argument('--history', action='store_true',
                        help='fit what is kept of earlier recordings too, in .history.npz beside '
                        '--model, and write it on beside the new model')
    add_workers(parser)
    parser.add_argument('--current-limit', metavar='A', type=positive,
                        help='largest motor current that may ever be commanded, for the model '
                             'file; by default that of --model, else the largest recorded one')
    arguments = parser.parse(argv)
    if arguments.history and (arguments.model is None or arguments.each or arguments.urdf):
        raise InputError('--history goes with --model, and with one joint: not with --each or '
                         '--urdf')
    if arguments.each:
        from friction_comp.tools.refine_each import refine_each

        return refine_each(arguments)
    if arguments.jobs or arguments.scheduler:
        raise InputError('--jobs and --scheduler go with --each: several recordings that give one '
                         'model are fitted together')
    if arguments.urdf:
        from friction_comp.tools.refine_arm import refine_whole_arm

        return refine_whole_arm(arguments)
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.recordings.condense import read_condensed
    from friction_comp.recordings.history import History
    from friction_comp.refinement import refine
    from friction_comp.reports.refinement_report import refinement_report

    model = FrictionModel.load(arguments.model, arguments.joint) if arguments.model else None
    drive = drive_of(arguments, model)
    history = History.beside(arguments.model, drive) if arguments.history else None
    with progress('reading') as report:
        recordings = read_condensed(
            arguments.recordings, arguments.joint, drive.torque_constant, drive.gear_ratio,
            progress=lambda share: report(0.2 * share), layout=layout_of(arguments))
        unit = unit_of(arguments, model, [info for _, info in recordings])
        recorded = [samples for samples, _ in recordings]
        drive, limit = limited(arguments, drive, recorded)
        if history is not None:
            recorded = history.with_new(recordings)
        with errors_name(arguments.recordings[0]):
            result = refine(
                recorded, model, drive,
                progress=lambda share, name: report(0.2 + 0.7 * share, f'trying {name}'),
                unit=unit)
        # Show what is missing or unusual in a recording together with the result.
        result.report['warnings'].extend(
            f'{info.path}: {note}' for _, info in recordings for note in info.notes)
        report(0.9, 'writing')
        names = [str(path) for path in arguments.recordings]
        result.model.notes = {**result.model.notes, 'refined_from': names, 'unit': unit, **limit}
        with output_folder(arguments.output) as folder:
            (folder / 'report.json').write_text(to_json(result.report), encoding='utf-8')
            refinement_report(result, names, [command_line('refine', argv)]).save(
                folder / 'report.html')
            result.model.save(folder / 'model.yaml')
            if history is not None:
                history.save(folder / 'model.yaml')
    if arguments.json:
        print(to_json(result.report), end='')
        return 0
    print_summary(result.report)
    print(arguments.output / 'report.html')
    return 0


def print_summary(report: dict[str, Any]) -> None:
    """Print what was found, in a few lines."""
    from friction_comp.reports.html import number, quantity

    unit = report['unit']
    print(f"verdict: {report['verdict']}")
    for line in report['reasons']:
        print(f'  {line}')
    for line in report['record_again']:
        print(f'  record: {line}')
    before, after = report['before']['held_out_rmse'], report['after']['held_out_rmse']
    print(f"before: {quantity(before, unit)} RMS on data not fitted ({report['before']['model']})")
    for effect in report['effects']:
        print(f"  + {effect['name']} ({effect['variable']}): "
              f"{quantity(effect['held_out_rmse'], unit)}   {effect['in_words']} (chosen in "
              f"{100 * effect['chosen']:.0f} % of the searches)")
    if not report['effects']:
        print('  no effect beyond the model shows in the recordings')
    print(f"after:  {quantity(after, unit)} RMS on data not fitted; noise floor "
          f"{quantity(report['noise_floor'], unit)}")
    own = report['after']
    print(f"        {quantity(own['worst_part_rmse'], unit)} in the worst part; to expect "
          f"elsewhere: {quantity(own['elsewhere_motion_rmse'], unit)} in motion, "
          f"{quantity(own['elsewhere_rmse'], unit)} with standstill, where friction is whatever "
          'holds the joint')
    for entry in report['unexplained']:
        print(f"unexplained: {entry['variable']} ({number(entry['strength'])} of the remaining "
              'variance)')
    for entry in report['ambiguous']:
        print(f"ambiguous: {' or '.join(entry['between'])}: {entry['why']}")
    for line in report['warnings']:
        print(f'note: {line}')
