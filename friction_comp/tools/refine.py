# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``refine``: finds in recordings which effects a model lacks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from friction_comp.errors import InputError
from friction_comp.tools.common import (
    Arguments,
    output_folder,
    positive,
    progress,
    to_json,
    write_report,
)
from friction_comp.tools.recorded_drive import refine_recordings


def main(argv: list[str] | None = None) -> int:
    """Refine a model and write report.json, report.html and model.yaml; returns 0."""
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
    ).add_output().add_jobs().add_json()
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
    if arguments.jobs:
        raise InputError('--jobs goes with --each: several recordings that give one model are '
                         'fitted together')
    if arguments.urdf:
        from friction_comp.tools.refine_arm import refine_whole_arm

        return refine_whole_arm(arguments)
    from friction_comp.reports.refinement_report import refinement_report

    names = [str(path) for path in arguments.recordings]
    with progress('reading') as show:
        result, history = refine_recordings(
            arguments, arguments.recordings, arguments.joint, show)
        show(0.9, 'writing')
        with output_folder(arguments.output) as folder:
            write_report(folder, result.report, refinement_report(
                result, names, [arguments.command]))
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
