# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``refine --each``: refines many recordings and joints separately, and compares them."""

from __future__ import annotations

from argparse import Namespace
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
import hashlib
import json
import os
from pathlib import Path
import time
from typing import Any

from friction_comp import __version__
from friction_comp.errors import InputError
from friction_comp.files import encodable, output_folder, plain, to_yaml
from friction_comp.fleet.common_model import CommonModel
from friction_comp.fleet.population import fleet_json, Population, population_of
from friction_comp.fleet.spread import FEWEST_UNITS
from friction_comp.interrupts import interrupts_deferred
from friction_comp.model.friction_model import FrictionModel
from friction_comp.parallel import attempt, Failure, run_each, Runner
from friction_comp.recorded_drive.given import Given
from friction_comp.recorded_drive.refine_recordings import refine_recordings, showing_friction
from friction_comp.recordings.condense import read_condensed
from friction_comp.recordings.pieces import Piece, pieces_of
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.results import to_json
from friction_comp.terminal import progress
from friction_comp.tools.common import write_results
from friction_comp.tools.refine_arguments import folder_names, given_of, layout_of

# Recordings from which processes save more time than their start takes, some seconds each.
MIN_SHARED = 8
# Most recordings that get a page each: nobody reads a hundred; refine makes that of any one.
MOST_PAGES = 20
# Written last into the folder of a recording.
_DONE = 'resume.json'
# Arguments that do not change the result of a recording.
_NEUTRAL = ('recordings', 'joint', 'output', 'jobs', 'json', 'command', 'ros', 'scheduler')
# Share of the progress bar for refining; the rest is comparing.
_REFINING = 0.9


@dataclass(frozen=True)
class _Item:
    """A joint of a recording, and the folder of its results."""

    piece: Piece
    folder: Path

    def __str__(self) -> str:
        return str(self.piece)


@dataclass(frozen=True)
class _Refined:
    """One joint of one recording that was refined."""

    piece: Piece
    robot: str
    row: dict[str, Any]
    model: FrictionModel

    @property
    def group(self) -> tuple[str, str]:
        """Joint, and unit of the figures."""
        return self.row['joint'], self.row['unit']


@dataclass(frozen=True)
class _Summed:
    one: _Refined
    common: CommonModel

    def __str__(self) -> str:
        return str(self.one.piece)


@dataclass
class _Batch:
    done: dict[int, _Refined] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)
    earlier: int = 0
    interrupted: bool = False


def refine_each(arguments: Namespace) -> int:
    """Refine each joint of each recording; write a folder for each, and one page on all.

    Each folder is written as soon as its joint is refined, whole or not at all; what an earlier run
    with the same arguments wrote is taken over. Returns 0, or 130 if interrupted.
    """
    if arguments.urdf:
        raise InputError('--each and --urdf exclude each other: the links are fitted once for all')
    from friction_comp.reports.fleet_page import each_page

    begin = time.monotonic()
    populations: list[Population] = []
    with progress('reading') as show:
        pieces, failures = pieces_of(arguments.recordings, arguments.joint, layout_of(arguments))
        batch, unread = _Batch(failed=failures), len(failures)
        try:
            with _runner(arguments, len(pieces)) as run:
                _refine_pieces(arguments, pieces, batch, run, show)
                populations = _fleet_of(
                    arguments, [batch.done[index] for index in sorted(batch.done)], run,
                    lambda done, count: show(_REFINING + (1.0 - _REFINING) * done / count,
                                             f'comparing: {done} of {count}'))
        except KeyboardInterrupt:
            batch.interrupted = True
        if not batch.done and not batch.interrupted:
            raise InputError(batch.failed[0])
        content = {
            'recordings': [batch.done[index].row for index in sorted(batch.done)],
            'failed': sorted(batch.failed), 'taken_over': batch.earlier,
            'not_done': len(pieces) + unread - len(batch.done) - len(batch.failed),
            'out': {population.joint: population.out for population in populations},
            'seconds': time.monotonic() - begin}
        if batch.done:
            write_results(arguments, content, each_page(content, populations),
                          files=_files_of(populations))
    if arguments.json:
        print(to_json(content), end='')
    else:
        _print(content, populations)
        if batch.done:
            print(arguments.output / 'report.html')
    return 130 if batch.interrupted else 0


