# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``refine --each``: refines many recordings and joints separately."""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from functools import partial
import os
from pathlib import Path
import time
from typing import Any, TYPE_CHECKING

from friction_comp.errors import InputError
from friction_comp.files import encodable, to_yaml
from friction_comp.parallel import Failure, interrupts_deferred, run_each
from friction_comp.tools.common import output_folder, progress, to_json, write_report
from friction_comp.tools.recorded_drive import folder_names, layout_of, refine_recordings

if TYPE_CHECKING:
    from friction_comp.evaluation.sessions import Piece

# Number of recordings from which processes save more time than their start takes: some seconds of
# processor time each, as much as a few short recordings take.
MIN_SHARED = 8


def refine_each(arguments: Namespace) -> int:
    """Refine each joint of each recording; write a folder for each, and one page on all.

    Each folder is written as soon as its joint is refined, whole or not at all: neither an
    interrupt nor an unusable recording affects the others. Returns 0, or 130 if interrupted.
    """
    if arguments.urdf:
        raise InputError('--each and --urdf exclude each other: the links are fitted once for all')
    from friction_comp.evaluation.sessions import pieces_of
    from friction_comp.reports.refinement_overviews import each_report

    begin = time.monotonic()
    rows: dict[int, dict[str, Any]] = {}
    interrupted = False
    with progress('reading') as show:
        pieces, failures = pieces_of(
            arguments.recordings, arguments.joint, layout_of(arguments))
        failed = [failure.reason for failure in failures]
        folders = _folders(pieces)
        jobs = arguments.jobs or (os.cpu_count() or 1 if len(pieces) >= MIN_SHARED else 1)
        try:
            with closing(run_each(partial(_refine_one, arguments), pieces, jobs)) as outcomes:
                for index, outcome in outcomes:
                    if isinstance(outcome, Failure):
                        failed.append(outcome.reason)
                    else:
                        row, files = outcome
                        # A folder that is written must also be in the page on all.
                        with interrupts_deferred():
                            _write(arguments.output / folders[index], files)
                            rows[index] = {'recording': str(pieces[index].path),
                                           'folder': folders[index], **row}
                    done = len(rows) + len(failed) - len(failures)
                    show(done / len(pieces), f'{done} of {len(pieces)}: {pieces[index]}')
        except KeyboardInterrupt:
            interrupted = True
        if not rows and not interrupted:
            raise InputError(failed[0])
        content = {
            'recordings': [rows[index] for index in sorted(rows)], 'failed': sorted(failed),
            'not_done': len(pieces) + len(failures) - len(rows) - len(failed),
            'seconds': time.monotonic() - begin}
        if rows:
            with output_folder(arguments.output) as folder:
                write_report(folder, content, each_report(content), arguments.command)
    if arguments.json:
        print(to_json(content), end='')
    else:
        _print(content)
        if rows:
            print(arguments.output / 'report.html')
    return 130 if interrupted else 0


def _folders(pieces: Sequence[Piece]) -> list[str]:
    """Return a different folder name for each piece."""
    if not pieces:
        return []
    names: list[str] = []
    above = os.path.commonpath([piece.path.absolute().parent for piece in pieces])
    joints = Counter(piece.path for piece in pieces)
    for piece in pieces:
        name = '_'.join(piece.path.absolute().relative_to(above).with_suffix('').parts)
        names.append(f'{name}_{piece.joint}' if joints[piece.path] > 1 else name)
    return folder_names(names)


def _refine_one(arguments: Namespace, piece: Piece) -> tuple[dict[str, Any], dict[str, str]]:
    """Refine a joint of a recording; return its row of the page on all, and its files by name."""
    from friction_comp.reports.refinement_report import refinement_report

    begin = time.monotonic()
    result, _ = refine_recordings(arguments, [piece.path], piece.joint)
    report = result.report
    page = refinement_report(result, [str(piece.path)])
    page.made_by(arguments.command)
    files = {'report.json': to_json(report), 'model.yaml': to_yaml(result.model.to_dict()),
             'report.html': page.html()}
    row = {
        'joint': report['joint'], 'unit': report['unit'], 'samples': report['samples'],
        'verdict': report['verdict'], 'before': report['before']['held_out_rmse'],
        'after': report['after']['held_out_rmse'], 'noise_floor': report['noise_floor'],
        'effects': [{'name': effect['name'], 'variable': effect['variable']}
                    for effect in report['effects']],
        'unexplained': [entry['variable'] for entry in report['unexplained']],
        'seconds': time.monotonic() - begin}
    return row, files


def _write(path: Path, files: dict[str, str]) -> None:
    with output_folder(path) as folder:
        for name, text in files.items():
            (folder / name).write_text(encodable(text), encoding='utf-8')


def _print(content: dict[str, Any]) -> None:
    from friction_comp.reports.html import number
    from friction_comp.reports.refinement_overviews import verdict

    print(verdict(content).replace('**', ''))
    for row in content['recordings']:
        effects = ', '.join(effect['name'] for effect in row['effects']) or 'nothing'
        print(f"{row['folder']}: {number(row['before'])} → {number(row['after'])} {row['unit']}, "
              f"{row['verdict']}; found: {effects}")
    for reason in content['failed']:
        print(f'left out: {reason}')
