# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads drive and units from the arguments of a tool, refines the drive, and prints the result."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import compress
from pathlib import Path
import re
from typing import Any, TYPE_CHECKING

from friction_comp import units
from friction_comp.checks import check_number
from friction_comp.column_values import read_pairs
from friction_comp.columns import Column, Layout, without_time
from friction_comp.drive import Drive
from friction_comp.errors import errors_name, InputError

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.recordings import RecordingInfo
    from friction_comp.recordings.history import History
    from friction_comp.refinement import RefinementReport, RefineResult
    from friction_comp.samples import Samples

OF_TABLE = ('columns', 'unit', 'rate', 'stiffness', 'damping')
"""Arguments that tell how the columns of a table are read."""

# Length of the running median that tells a lasting current from a wrong sample, s.
_LASTING = 0.05


def drive_of(arguments: Namespace, model: FrictionModel | None) -> Drive:
    """Return the drive: that of the model with the constants given, else that of the constants.

    Without any, current is what the recordings contain as effort.
    """
    given = {name: value for name, value in (
        ('torque_constant', arguments.torque_constant), ('gear_ratio', arguments.gear_ratio))
        if value is not None}
    if model is not None:
        return replace(model.drive, **given)
    if len(given) == 1:
        raise InputError('--torque-constant and --gear-ratio belong together: give 1 for the one '
                         'that effort already contains')
    return Drive(**{'torque_constant': 1.0, 'gear_ratio': 1.0, **given})


def with_current_limit(arguments: Namespace, drive: Drive, recorded: list[Samples]
                       ) -> tuple[Drive, dict[str, str]]:
    """Return the drive with its current limit, and a note on the origin of the limit.

    If no limit is given, it is the largest current that lasted, which the drive has certainly
    withstood: single wrong samples say nothing about it.
    """
    if arguments.current_limit:
        return replace(drive, current_limit=arguments.current_limit), {}
    largest = max(map(_largest_lasting_current, recorded), default=0.0)
    if arguments.model or not largest > 0.0:
        return drive, {}
    return (replace(drive, current_limit=float(f'{largest:.4g}')),
            {'current_limit': 'the largest current that lasted in the recordings, since no other '
                              'limit was given'})


def _largest_lasting_current(samples: Samples) -> float:
    """Return the largest magnitude of the running median, A; 0 where no current is finite."""
    import numpy as np
    from scipy.ndimage import median_filter

    size = np.abs(samples.current[np.isfinite(samples.current)])
    if not size.size:
        return 0.0
    half = max(round(0.5 * _LASTING / max(samples.sample_time, 1e-6)), 1)
    return float(median_filter(size, 2 * half + 1).max())


def layout_of(arguments: Namespace) -> Layout:
    """Return the layout of a table according to the arguments that describe it."""
    columns = read_pairs(arguments.columns, '--columns') if arguments.columns else {}
    units = read_pairs(arguments.unit, '--unit', 'SIGNAL=UNIT, for instance time=ms,position=deg'
                       ) if arguments.unit else {}
    if arguments.damping and not arguments.stiffness:
        raise InputError('--damping goes with --stiffness, the other gain of the controller')
    try:
        return Layout(columns, units, arguments.rate, _gains(arguments.stiffness),
                      _gains(arguments.damping), arguments.joint or '')
    except InputError as error:
        raise InputError(f'--columns or --unit: {error}') from None


def _gains(text: str | None) -> tuple[float | str, ...]:
    """Return the gains of an argument, each a number or the name of a column."""
    def read(one: str) -> float | str:
        try:
            return check_number(float(one), 'a gain', least=0.0)
        except ValueError:
            return one
    return tuple(read(one.strip()) for one in text.split(',')) if text else ()


def unit_of(arguments: Namespace, model: FrictionModel | None,
            infos: Sequence[RecordingInfo] = ()) -> str:
    """Return the unit of the fitted signal: A if the drive is known, else that of the effort.

    If effort is a servo's voltage, ``--unit`` must name its unit, which is then
    `arguments.figures`.
    """
    if model is not None and not (arguments.figures or arguments.torque_constant
                                  or arguments.gear_ratio):
        return str(model.notes.get('unit', 'A'))
    if not arguments.figures and any(info.effort_is_raw for info in infos):
        return 'counts'
    return figures_unit(arguments, any(info.effort_is_current for info in infos),
                        any(info.linear for info in infos))