@contextmanager
def _runner(arguments: Namespace, count: int) -> Iterator[Runner]:
    """Yield a function that does work on the recordings, here, in processes or on a cluster."""
    if arguments.scheduler:
        from friction_comp.cluster import runner_on_cluster

        with runner_on_cluster(arguments.scheduler) as run:
            yield run
    else:
        yield partial(run_each, jobs=arguments.jobs or (
            os.cpu_count() or 1 if count >= MIN_SHARED else 1))


def _refine_pieces(arguments: Namespace, pieces: Sequence[Piece], batch: _Batch, run: Runner,
                   show: Callable[..., None]) -> None:
    places = _places(pieces)
    folders, robots = _folders(pieces, places), [place[0] for place in places]
    keys = [_fingerprint(arguments, piece) for piece in pieces]
    for index, (folder, key) in enumerate(zip(folders, keys)):
        found = _earlier_result(arguments.output / folder, key)
        if found is not None:
            batch.done[index] = _Refined(pieces[index], robots[index], found['row'],
                                         FrictionModel.from_dict(found['model']))
    batch.earlier = len(batch.done)
    waiting = [index for index in range(len(pieces)) if index not in batch.done]
    # The names of all recordings need not go to each process with each recording.
    own = Namespace(**{**vars(arguments), 'recordings': []})
    work: Callable[[_Item], Any] = partial(_refine_one, own, len(pieces) <= MOST_PAGES)
    if len(pieces) > 1:
        # One that cannot be used must not lose the others, even if it is the last to be done.
        work = partial(attempt, work)
    items = [_Item(pieces[index], arguments.output / folders[index]) for index in waiting]
    with closing(run(work, items)) as outcomes:
        for done, (number, outcome) in enumerate(outcomes, len(batch.done) + 1):
            index = waiting[number]
            if isinstance(outcome, Failure):
                batch.failed.append(outcome.reason)
            else:
                row, model, files = outcome
                row = {'recording': str(pieces[index].path), 'folder': folders[index], **row}
                known = json.dumps(plain({'made_from': keys[index], 'row': row, 'model': model}))
                # A folder that is written must also be in the page on all.
                with interrupts_deferred():
                    _write(arguments.output / folders[index], {**files, _DONE: known})
                    batch.done[index] = _Refined(pieces[index], robots[index], row,
                                                 FrictionModel.from_dict(model))
            show(_REFINING * done / len(pieces), f'{done} of {len(pieces)}: {pieces[index]}')


def _places(pieces: Sequence[Piece]) -> list[tuple[str, ...]]:
    """Return the path of each piece below the folder that holds all; it begins with the unit."""
    paths = [piece.path.absolute() for piece in pieces]
    above = os.path.commonpath([path.parent for path in paths]) if paths else ''
    return [path.relative_to(above).with_suffix('').parts for path in paths]


def _folders(pieces: Sequence[Piece], places: Sequence[tuple[str, ...]]) -> list[str]:
    joints = Counter(piece.path for piece in pieces)
    return folder_names(
        '_'.join(place) + (f'_{piece.joint}' if joints[piece.path] > 1 else '')
        for piece, place in zip(pieces, places))


