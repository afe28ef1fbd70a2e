# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``refine --each``: refines many recordings and joints separately, and compares them."""

from __future__ import annotations

from argparse import Namespace
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
import os
import time
from typing import Any

from friction_comp.errors import InputError
from friction_comp.files import encodable, output_folder, to_yaml
from friction_comp.fleet.population import (
    CommonModel,
    FEWEST_UNITS,
    fleet_json,
    Population,
    population_of,
)
from friction_comp.model.friction_model import FrictionModel
from friction_comp.number_text import number
from friction_comp.parallel import attempt, Failure, run_each, Runner, runner_on_cluster
from friction_comp.recorded_drive.given import Given
from friction_comp.recorded_drive.refine_recordings import refine_recordings, showing_friction
from friction_comp.recordings.reader import Piece, pieces_of, read_condensed
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.results import to_json
from friction_comp.terminal import progress
from friction_comp.tools.common import folder_names, given_of, layout_of, write_results

# Most recordings that get a page each: nobody reads a hundred; refine makes that of any one.
MOST_PAGES = 20
# Share of the progress bar for refining; the rest is comparing.
_REFINING = 0.9


@dataclass(frozen=True)
class _Item:
    """A joint of a recording, the unit (robot) that it is of, and its folder below the output."""

    piece: Piece
    robot: str
    folder: str

    def __str__(self) -> str:
        return str(self.piece)


@dataclass(frozen=True)
class _Refined:
    """What came of an item: its row of the page on all, and its model."""

    item: _Item
    row: dict[str, Any]
    model: FrictionModel

    def __str__(self) -> str:
        return str(self.item)


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
            populations = _fleet_of(
                arguments, done, run,
                lambda number, count: show(_REFINING + (1.0 - _REFINING) * number / count,
                                           f'comparing: {number} of {count}'))
        content: dict[str, Any] = {
            'recordings': [one.row for one in done], 'failed': sorted(failed),
            'out': {population.joint: population.out for population in populations},
            'seconds': time.monotonic() - begin}
        names = folder_names(one.file_name for one in populations)
        files = {f'{name}.yaml': to_yaml(one.model.to_dict())
                 for name, one in zip(names, populations)}
        if populations:
            files['fleet.json'] = fleet_json(populations)
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
            ) -> tuple[list[_Refined], list[str]]:
    """Refine items and write their folders; return what came of them, by folder, and faults."""
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
                row, model, files = outcome
                with output_folder(arguments.output / item.folder) as folder:
                    for name, text in files.items():
                        (folder / name).write_text(encodable(text), encoding='utf-8')
                done.append(_Refined(item, {'recording': str(item.piece.path),
                                            'folder': item.folder, **row},
                                     FrictionModel.from_dict(model)))
            show(_REFINING * count / len(items), f'{count} of {len(items)}: {item}')
    return sorted(done, key=lambda one: one.item.folder), failed


def _refine_one(arguments: Namespace, with_page: bool, item: _Item
                ) -> tuple[dict[str, Any], dict[str, Any], dict[str, str]]:
    """Refine a joint of a recording; return its row of the page on all, its model and its files."""
    begin, piece = time.monotonic(), item.piece
    result = refine_recordings(replace(given_of(arguments), joint=piece.joint), [piece.path])
    report, model = result.content(), result.model.to_dict()
    files = {'report.json': to_json(report), 'model.yaml': to_yaml(model)}
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
        'effects': [{'name': effect['name'], 'variable': effect['variable']}
                    for effect in report['effects']],
        'unexplained': [entry['variable'] for entry in report['unexplained']],
        'page': with_page, 'seconds': time.monotonic() - begin}
    return row, model, files


def _fleet_of(arguments: Namespace, refined: Sequence[_Refined], run: Runner,
              show: Callable[[int, int], None]) -> list[Population]:
    """Return the population of each joint that enough units have; `show` gets done and all.

    Each recording is read once more, where it was refined, and only its sums come back. Recordings
    without a signal of the common model are left out.
    """
    groups: dict[tuple[str, str], list[_Refined]] = defaultdict(list)
    for one in refined:
        groups[one.row['joint'], one.row['unit']].append(one)
    populations = []
    enough = [group for group in groups.values() if _units(group) >= FEWEST_UNITS]
    for count, group in enumerate(enough):
        common, sums = CommonModel.of([one.model for one in group]), {}
        work = partial(attempt, partial(_sums_of_one, given_of(arguments), common))
        with closing(run(work, group)) as outcomes:
            for done, (index, outcome) in enumerate(outcomes, 1):
                if not isinstance(outcome, Failure):
                    sums[index] = outcome
                show(count * len(group) + done, len(enough) * len(group))
        if _units(group[index] for index in sums) >= FEWEST_UNITS:
            row = group[0].row
            populations.append(replace(population_of(
                [(group[index].item.robot, sums[index]) for index in sorted(sums)], common,
                group[0].model, row['unit'], len(enough)), joint=row['joint']))
    return populations


def _units(refined: Iterable[_Refined]) -> int:
    return len({one.item.robot for one in refined})


def _sums_of_one(given: Given, common: CommonModel, one: _Refined) -> BlockSums:
    piece, model = one.item.piece, one.model
    recordings = read_condensed([piece.path], piece.joint, model.drive.torque_per_current,
                                layout=given.layout)
    usable, = showing_friction({piece.joint or '': recordings}).values()
    declared = bool(given.model or given.torque_constant or given.gear_ratio
                    or model.notes.get('unit') == 'N·m')
    return common.sums([samples for samples, _ in usable], model, declared)
