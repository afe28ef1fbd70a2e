# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``evaluate``: computes the torque that a person needed in recorded movements."""

from __future__ import annotations

from functools import partial
import os
from pathlib import Path

from friction_comp.parallel import run_each
from friction_comp.tools.common import Arguments, print_results, progress, write_results
from friction_comp.tools.refine_arguments import layout_of

# Bytes to read above which processes save more time than their start takes (40 MB are evaluated in
# a second, a process takes some to start; bench/many_recordings.py): with less two processes are
# slower than one, with more a core stays idle.
_MIN_SHARED = 2_000_000_000


def main(argv: list[str] | None = None) -> int:
    """Write report.json, report.html and repetitions.csv; returns 0."""
    parser = Arguments('evaluate', __doc__, (
        'examples/elbow --output output/evaluation',
        'examples/elbow --model config/armin_configuration_2.yaml --jobs 2 --output output/weeks')
    ).add_recordings().add_output().add_jobs().add_json()
    parser.add_argument(
        '--model', metavar='FILE', type=Path,
        help='model file of one joint or of an arm, to show the missing current, also without a '
        'torque sensor')
    arguments = parser.parse(argv)
    from friction_comp.evaluation.conditions import repetitions_csv
    from friction_comp.evaluation.sessions import evaluate_pieces, pieces_of
    from friction_comp.recordings.sources import size_of

    with progress('reading') as report:
        pieces, failures = pieces_of(arguments.recordings, arguments.joint, layout_of(arguments))
        shared = sum(size_of(piece.path) for piece in pieces) >= _MIN_SHARED
        jobs = arguments.jobs or (os.cpu_count() or 1 if shared else 1)
        evaluations = evaluate_pieces(
            pieces, failures, arguments.model, progress=lambda share: report(
                0.95 * share, f'{round(share * len(pieces))} of {len(pieces)}'),
            run=partial(run_each, jobs=jobs))
        report(0.95, 'writing')
        from friction_comp.reports.evaluation_report import evaluation_report
        from friction_comp.reports.evaluation_words import condition_line, summary

        content = evaluations[0].as_dict()
        if len(evaluations) > 1:
            content['joints'] = [evaluation.as_dict() for evaluation in evaluations]
        write_results(arguments, content, evaluation_report(evaluations),
                      files={'repetitions.csv': repetitions_csv(evaluations)})
    lines = []
    for evaluation in evaluations:
        lines += [f'{evaluation.joint}:'] * (len(evaluations) > 1)
        lines += [*map(condition_line, evaluation.conditions),
                  summary(evaluation).replace('**', '').replace('`', '')]
    lines += [note for note in evaluations[0].notes if note.startswith('left out: ')]
    return print_results(arguments, content, lines)