def _refine_one(arguments: Namespace, with_page: bool, item: _Item
                ) -> tuple[dict[str, Any], dict[str, Any], dict[str, str]]:
    """Refine a joint of a recording; return its row of the page on all, its model and its files."""
    begin, piece = time.monotonic(), item.piece
    result = refine_recordings(replace(given_of(arguments), joint=piece.joint), [piece.path])
    report, model = result.content(), result.model.to_dict()
    files = {'report.json': to_json(report), 'model.yaml': to_yaml(model)}
    if with_page:
        from friction_comp.reports.refinement_page import refinement_page

        page = refinement_page(result, [str(piece.path)], item.folder)
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
        groups[one.group].append(one)
    groups = {key: group for key, group in groups.items()
              if len({one.robot for one in group}) >= FEWEST_UNITS}
    items = [_Summed(one, common) for group in groups.values()
             for common in [CommonModel.of([one.model for one in group])] for one in group]
    sums: dict[int, BlockSums] = {}
    work = partial(attempt, partial(_sums_of_one, given_of(arguments)))
    with closing(run(work, items)) as outcomes:
        for done, (index, outcome) in enumerate(outcomes, 1):
            if not isinstance(outcome, Failure):
                sums[index] = outcome
            show(done, len(items))
    populations = []
    for key, group in groups.items():
        own = [index for index in sorted(sums) if items[index].one.group == key]
        if len({items[index].one.robot for index in own}) >= FEWEST_UNITS:
            populations.append(population_of(
                [(items[index].one.robot, sums[index]) for index in own], items[own[0]].common,
                group[0].model, key[1], len(groups)))
            populations[-1] = replace(populations[-1], joint=key[0])
    return populations


def _sums_of_one(given: Given, item: _Summed) -> BlockSums:
    piece, model = item.one.piece, item.one.model
    recordings = read_condensed([piece.path], piece.joint, model.drive.torque_per_current,
                                layout=given.layout)
    usable, = showing_friction({piece.joint or '': recordings}).values()
    declared = bool(given.model or given.torque_constant or given.gear_ratio
                    or model.notes.get('unit') == 'N·m')
    return item.common.sums([samples for samples, _ in usable], model, declared)


def _fingerprint(arguments: Namespace, piece: Piece) -> str:
    files = sorted(piece.path.rglob('*')) if piece.path.is_dir() else [piece.path]
    states = [(str(file.relative_to(piece.path)), state.st_size, state.st_mtime_ns)
              for file in files if file.is_file() for state in [file.stat()]]
    options = sorted((name, str(value)) for name, value in vars(arguments).items()
                     if name not in _NEUTRAL and not callable(value))
    model = arguments.model.read_bytes() if arguments.model else b''
    content = repr((__version__, str(piece.path.absolute()), piece.joint, states, options))
    return hashlib.sha256(content.encode('utf-8', 'backslashreplace') + model).hexdigest()


def _earlier_result(folder: Path, made_from: str) -> dict[str, Any] | None:
    """Return what `_DONE` in a recording's folder holds if it has this fingerprint, else None."""
    try:
        found = json.loads((folder / _DONE).read_text(encoding='utf-8'))
    except (OSError, ValueError):
        return None
    usable = isinstance(found, dict) and found.get('made_from') == made_from
    return found if usable and (folder / 'report.json').is_file() else None


def _files_of(populations: Sequence[Population]) -> dict[str, str]:
    if not populations:
        return {}
    names = folder_names(one.file_name for one in populations)
    return {'fleet.json': fleet_json(populations), **{
        f'{name}.yaml': to_yaml(one.model.to_dict()) for name, one in zip(names, populations)}}


def _write(path: Path, files: dict[str, str]) -> None:
    with output_folder(path) as folder:
        for name, text in files.items():
            (folder / name).write_text(encodable(text), encoding='utf-8')


def _print(content: dict[str, Any], populations: Sequence[Population]) -> None:
    from friction_comp.number_text import number
    from friction_comp.reports.fleet_page import fleet_verdict, verdict

    print(verdict(content).replace('**', ''))
    for population in populations:
        print(fleet_verdict(population).replace('**', ''))
    if len(content['recordings']) <= MOST_PAGES:
        for row in content['recordings']:
            effects = ', '.join(effect['name'] for effect in row['effects']) or 'nothing'
            print(f"{row['folder']}: {number(row['before'])} → {number(row['after'])} "
                  f"{row['unit']}, {row['verdict']}; found: {effects}")
    for reason in content['failed']:
        print(f'left out: {reason}')
