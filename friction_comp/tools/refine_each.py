# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``refine --each``: refines many recordings and joints separately, and compares them."""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
import os
import time
from typing import Any

from friction_comp.errors import InputError
from friction_comp.evaluation.fleet import fleet_json, NUMBERS, populations_of
from friction_comp.files import encodable, output_folder, to_json, to_yaml
from friction_comp.parallel import attempt, Failure, run_each, Runner, runner_on_cluster
from friction_comp.recorded_drive.refine_recordings import refine_recordings
from friction_comp.recordings.reader import Piece, pieces_of
from friction_comp.terminal import number, progress
from friction_comp.tools.common import folder_names, given_of, layout_of, write_results

# Most recordings that get a page each: nobody reads a hundred; refine makes that of any one.
MOST_PAGES = 20


@dataclass(frozen=True)
class _Item:
    """A joint of a recording, the unit (robot) that it is of, and its folder below the output."""

    piece: Piece
    robot: str
    folder: str

    def __str__(self) -> str:
        return str(self.piece)


def refine_each(arguments: Namespace) -> int:
    """Refine each joint of each recording; write a folder for each, and one page on all.

    Each folder is written as soon as its joint is refined, whole or not at all. Returns 0.
    """
    if arguments.urdf:
        raise InputError('--each and --urdf exclude each other: the links are fitted once for all')
    from friction_comp.reports.other_pages import each_page, fleet_verdict, verdict
    from friction_comp.reports.refinement_page import effect_names

    begin = time.monotonic()
    with progress('reading') as show:
        pieces, failures = pieces_of(arguments.recordings, arguments.joint, layout_of(arguments))
        with _runner(arguments, len(pieces)) as run:
            done, failed = _refine(arguments, _items(pieces), run, show)
            failed += failures
            if not done:
                raise InputError(failed[0])
        populations = populations_of(done)
        content: dict[str, Any] = {
            'recordings': done, 'failed': sorted(failed),
            'out': {population.joint: population.out for population in populations},
            'seconds': time.monotonic() - begin}
        files = {'fleet.json': fleet_json(populations)} if populations else {}
        write_results(arguments, content, each_page(content, populations), files=files)
    lines = [verdict(content), *map(fleet_verdict, populations)]
    if len(done) <= MOST_PAGES:
        lines += [f"{row['folder']}: {number(row['before'])} → {number(row['after'])} "
                  f"{row['unit']}, {row['verdict']}; found: "
                  + effect_names(effect['name'] for effect in row['effects'])
                  for row in content['recordings']]
    lines += [f'left out: {reason}' for reason in content['failed']]
    print(*(line.replace('**', '') for line in lines), arguments.output / 'report.html', sep='\n')
    return 0


@contextmanager
def _runner(arguments: Namespace, count: int) -> Iterator[Runner]:
    """Yield a function that does work on the recordings, here, in processes or on a cluster."""
    if arguments.scheduler:
        with runner_on_cluster(arguments.scheduler) as run:
            yield run
    else:
        # From eight on, processes save more time than their start takes, some seconds each.
        yield partial(run_each, jobs=arguments.jobs or (os.cpu_count() or 1 if count >= 8 else 1))


def _items(pieces: Sequence[Piece]) -> list[_Item]:
    """Return pieces with units, by the folder that holds all, and a different folder for each."""
    paths = [piece.path.absolute() for piece in pieces]
    above = os.path.commonpath([path.parent for path in paths]) if paths else ''
    places = [path.relative_to(above).with_suffix('').parts for path in paths]
    joints = Counter(piece.path for piece in pieces)
    folders = folder_names(
        '_'.join(place) + (f'_{piece.joint}' if joints[piece.path] > 1 else '')
        for piece, place in zip(pieces, places))
    return [_Item(piece, place[0], folder)
            for piece, place, folder in zip(pieces, places, folders)]


def _refine(arguments: Namespace, items: Sequence[_Item], run: Runner, show: Callable[..., None]
            ) -> tuple[list[dict[str, Any]], list[str]]:
    """Refine items and write their folders; return their rows, by folder, and faults."""
    # The names of all recordings need not go to each process with each recording.
    own = Namespace(**{**vars(arguments), 'recordings': []})
    work: Callable[[_Item], Any] = partial(_refine_one, own, len(items) <= MOST_PAGES)
    if len(items) > 1:
        # One that cannot be used must not lose the others, even if it is the last to be done.
        work = partial(attempt, work)
    done, failed = [], []
    with closing(run(work, items)) as outcomes:
        for count, (index, outcome) in enumerate(outcomes, 1):
            item = items[index]
            if isinstance(outcome, Failure):
                failed.append(outcome.reason)
            else:
                row, files = outcome
                with output_folder(arguments.output / item.folder) as folder:
                    for name, text in files.items():
                        (folder / name).write_text(encodable(text), encoding='utf-8')
                done.append({'recording': str(item.piece.path), 'folder': item.folder,
                             'robot': item.robot, **row})
            show(count / len(items), f'{count} of {len(items)}: {item}')
    return sorted(done, key=lambda row: row['folder']), failed


def _refine_one(arguments: Namespace, with_page: bool, item: _Item
                ) -> tuple[dict[str, Any], dict[str, str]]:
    """Refine a joint of a recording; return its row of the page on all, and its files."""
    begin, piece = time.monotonic(), item.piece
    result = refine_recordings(replace(given_of(arguments), joint=piece.joint), [piece.path])
    report = result.content()
    files = {'report.json': to_json(report), 'model.yaml': to_yaml(result.model.to_dict())}
    friction, intervals = report['friction'], report['friction']['intervals']
    if with_page:
        from friction_comp.reports.refinement_page import refinement_page

        page = refinement_page(result, [str(piece.path)], arguments.output / item.folder)
        page.made_by(arguments.command)
        files['report.html'] = page.html()
    row = {
        'joint': piece.joint or report['joint'], 'unit': report['unit'],
        'samples': report['samples'], 'verdict': report['verdict'],
        'before': report['before']['held_out_rmse'], 'after': report['after']['held_out_rmse'],
        'noise_floor': report['noise_floor'],
        'friction': {name: [friction[name], *intervals[name]]
                     for name in NUMBERS if name in intervals},
        'effects': [{'name': effect['name'], 'variable': effect['variable']}
                    for effect in report['effects']],
        'unexplained': [entry['variable'] for entry in report['unexplained']],
        'page': with_page, 'seconds': time.monotonic() - begin}
    return row, files
