# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``reproduce``: repeats the technical note's experiments on its configurations."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from friction_comp.tools.common import Arguments, output_folder, progress, to_json, whole_number

if TYPE_CHECKING:
    from friction_comp.note.experiment_set import ExperimentOutcome

DESCRIPTION = """Repeat all of the technical note's experiments on simulated joints, and print its
figures beside ours."""


def main(argv: list[str] | None = None) -> int:
    """Repeat the note's experiments and write results.json and report.html; returns 0.

    Raises
    ------
    InputError
        If the output folder cannot be written.
    """
    parser = Arguments('reproduce', DESCRIPTION).add_output()
    parser.add_argument('--cycles', metavar='N', type=whole_number(2), default=200,
                        help='current ramps per direction and configuration (200)')
    parser.add_argument('--seed', metavar='N', type=whole_number(0), default=2,
                        help='seed of noise, scatter and persons (2)')
    arguments = parser.parse(argv)
    from friction_comp.note.experiment_set import run_experiments
    from friction_comp.note.note_report import reproduction_report

    with output_folder(arguments.output) as folder, progress('starting') as report:
        outcomes = run_experiments(arguments.cycles, arguments.seed, report)
        results = {'configurations': {
            str(outcome.experiment.number): outcome.as_dict() for outcome in outcomes}}
        (folder / 'results.json').write_text(to_json(results), encoding='utf-8')
        reproduction_report(outcomes).save(folder / 'report.html')
    _print(outcomes)
    print(arguments.output / 'report.html')
    return 0


def _print(outcomes: list[ExperimentOutcome]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title='The note and its repetition (the note in brackets)')
    for heading in ('', *(f'configuration {o.experiment.number}' for o in outcomes)):
        table.add_column(heading, justify='left' if not heading else 'right')
    for name, cells in summary_rows(outcomes):
        table.add_row(name, *cells)
    Console().print(table)


def summary_rows(outcomes: list[ExperimentOutcome]) -> list[tuple[str, list[str]]]:
    """Return the rows of the table that is printed: a name, and one text per configuration."""
    def row(name: str, text: Callable[[ExperimentOutcome], str]) -> tuple[str, list[str]]:
        return name, [text(outcome) for outcome in outcomes]

    return [
        row('breakaway (mA)', lambda o: (
            f'{_mean(o):.1f} ± {_std(o):.1f} '
            f'({1e3 * o.experiment.breakaway:.1f} ± {1e3 * o.experiment.breakaway_std:.1f})')),
        row('peak, no compensation (N·m)', lambda o: f'{o.peaks["none"]:.2f}'),
        row('peak, d = 0 (N·m)', lambda o: (
            f'{o.peaks["kinetic"]:.2f} ({o.experiment.peak_kinetic})')),
        row('peak, printed law (N·m)', lambda o: (
            f'{o.peaks["paper"]:.2f} ({o.experiment.peak_compensated})')),
        row('peak, continuous law (N·m)', lambda o: f'{o.peaks["continuous"]:.2f}'),
        row('peak, inertia alone (N·m)', lambda o: f'{o.peaks["inertia"]:.2f}'),
        row('reduction, printed law', lambda o: (
            f'{100 * o.reduction("paper"):.0f} % ({100 * o.experiment.reduction:.0f} %)')),
        row('reduction, continuous law', lambda o: f'{100 * o.reduction("continuous"):.0f} %'),
        row('false starts in an hour, printed / continuous', lambda o: (
            f'{o.standstills["paper"].false_starts} / '
            f'{o.standstills["continuous"].false_starts}')),
    ]


def _mean(outcome: ExperimentOutcome) -> float:
    both = outcome.breakaway
    return 500.0 * (both.positive_mean - both.negative_mean)


def _std(outcome: ExperimentOutcome) -> float:
    both = outcome.breakaway
    return 500.0 * (both.positive_std + both.negative_std)
