# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What `refine` does with a table of steady states, a whole arm, or each recording alone."""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
import os
from pathlib import Path
import time
from typing import Any

import numpy as np

from friction_comp.arm.fit import ArmResult, refine_arm
from friction_comp.errors import errors_name, InputError
from friction_comp.evaluation.fleet import fleet_json, NUMBERS, populations_of
from friction_comp.files import (
    encodable,
    file_names,
    output_folder,
    read_yaml,
    to_json,
    to_yaml,
    write_report,
)
from friction_comp.identification.curves import fit_steady_states, SteadyStates
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import joints_of, write_arm
from friction_comp.parallel import Failure, run_each, Runner, runner_on_cluster
from friction_comp.recordings.reader import Piece, pieces_of, read_arm
from friction_comp.refinement import Origin, thresholds
from friction_comp.reports.other_pages import (
    arm_page,
    each_page,
    fleet_verdict,
    steady_state_page,
    steady_state_rows,
    verdict,
)
from friction_comp.reports.refinement_page import (
    effect_names,
    next_steps,
    refinement_page,
    refusal,
    Row,
    step_lines,
    summary_lines,
    table_lines,
)
from friction_comp.statistics import rms
from friction_comp.tables.columns import Column, read_name
from friction_comp.tables.table_files import Table
from friction_comp.terminal import in_own_units, number, progress
from friction_comp.tools.common import given_of, layout_of, write_results
from friction_comp.tools.recorded_drive import (
    assumed_in,
    drive_of,
    figures_unit,
    notes_on,
    refine_recordings,
    showing_friction,
    with_current_limit,
)

_OTHER_OPTIONS = ('model', 'urdf', 'each', 'stiffness', 'rate')


def refine_table(arguments: Namespace, columns: tuple[Column, Column]) -> int:
    """Fit friction to a table and write report.json, report.html and model.yaml; returns 0."""
    path, = arguments.recordings
    given = next((name for name in _OTHER_OPTIONS if getattr(arguments, name)), None)
    if given:
        raise InputError(f'{path}: holds neither time nor position, only means at constant speeds: '
                         f'--{given} needs a recording')
    velocity, effort = columns
    table = Table(path)
    read = table.read([velocity.name, effort.name])
    speeds, torques = (column.factor * read[column.name] for column in columns)
    if not len(speeds):
        raise InputError(f'{path}: has no row below its header')
    told = given_of(arguments)
    drive = drive_of(told, None)
    in_ampere = effort.dimension == 'current'
    unit = figures_unit(told, in_ampere, velocity.dimension == 'length/time')
    if effort.stated and not effort.dimension:
        unit = effort.unit
    with errors_name(path):
        fit = fit_steady_states(
            speeds, torques / (1.0 if in_ampere else drive.torque_per_current), drive)
    limit = float(f'{np.max(np.abs(fit.currents)):.4g}')
    linear = velocity.dimension == 'length/time'
    model = replace(
        fit.model, drive=replace(drive, current_limit=limit),
        joint=arguments.joint or velocity.joint or effort.joint,
        notes={'refined_from': [str(path)], 'unit': unit,
               **({'position_unit': 'm'} if linear else {}),
               'current_limit': 'the largest current of the table'})
    fit = replace(fit, model=model)
    loads = [name for name in table.names if name != effort.name
             and read_name(name).signal in ('load', 'link_torque')]
    report = in_own_units(_report(fit, unit, loads), linear)
    report['warnings'] += table.notes
    steps = next_steps(report['verdict'], report['record_again'], ['breakaway', 'presliding'],
                       arguments.output)
    page = steady_state_page(report, fit.model, fit.speeds, fit.currents, str(path), steps)
    write_results(arguments, report, page, fit.model)
    table_of = [Row('', 'friction', 'value', '95 % interval', ''), *steady_state_rows(report)]
    print(*in_own_units([
        f'{path}: {len(fit.speeds)} constant speeds', '',
        f"{report['verdict'].upper()}: {report['reasons'][0]}",
        *(f'  {line}' for line in report['reasons'][1:]), '', *table_lines(table_of), '',
        *(f'note: {line}' for line in report['warnings']), '', *step_lines([
            ('look', str(arguments.output / 'report.html')), *steps])], linear), sep='\n')
    return 0


