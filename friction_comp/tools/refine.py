# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool `refine`: of recordings of a joint, of each alone, of an arm, or of steady states.

What follows from what is told are the drive, its limit and its unit. What takes long to import is
imported by the way that needs it, and late: an unusable recording is refused at once.
"""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress
import os
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import errors_name, InputError
from friction_comp.files import (
    file_names,
    output_folder,
    read_yaml,
    to_json,
    to_yaml,
    write_atomically,
    write_report,
)
from friction_comp.statistics import rms
from friction_comp.tables.columns import Column, parse_unit, read_name, unit_of, without_time
from friction_comp.tables.table_files import is_table, Table
from friction_comp.terminal import in_own_units, number, progress
from friction_comp.tools.common import Arguments, layout_of, positive, write_results

if TYPE_CHECKING:
    from friction_comp.arm.fit import ArmResult
    from friction_comp.identification.curves import SteadyStates
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.recordings.reader import Piece
    from friction_comp.refinement import RefineResult
    from friction_comp.samples import RecordingInfo, Samples

# Arguments that tell how a table is read, and those that steady states have no use for.
_OF_TABLE = ('columns', 'unit', 'rate', 'stiffness', 'damping')
_OF_MOTION = ('model', 'urdf', 'each', 'stiffness', 'rate')


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
    arguments.layout = layout_of(arguments)
    arguments.knows_drive = bool(arguments.torque_constant or arguments.gear_ratio)
    if arguments.scheduler and not arguments.each:
        raise InputError('--scheduler goes with --each')
    means = steady_states(arguments)
    if means is not None:
        return refine_table(arguments, means)
    if arguments.each:
        return refine_each(arguments)
    if arguments.urdf:
        return refine_whole_arm(arguments)
    names = [str(path) for path in arguments.recordings]
    with progress('reading') as show:
        result = refine_recordings(arguments, show)
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


def drive_of(arguments: Namespace, model: FrictionModel | None) -> Drive:
    """Return the model's drive, in which given constants replace its own, or a drive of these.

    Without a model and constants, the effort of the recordings is taken as current.
    """
    constants: dict[str, Any] = {name: value for name in ('torque_constant', 'gear_ratio')
                                 if (value := getattr(arguments, name))}
    if model is not None:
        return replace(model.drive, **constants)
    if len(constants) == 1:
        raise InputError('--torque-constant and --gear-ratio belong together: give 1 for the one '
                         'that effort already contains')
    return Drive(**{'torque_constant': 1.0, 'gear_ratio': 1.0, **constants})


def with_current_limit(arguments: Namespace, drive: Drive, recorded: list[Samples]
                       ) -> tuple[Drive, dict[str, str]]:
    """Return the drive with its current limit, and a note on the origin of the limit.

    It is that of the model given, else the largest current that lasted, which the drive has
    withstood.
    """
    largest = max(map(_largest_lasting_current, recorded), default=0.0)
    if arguments.model or not largest > 0.0:
        return drive, {}
    return (replace(drive, current_limit=float(f'{largest:.4g}')),
            {'current_limit': 'the largest current that lasted in the recordings'})


def _largest_lasting_current(samples: Samples) -> float:
    """Return the largest magnitude of running medians, A; 0 where no current is finite."""
    size = np.abs(samples.current[np.isfinite(samples.current)])
    # Over 0.05 s, which removes single wrong samples.
    half = max(round(0.025 / max(samples.sample_time, 1e-6)), 1)
    if len(size) <= 2 * half:
        return float(np.median(size)) if size.size else 0.0
    windows = np.lib.stride_tricks.sliding_window_view(size, 2 * half + 1)[::max(half // 2, 1)]
    return float(np.median(windows, axis=1).max())


def _fitted_unit(arguments: Namespace, model: FrictionModel | None, infos: Sequence[RecordingInfo]
                 ) -> str:
    """Return the unit of the fitted signal: A if the drive is known, else that of the effort.

    The user's comes first, then the drive's, the recordings', and that in the name of the column.
    """
    if model is not None and not (arguments.figures or arguments.knows_drive):
        return str(model.notes.get('unit', 'A'))
    recorded = next((info.effort_unit for info in infos if info.effort_unit), '')
    if recorded and not arguments.figures:
        return recorded
    return figures_unit(arguments, any(info.effort_is_current for info in infos),
                        any(info.linear for info in infos))


def figures_unit(arguments: Namespace, in_ampere: bool, linear: bool) -> str:
    """Return the unit without a model; `linear` is whether positions are lengths."""
    if arguments.figures:
        return str(arguments.figures)
    if arguments.knows_drive or in_ampere:
        return 'A'
    text = arguments.layout.units.get('effort', 'N' if linear else 'N·m')
    unit = unit_of('effort', text)
    # A unit that is no torque, such as 0.1 %, is kept as it is.
    return text if unit is None else {'torque': 'N·m', 'force': 'N', 'current': 'A'}[unit.dimension]


def refine_recordings(arguments: Namespace, show: Callable[..., None] = lambda *_: None
                      ) -> RefineResult:
    """Refine a model on recordings of one joint together.

    `show` is called with the share 0..1 that is done and a description.
    """
    from friction_comp.recordings.reader import LIMIT, read_recording_with_info

    joint, model, paths = arguments.joint, None, arguments.recordings
    if arguments.model:
        from friction_comp.model.friction_model import FrictionModel
        from friction_comp.recordings.reader import find_recordings, recorded_joints, without_topic

        first = find_recordings(paths)[0]
        model = FrictionModel.load(arguments.model, joint and without_topic(first, joint))
        if not joint and model.joint in recorded_joints(first, arguments.layout):
            joint = model.joint
    drive = drive_of(arguments, model)
    recordings = read_recording_with_info(
        paths, joint, drive.torque_per_current,
        lambda share: show(0.2 * share, 'reading'), arguments.layout, limit=LIMIT)
    if model:
        model.check_joint(recordings[0][1].joint, arguments.model)
    unit = _fitted_unit(arguments, model, [info for _, info in recordings])
    usable, = showing_friction({joint or '': recordings}).values()
    recorded = [samples for samples, _ in usable]
    # The motor had no current, and a load moved the joint.
    idle = not (model or arguments.torque_constant or arguments.figures) and all(
        samples.load is not None and not samples.current.any() for samples in recorded)
    if idle:
        unit = 'N·m'
    drive, limit = with_current_limit(arguments, drive, recorded)
    from friction_comp.refinement import Origin, refine as refine_samples

    # Without its constants, a drive does not tell how much current a recorded load takes.
    known = model or arguments.knows_drive or unit in ('N·m', 'N') or idle
    of_table = {f'{name}_of_table': value for name in _OF_TABLE
                if (value := getattr(arguments, name))}
    notes = {'refined_from': [str(path) for path in paths], **of_table, **limit,
             **({'position_unit': 'm'} if any(info.linear for _, info in recordings) else {})}
    origin = Origin(unit, bool(known), notes_on(recordings, idle),
                    assumed_in(arguments, recordings), notes)
    with errors_name(f'{paths[0]}: {joint}' if joint else paths[0]):
        return refine_samples(
            recorded, model, drive, origin=origin,
            progress=lambda share, name: show(0.2 + 0.7 * share, name))


def notes_on(recordings: Iterable[tuple[Samples, RecordingInfo]], idle: bool = False) -> list[str]:
    """Return the notes on recordings as warnings of a report; `idle` is that of the motor."""
    paths: dict[str, list[Path]] = {}
    for _, info in recordings:
        for note in info.notes:
            paths.setdefault(note, []).append(info.path)
    return [f'{own[0]}{f" and {len(own) - 1} more" * (len(own) > 1)}: {note}'
            for note, own in paths.items()] + [
        'the motor was idle: friction is what the load (torque sensor) overcame, in N·m'] * idle


def assumed_in(arguments: Namespace, recordings: Iterable[tuple[Samples, RecordingInfo]]
               ) -> list[str]:
    """Return the units of tables that are taken for granted, with what tells against them."""
    read: dict[tuple[str, str], list[Samples]] = {}
    for samples, info in recordings:
        columns = [one for one in info.assumed if not (arguments.figures and 'N·m' in one)]
        if columns and len(samples) > 1:
            read.setdefault((', '.join(columns), 'm' if info.linear else 'rad'), []).append(samples)
    return [f'{columns} (position covers {max(np.ptp(one.position) for one in own):.3g} {unit}; '
            f'rows are {1e3 * own[0].sample_time:.3g} ms apart); --unit gives others'
            for (columns, unit), own in read.items()]


def showing_friction(recorded: Mapping[str, list[tuple[Samples, RecordingInfo]]]
                     ) -> dict[str, list[tuple[Samples, RecordingInfo]]]:
    """Return what of the joints' recordings shows friction; raises InputError if nothing does.

    Unless all loads were recorded, it is what no compensation law drove. Joints of an arm keep the
    same recordings, since they are fitted together.
    """
    from friction_comp.recordings.reader import without_compensation

    for parts in recorded.values():
        # With the load of some recordings only, all would lose it.
        paths = {samples.load is not None: info.path for samples, info in parts}
        if len(paths) > 1:
            raise InputError(f'{paths[True]}: has a load (interaction_wrench), and {paths[False]} '
                             'has none: refine them separately')
    if all(samples.load is not None for parts in recorded.values() for samples, _ in parts):
        return dict(recorded)
    rest = {joint: [(without_compensation(samples, info), info) for samples, info in parts]
            for joint, parts in recorded.items()}
    kept = [all(len(samples) for samples, _ in parts) for parts in zip(*rest.values())]
    if not any(kept):
        path = next(iter(recorded.values()))[0][1].path
        raise InputError(
            f'{path}: a compensation law drove the motor, so the current shows its model and not '
            'the friction. Record the load (topic interaction_wrench), or move the joint by its '
            'motor without the compensator')
    return {joint: list(compress(parts, kept)) for joint, parts in rest.items()}


def steady_states(arguments: Namespace) -> tuple[Column, Column] | None:
    """Return velocity and effort if the only recording is a table of steady states, else None."""
    path, *others = arguments.recordings
    if others or not is_table(path) or path.is_dir():
        return None
    table = Table(path, [*arguments.layout.columns.values()])
    return without_time(table.names, arguments.layout, path)


def refine_table(arguments: Namespace, columns: tuple[Column, Column]) -> int:
    """Fit friction to a table and write report.json, report.html and model.yaml; returns 0."""
    path, = arguments.recordings
    given = next((name for name in _OF_MOTION if getattr(arguments, name)), None)
    if given:
        raise InputError(f'{path}: holds neither time nor position, only means at constant speeds: '
                         f'--{given} needs a recording')
    from friction_comp.identification.curves import fit_steady_states
    from friction_comp.reports.other_pages import steady_state_page, steady_state_rows
    from friction_comp.reports.refinement_page import next_steps, Row, step_lines, table_lines

    velocity, effort = columns
    table = Table(path, [velocity.name])
    read = table.read([velocity.name, effort.name])
    speeds, torques = (column.factor * read[column.name] for column in columns)
    if not len(speeds):
        raise InputError(f'{path}: has no row below its header')
    drive = drive_of(arguments, None)
    in_ampere = effort.dimension == 'current'
    unit = figures_unit(arguments, in_ampere, velocity.dimension == 'length/time')
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
    steps = next_steps(fit.model, report['verdict'], report['record_again'],
                       ['breakaway', 'presliding'], arguments.output)
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
    from friction_comp.refinement import thresholds

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
    from friction_comp.arm.fit import refine_arm
    from friction_comp.recordings.reader import read_arm
    from friction_comp.refinement import Origin
    from friction_comp.reports.refinement_page import step_lines, summary_lines

    given = arguments.knows_drive
    models = _start_models(arguments)
    names = [str(path) for path in arguments.recordings]
    with progress('reading') as report:
        recordings = read_arm(
            arguments.recordings,
            lambda name: drive_of(arguments, models.get(name)).torque_per_current,
            lambda share: report(0.1 * share), arguments.layout)
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
                arguments, drive_of(arguments, models.get(name)), parts)
        in_ampere = given or models or arguments.figures == 'A' or any(
            info.effort_is_current for parts in recordings.values() for _, info in parts)
        origins = {name: Origin(
            warnings=notes_on(recordings[name]), assumed=assumed_in(arguments, recordings[name]),
            notes={'refined_from': names, 'urdf': str(arguments.urdf), **limits[name]})
            for name in recorded}
        with errors_name(names[0]):
            result = refine_arm(
                recorded, arguments.urdf, drives, models, recorded if given else models,
                [arguments.joint] if arguments.joint else None,
                lambda share, word: report(0.1 + 0.8 * share, word), not in_ampere, origins)
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
    from friction_comp.reports.refinement_page import refusal

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
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.model.model_file import joints_of

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
    from friction_comp.model.model_file import write_arm
    from friction_comp.reports.other_pages import arm_page
    from friction_comp.reports.refinement_page import refinement_page

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
    from friction_comp.evaluation.fleet import fleet_json, populations_of
    from friction_comp.parallel import run_each, runner_on_cluster
    from friction_comp.recordings.reader import pieces_of
    from friction_comp.reports.other_pages import each_page, fleet_verdict, verdict
    from friction_comp.reports.refinement_page import effect_names

    with progress('reading') as show:
        pieces, failures = pieces_of(arguments.recordings, arguments.joint, arguments.layout)
        # From eight on, processes save more time than their start takes, some seconds each.
        jobs = os.cpu_count() or 1 if len(pieces) >= 8 else 1
        with runner_on_cluster(arguments.scheduler) if arguments.scheduler else nullcontext(
                partial(run_each, jobs=jobs)) as run:
            done, failed = _refine(arguments, _items(pieces), run, show)
            failed += failures
            if not done:
                raise InputError(failed[0])
        populations = populations_of(done)
        content: dict[str, Any] = {
            'recordings': done, 'failed': sorted(failed),
            'out': {population.joint: population.out for population in populations}}
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


def _refine(arguments: Namespace, items: Sequence[_Item], run: Callable[..., Any],
            show: Callable[..., None]) -> tuple[list[dict[str, Any]], list[str]]:
    """Refine items and write their folders; return their rows, by folder, and faults."""
    from friction_comp.parallel import Failure

    done, failed = [], []
    # The names of all recordings need not go to each process with each recording.
    own = Namespace(**{**vars(arguments), 'recordings': []})
    with closing(run(partial(_refine_one, own), items)) as outcomes:
        for count, (index, outcome) in enumerate(outcomes, 1):
            item = items[index]
            if isinstance(outcome, Failure):
                failed.append(outcome.reason)
            else:
                row, files = outcome
                with output_folder(arguments.output / item.folder) as folder:
                    for name, text in files.items():
                        write_atomically(folder / name, text, sync=False)
                done.append({'recording': str(item.piece.path), 'folder': item.folder,
                             'robot': item.robot, **row})
            show(count / len(items), f'{count} of {len(items)}: {item}')
    return sorted(done, key=lambda row: row['folder']), failed


def _refine_one(arguments: Namespace, item: _Item) -> tuple[dict[str, Any], dict[str, str]]:
    """Refine a joint of a recording; return its row of the page on all, and its files."""
    from friction_comp.evaluation.fleet import NUMBERS
    from friction_comp.reports.refinement_page import refinement_page

    piece = item.piece
    result = refine_recordings(Namespace(**{
        **vars(arguments), 'joint': piece.joint, 'recordings': [piece.path]}))
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
        'unexplained': [entry['variable'] for entry in report['unexplained']]}
    return row, files
