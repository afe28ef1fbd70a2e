# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool `refine`: parses, and chooses the way."""

from __future__ import annotations

from pathlib import Path

from friction_comp.errors import InputError
from friction_comp.tables.columns import parse_unit, unit_of
from friction_comp.terminal import in_own_units, progress
from friction_comp.tools.common import (
    Arguments,
    given_of,
    positive,
    steady_states,
    whole_number,
    write_results,
)


def refine(argv: list[str] | None = None) -> int:
    """Finds in recordings which effects a model lacks."""
    parser = Arguments(refine, (
        'log.csv --columns time=t,position=q_2,effort=tau_2 --unit position=deg --output refined',
        'examples/elbow --model config/armin_configuration_2.yaml --output output/refined')
    ).add_recordings(unit_help=(
        '; alone, such as A, the unit of the report (A with a torque constant, a gear ratio or a '
        'model, else N·m)')).add_output()
    parser.add_argument('--torque-constant', metavar='KT', type=positive,
                        help='k_t in N·m/A: current is effort / (k_t · n)')
    parser.add_argument('--gear-ratio', metavar='N', type=positive,
                        help='n, motor turns per joint turn')
    parser.add_argument('--jobs', metavar='N', type=whole_number(), help='processes for --each, a '
                        'recording each (as many as processors, where that saves time)')
    parser.add_argument('--model', metavar='FILE', type=Path,
                        help='model to start from, or with the drive alone')
    parser.add_argument('--urdf', metavar='FILE', type=Path,
                        help='URDF of the arm: fit its links, and refine all joints')
    parser.add_argument('--each', action='store_true',
                        help='refine each joint of each recording alone; one page on all')
    parser.add_argument('--scheduler', metavar='ADDRESS',
                        help='Dask scheduler for --each, tcp://host:8786; its workers read the '
                        'same paths')
    arguments = parser.parse(argv)
    arguments.unit, arguments.figures = _units(arguments.unit)
    if arguments.scheduler and (arguments.jobs or not arguments.each):
        raise InputError('--scheduler goes with --each, and without --jobs: Dask decides how many '
                         'recordings are refined at once')
    means = steady_states(arguments)
    if means is not None:
        from friction_comp.tools.refine_forms import refine_table

        return refine_table(arguments, means)
    if arguments.each:
        from friction_comp.tools.refine_forms import refine_each

        return refine_each(arguments)
    if arguments.jobs:
        raise InputError('--jobs goes with --each: several recordings that give one model are '
                         'fitted together')
    if arguments.urdf:
        from friction_comp.tools.refine_forms import refine_whole_arm

        return refine_whole_arm(arguments)
    from friction_comp.tools.recorded_drive import refine_recordings

    names = [str(path) for path in arguments.recordings]
    with progress('reading') as show:
        result = refine_recordings(given_of(arguments), arguments.recordings, show)
        show(0.9, 'writing')
        from friction_comp.reports.refinement_page import refinement_page, terminal_lines

        write_results(arguments, result.content(),
                      refinement_page(result, names, arguments.output), result.model)
    print(*in_own_units(terminal_lines(result, names, arguments.output), result.model.is_linear),
          sep='\n')
    return 0


def _units(text: str | None) -> tuple[str | None, str | None]:
    """Return the units of columns and the unit of the figures, one of which ``--unit`` gives."""
    if not text or '=' in text:
        return text, None
    if ':' in text or (parse_unit(text) and not unit_of('effort', text)):
        raise InputError(f'--unit: {text!r} is no unit of effort; that of a column is given as '
                         f'SIGNAL=UNIT, for instance position={text.split(":")[-1]}')
    return None, text