def _report(fit: SteadyStates, unit: str, loads: list[str]) -> dict[str, Any]:
    signal = rms(fit.currents)
    low, high = fit.intervals['coulomb']
    pushes = high < 0.0
    # Whether a reason applies, the reason, and what to record.
    doubts = [(reason, record) for applies, reason, record in (
        (pushes, 'Friction would have to push: effort or velocity has the wrong sign, or the '
         'torque is that of a brake.',
         'the same with the sign of effort reversed (--unit effort=-1Nm)'),
        ('offset' not in fit.values, 'Motion was in one direction only: Coulomb friction cannot be '
         'distinguished from an offset.', 'move in both directions'),
        (low <= 0.0 <= high, 'Coulomb friction cannot be distinguished from zero.',
         'more and slower speeds'),
        (loads, f'{" and ".join(loads)}: not taken into account, so that what the joint carried '
         'counts as friction.', 'the joint without a load'),
        (fit.is_curved, f'The remaining error, {fit.fit_rmse:.2g} {unit} RMS, depends on the '
         'speed: friction has another form than Coulomb, viscous and Stribeck friction.',
         'a log of motion, in which refine finds other forms'),
        (fit.left_out_rmse > thresholds.UNEXPLAINED * signal,
         f'{fit.left_out_rmse:.2g} {unit} of {signal:.2g} {unit} remain unexplained.',
         'each speed several times, over the same range of positions')) if applies]
    found = [effect.name for effect in fit.model.effects]
    return {
        'unit': unit, 'joint': fit.model.joint, 'samples': len(fit.speeds),
        'held_out': 'each row, predicted by a fit to all others', 'signal_rms': signal,
        'before': {'model': 'Coulomb and viscous friction', 'held_out_rmse': fit.plain_rmse},
        'after': {'model': ' + '.join(['sigmoid of Eq. 6', *found]), 'fit_rmse': fit.fit_rmse,
                  'held_out_rmse': fit.left_out_rmse},
        'noise_floor': None,
        'effects': [{**effect.to_dict(), 'intervals': {}, 'chosen': None}
                    for effect in fit.model.effects],
        'friction': {**fit.values, 'intervals': fit.intervals},
        'unexplained': [], 'ambiguous': [],
        'verdict': 'record again' if pushes else 'trust in part' if doubts else 'trust',
        'reasons': [reason for reason, _ in doubts] or [
            'Each row of the table is predicted by the others.'],
        'record_again': [record for _, record in doubts],
        'warnings': ['inertia, weight and breakaway do not show in means at constant speeds'],
        'stopped_because': "Akaike's criterion prefers no further term"}


def refine_whole_arm(arguments: Namespace) -> int:
    """Refine the joints of an arm and write their reports and models; return 0.

    Each has a folder next to the files of the whole arm.
    """
    if arguments.figures not in (None, 'A', 'N·m', 'Nm'):
        raise InputError(f'--unit: with --urdf effort is in A or N·m, not in {arguments.figures}')
    given = arguments.torque_constant is not None or arguments.gear_ratio is not None
    models, known = _start_models(arguments), given_of(arguments)
    names = [str(path) for path in arguments.recordings]
    with progress('reading') as report:
        recordings = read_arm(
            arguments.recordings,
            lambda name: drive_of(known, models.get(name)).torque_per_current,
            lambda share: report(0.1 * share), known.layout)
        if '' in recordings:
            raise InputError(f'{names[0]}: names no joint: give its name in the URDF with --joint')
        unknown = [name for name in models if name not in recordings]
        if unknown:
            raise InputError(f'{arguments.model}: is of joint {unknown[0]!r}, but recorded are '
                             f'{", ".join(map(repr, recordings))}')
        recorded = {name: [samples for samples, _ in parts]
                    for name, parts in showing_friction(recordings).items()}
        drives, limits = {}, {}
        for name, parts in recorded.items():
            drives[name], limits[name] = with_current_limit(
                known, drive_of(known, models.get(name)), parts)
        in_ampere = given or models or arguments.figures == 'A' or any(
            info.effort_is_current for parts in recordings.values() for _, info in parts)
        origins = {name: Origin(
            warnings=notes_on(recordings[name]), assumed=assumed_in(known, recordings[name]),
            notes={'refined_from': names, 'urdf': str(arguments.urdf), **limits[name]})
            for name in recorded}
        try:
            result = refine_arm(
                recorded, arguments.urdf, drives, models, recorded if given else models,
                [arguments.joint] if arguments.joint else None,
                lambda share, word: report(0.1 + 0.8 * share, word), not in_ampere, origins)
        except InputError as error:
            # Name the recording, unless a file is named already.
            named = str(error).startswith((str(arguments.urdf), names[0]))
            raise InputError(f'{"" if named else f"{names[0]}: "}{error}') from None
        report(0.9, 'writing')
        with output_folder(arguments.output) as folder:
            _write(folder, result, names, arguments)
    print(*(f'note: {line}' for line in result.notes), *(
        line for name, one in result.results.items()
        for line in (f'{name}:', *summary_lines(one.report))),
        *step_lines(_next_steps(result, arguments.output / 'model.yaml')),
        arguments.output / 'report.html', sep='\n')
    return 0


