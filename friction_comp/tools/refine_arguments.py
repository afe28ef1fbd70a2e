# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the tools that read recordings share: arguments on tables and drives, and the summary."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable
import re

from friction_comp.checks import check_number
from friction_comp.column_values import read_pairs
from friction_comp.columns import without_time
from friction_comp.errors import InputError
from friction_comp.files import file_names
from friction_comp.layout import Layout
from friction_comp.recorded_drive.given import Given
from friction_comp.used_columns import Column

OF_TABLE = ('columns', 'unit', 'rate', 'stiffness', 'damping')
"""Arguments that tell how the columns of a table are read."""


def given_of(arguments: Namespace) -> Given:
    """Return what the arguments tell of a drive and its recordings."""
    return Given(
        joint=arguments.joint, model=arguments.model, torque_constant=arguments.torque_constant,
        gear_ratio=arguments.gear_ratio, figures=arguments.figures,
        layout=layout_of(arguments),
        of_table={f'{name}_of_table': value for name in OF_TABLE
                  if (value := getattr(arguments, name))})


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
    def read(one: str) -> float | str:
        try:
            return check_number(float(one), 'a gain', least=0.0)
        except ValueError:
            return one
    return tuple(read(one.strip()) for one in text.split(',')) if text else ()


def check_tables(arguments: Namespace) -> tuple[Column, Column] | None:
    """Raise InputError for tables that cannot be used, before anything slow is imported.

    Returns velocity and effort if the only recording is a table of steady states.
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


def folder_names(names: Iterable[str]) -> list[str]:
    """Return a different name of a folder for each name of a joint or recording."""
    return file_names(re.sub(r'[^\w./-]', '_', name).strip('/').lstrip('.') or '_'
                      for name in names)
