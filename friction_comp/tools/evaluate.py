# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``evaluate``: computes the torque that a person needed in recorded movements."""

from __future__ import annotations

from friction_comp.terminal import progress
from friction_comp.tools.common import Arguments, layout_of, write_results


def main(argv: list[str] | None = None) -> int:
    """Write report.json, report.html and repetitions.csv; returns 0."""
    arguments = Arguments('evaluate', __doc__, ('examples/elbow --output output/evaluation',)
                          ).add_recordings().add_output().parse(argv)
    from friction_comp.evaluation.conditions import evaluate_recordings, repetitions_csv

    with progress('reading') as report:
        evaluations = evaluate_recordings(
            arguments.recordings, arguments.joint, layout_of(arguments),
            lambda share: report(0.9 * share))
        report(0.9, 'writing')
        from friction_comp.reports.evaluation_page import evaluation_page, terminal_lines

        content = evaluations[0].as_dict()
        if len(evaluations) > 1:
            content['joints'] = [evaluation.as_dict() for evaluation in evaluations]
        write_results(arguments, content, evaluation_page(evaluations),
                      files={'repetitions.csv': repetitions_csv(evaluations)})
    lines = []
    for evaluation in evaluations:
        lines += [f'{evaluation.joint}:'] * (len(evaluations) > 1)
        lines += terminal_lines(evaluation)
    lines += [note for note in evaluations[0].notes if note.startswith('left out: ')]
    print(*lines, arguments.output / 'report.html', sep='\n')
    return 0