def _next_steps(result: ArmResult, model: Path) -> list[tuple[str, str]]:
    record = dict.fromkeys(line for one in result.results.values()
                           for line in one.report.record_again)
    steps = [('record', line) for line in record]
    usable = [name for name, one in result.results.items()
              if one.report.verdict != 'record again']
    if usable:
        refused = [('compensate', f'{name} not with this file: {reason}') for name in usable
                   if (reason := refusal(result.results[name].model))]
        steps += [('check', f'python3 -m friction_comp predict OTHER --model {model} --joint '
                   f'{usable[0]} --output current.csv'), *(refused or [
                       ('compensate', f'joints [{", ".join(usable)}], and {model} for each in '
                        'model_files')])]
    return steps


def _start_models(arguments: Namespace) -> dict[str, FrictionModel]:
    if not arguments.model:
        return {}
    joints = joints_of(read_yaml(arguments.model))
    if joints is None:
        model = FrictionModel.load(arguments.model)
        model.check_joint(arguments.joint, arguments.model)
        joint = arguments.joint or model.joint
        if not joint:
            raise InputError(f'{arguments.model}: names no joint: give it with --joint')
        return {joint: model}
    return {name: FrictionModel.load(arguments.model, name) for name in joints}


def _write(folder: Path, result: ArmResult, names: list[str], arguments: Namespace) -> None:
    """Write the files of each joint, and those of the whole arm."""
    reports = {name: one.report.content() for name, one in result.results.items()}
    folders = dict(zip(reports, file_names(reports)))
    for name, one in result.results.items():
        (folder / folders[name]).mkdir(exist_ok=True)
        write_report(folder / folders[name], reports[name], refinement_page(
            one, names, arguments.output / folders[name]), arguments.command)
        one.model.save(folder / folders[name] / 'model.yaml')
    whole = {'unit': next(iter(result.results.values())).report.unit, 'arm': result.report(),
             'joints': reports}
    write_report(folder, whole, arm_page(result, names, folders), arguments.command)
    write_arm(folder / 'model.yaml', {name: one.model for name, one in result.results.items()})


@dataclass(frozen=True)
class _Item:
    """A joint of a recording, the unit (robot) that it is of, and its folder below the output."""

    piece: Piece
    robot: str
    folder: str

    def __str__(self) -> str:
        return str(self.piece.path)


def refine_each(arguments: Namespace) -> int:
    """Refine each joint of each recording; write a folder for each, and one page on all.

    Each folder is written as soon as its joint is refined, whole or not at all. Returns 0.
    """
    if arguments.urdf:
        raise InputError('--each and --urdf exclude each other: the links are fitted once for all')
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
    lines = [
        verdict(content), *map(fleet_verdict, populations),
        *(f"{row['folder']}: {number(row['before'])} → {number(row['after'])} {row['unit']}, "
          f"{row['verdict']}; found: {effect_names(effect['name'] for effect in row['effects'])}"
          for row in content['recordings']),
        *(f'left out: {reason}' for reason in content['failed'])]
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
    folders = file_names(
        '_'.join(place) + (f'_{piece.joint}' if joints[piece.path] > 1 else '')
        for piece, place in zip(pieces, places))
    return [_Item(piece, place[0], folder)
            for piece, place, folder in zip(pieces, places, folders)]


def _refine(arguments: Namespace, items: Sequence[_Item], run: Runner, show: Callable[..., None]
            ) -> tuple[list[dict[str, Any]], list[str]]:
    """Refine items and write their folders; return their rows, by folder, and faults."""
    # The names of all recordings need not go to each process with each recording.
    own = Namespace(**{**vars(arguments), 'recordings': []})
    work: Callable[[_Item], Any] = partial(_refine_one, own)
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


def _refine_one(arguments: Namespace, item: _Item) -> tuple[dict[str, Any], dict[str, str]]:
    """Refine a joint of a recording; return its row of the page on all, and its files."""
    begin, piece = time.monotonic(), item.piece
    result = refine_recordings(replace(given_of(arguments), joint=piece.joint), [piece.path])
    report = result.content()
    friction, intervals = report['friction'], report['friction']['intervals']
    page = refinement_page(result, [str(piece.path)], arguments.output / item.folder)
    page.made_by(arguments.command)
    files = {'report.json': to_json(report), 'model.yaml': to_yaml(result.model.to_dict()),
             'report.html': page.html()}
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
        'seconds': time.monotonic() - begin}
    return row, files