def figures_unit(arguments: Namespace, in_ampere: bool, linear: bool) -> str:
    """Return the unit of the figures without a model.

    `in_ampere` is whether efforts are currents, `linear` whether positions are lengths.
    """
    if arguments.figures:
        return str(arguments.figures)
    if arguments.torque_constant is not None or arguments.gear_ratio is not None or in_ampere:
        return 'A'
    text = layout_of(arguments).units.get('effort', 'N' if linear else 'N·m')
    unit = units.unit_of('effort', text)
    # Of a unit that is no torque, such as 0.1 %, only the factor before it was applied.
    return text if unit is None else {'torque': 'N·m', 'force': 'N', 'current': 'A'}[unit.dimension]


def check_tables(arguments: Namespace) -> tuple[Column, Column] | None:
    """Raise InputError for tables that cannot be used, before anything slow is imported.

    Returns the columns of velocity and effort if the only recording is a table of steady states.
    """
    from friction_comp.recordings.sources import find_recordings, open_scanner
    from friction_comp.recordings.storage import unreadable_on_error
    from friction_comp.recordings.table_files import is_table, open_table

    layout = layout_of(arguments)
    recordings = find_recordings(arguments.recordings)
    if len(recordings) == 1 and is_table(recordings[0]):
        with unreadable_on_error(recordings[0]):
            means = without_time(open_table(recordings[0]).names, layout, str(recordings[0]))
        if means:
            return means
    for index, path in enumerate(recordings):
        if is_table(path):
            open_scanner(path, layout=layout.of_recording(index, len(recordings)))
    return None


def refine_recordings(arguments: Namespace, paths: Sequence[Path], joint: str | None,
                      show: Callable[..., None] = lambda *_: None
                      ) -> tuple[RefineResult, History | None]:
    """Refine a model on recordings of one joint together, by the arguments of the tool `refine`.

    `show` is called with the share 0..1 that is done and a description. With ``--history``, the
    model's history with the new recordings is returned as well, else None.
    """
    from friction_comp.recordings.condense import read_condensed
    from friction_comp.recordings.history import History

    model = None
    if arguments.model:
        from friction_comp.model.friction_model import FrictionModel

        model = FrictionModel.load(arguments.model, joint)
    drive = drive_of(arguments, model)
    history = (History.beside(arguments.model, drive, model.joint)
               if model and arguments.history else None)
    recordings = read_condensed(
        paths, joint, drive.torque_constant, drive.gear_ratio,
        progress=lambda share: show(0.2 * share, 'reading'), layout=layout_of(arguments))
    if model:
        model.check_joint(recordings[0][1].joint, arguments.model)
    unit = unit_of(arguments, model, [info for _, info in recordings])
    usable, = showing_friction({joint or '': recordings}).values()
    recorded = [samples for samples, _ in usable]
    if idle := model is None and _idle(arguments, recorded):
        unit = 'N·m'
    drive, limit = with_current_limit(arguments, drive, recorded)
    if history is not None:
        for samples, info in usable:
            history.add(samples, info)
        recorded = history.samples()
        _check_loads((one.name, one.samples) for one in history.recordings)
    # Only now: importing the search takes longer than reading most recordings, and an unusable one
    # is refused at once.
    from friction_comp.refinement import Origin, refine

    # Without its constants, a drive does not tell how much current a recorded load takes.
    known = (model or arguments.torque_constant or arguments.gear_ratio
             or unit in ('N·m', 'N') or idle)
    origin = Origin(unit, bool(known), notes_on(recordings, idle), {
        'refined_from': [str(path) for path in paths], **_of_table(arguments), **limit,
        **({'position_unit': 'm'} if any(info.linear for _, info in recordings) else {})})
    with errors_name(f'{paths[0]}: {joint}' if joint else paths[0]):
        result = refine(
            recorded, model, drive, origin=origin,
            progress=lambda share, name: show(0.2 + 0.7 * share, f'trying {name}'))
    return result, history


def notes_on(recordings: Iterable[tuple[Samples, RecordingInfo]], idle: bool = False) -> list[str]:
    """Return the notes on recordings as warnings of a report; `idle` is that of the motor."""
    return [f'{info.path}: {note}' for _, info in recordings for note in info.notes] + [
        'the motor was idle: friction is what the load (torque sensor) overcame, in N·m'] * idle


def _idle(arguments: Namespace, recorded: Sequence[Samples]) -> bool:
    """Return whether the motor had no current and a load moved the joint.

    The fit is then made in the load's unit, N·m, unless torque constant and gear ratio are given.
    """
    return (not arguments.torque_constant and not arguments.figures and all(
        samples.load is not None and not samples.current.any() for samples in recorded))


def _of_table(arguments: Namespace) -> dict[str, Any]:
    """Return how the columns of a table were read, for whoever reads it again."""
    return {f'{name}_of_table': value for name in OF_TABLE
            if (value := getattr(arguments, name))}


def showing_friction(recorded: Mapping[str, list[tuple[Samples, RecordingInfo]]]
                     ) -> dict[str, list[tuple[Samples, RecordingInfo]]]:
    """Return what of the joints' recordings shows friction; raises InputError if nothing does.

    Unless the load of all joints was recorded in all recordings, it is what no compensation law
    drove. Joints of an arm keep the same recordings, since they are fitted together.
    """
    from friction_comp.recordings.joint_samples import without_compensation

    for parts in recorded.values():
        _check_loads((info.path, samples) for samples, info in parts)
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


def _check_loads(recorded: Iterable[tuple[object, Samples]]) -> None:
    """Raise InputError if the load was measured in some recordings (name, samples) only.

    Fitted together they have no load, and what the person did would count as friction.
    """
    names = {samples.load is not None: name for name, samples in recorded}
    if len(names) > 1:
        raise InputError(f'{names[True]}: has a load (interaction_wrench), and {names[False]} has '
                         'none: refine them separately')


def folder_names(names: Iterable[str]) -> list[str]:
    """Return a different name of a folder for each name of a joint or recording."""
    folders: list[str] = []
    for name in names:
        folder = re.sub(r'[^\w.-]', '_', name).lstrip('.') or '_'
        while folder in folders:
            folder += '_'
        folders.append(folder)
    return folders


def print_summary(report: RefinementReport) -> None:
    """Print the report of a refinement in a few lines."""
    from friction_comp.reports.friction_words import number_lines
    from friction_comp.reports.html import number, quantity

    unit, before, after = report.unit, report.before, report.after
    print('friction in sliding, with 95 % intervals:')
    for line in number_lines(report.friction):
        print(f'  {line}')
    print(report.friction.formula)
    print(f'verdict: {report.verdict}')
    for line in report.reasons:
        print(f'  {line}')
    for line in report.record_again:
        print(f'  record: {line}')
    print(f'before: {quantity(before.held_out_rmse, unit)} RMS on data not fitted '
          f'({before.model})')
    for effect in report.effects:
        print(f'  + {effect.name} ({effect.variable}): {quantity(effect.held_out_rmse, unit)}   '
              f'{effect.in_words} (chosen in {100 * effect.chosen:.0f} % of the searches)')
    if not report.effects:
        print('  no effect beyond the model shows in the recordings')
    print(f'after:  {quantity(after.held_out_rmse, unit)} RMS on data not fitted; noise floor '
          f'{quantity(report.noise_floor, unit)}')
    print(f'        {quantity(after.worst_part_rmse, unit)} in the worst part; to expect '
          f'elsewhere: {quantity(after.elsewhere_motion_rmse, unit)} in motion, '
          f'{quantity(after.elsewhere_rmse, unit)} with standstill, where friction is whatever '
          'holds the joint')
    for entry in report.unexplained:
        print(f'unexplained: {entry.variable} ({number(entry.strength)} of the remaining variance)')
    for question in report.ambiguous:
        print(f"ambiguous: {' or '.join(question.between)}: {question.why}")
    for line in report.warnings:
        print(f'note: {line}')
