# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments, what they tell of recordings, and results, shared by all tools.

Tools import their computations only after parsing the arguments, so that ``--help`` and invalid
arguments are answered at once.
"""

from __future__ import annotations

import argparse
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
import inspect
from pathlib import Path
import shlex
import sys
from typing import Any, NoReturn, TYPE_CHECKING, TypeVar

from friction_comp.errors import check_number, check_whole_number, InputError
from friction_comp.files import (
    check_file,
    check_folder,
    output_folder,
    write_atomically,
    write_report,
)
from friction_comp.tables.columns import Layout

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel

T = TypeVar('T')


class Arguments(argparse.ArgumentParser):
    """An argument parser that reports an error in one line and exits with status 2.

    Name and description are those of the tool's function.
    """

    def __init__(self, tool: Callable[..., object], examples: Sequence[str] = ()) -> None:
        name, description = tool.__name__, inspect.cleandoc(tool.__doc__ or '')
        lines = [f'  python3 -m friction_comp {name} {example}'.rstrip() for example in examples]
        super().__init__(
            prog=f'python3 -m friction_comp {name}', description=description,
            allow_abbrev=False, epilog='\n'.join(['examples:', *lines]) if lines else None,
            formatter_class=partial(argparse.RawDescriptionHelpFormatter, width=100,
                                    max_help_position=26))
        self._name = name
        self._check_output: Callable[[Path], None] | None = None

    def error(self, message: str) -> NoReturn:
        """Exit with status 2 and one line on standard error."""
        self.exit(2, f'{self._name}: {message} (try --help)\n')

    def parse(self, argv: Sequence[str] | None = None) -> Namespace:
        """Return the arguments, with the `command` as code, and its ROS arguments as `ros`."""
        given = list(sys.argv[1:] if argv is None else argv)
        needed = [action for action in self._actions if action.required]
        self.usage = ' '.join(['%(prog)s', *(
            f'{" ".join(action.option_strings[:1])} {action.metavar or "FORM"}'.strip()
            + ' …' * (action.nargs == '+') for action in needed), '[OPTION …]'])
        end = given.index('--ros-args') if '--ros-args' in given else len(given)
        parsed = self.parse_args(given[:end])
        for name in ('columns', 'unit'):
            if parts := getattr(parsed, name, None):
                setattr(parsed, name, ','.join(parts))
        parsed.ros = given[end:]
        parsed.command = f'`friction_comp {shlex.join([self._name, *given])}`'
        if self._check_output is not None:
            self._check_output(parsed.output)
        return parsed

    def add_recordings(self, several: bool = True, unit_help: str = '') -> Arguments:
        """Add the arguments for recordings: RECORDING, --joint, --columns and --unit."""
        self.add_argument(
            'recordings' if several else 'recording', metavar='RECORDING', type=Path,
            nargs='+' if several else None,
            help='rosbag2 folder, .mcap file, or table (.csv, .parquet, .npz, .mat, .h5; '
            'with a signal each, q.csv+tau.csv)'
            + ('; or a folder of recordings other than tables' if several else ''))
        self.add_argument('--joint', metavar='NAME', help='the joint, where there are several; '
                          '/TOPIC/NAME if several topics have it')
        self.add_argument(
            '--columns', metavar='SIGNAL=COLUMN', action='append',
            help='columns of a table: time=t,position=q_2,effort=tau_2')
        self.add_argument(
            '--unit', metavar='SIGNAL=UNIT', action='append',
            help='units that are not SI: time=ms,position=deg,current=2.69mA' + unit_help)
        self.add_argument('--rate', metavar='HZ', type=positive,
                          help='rows per second of a table without times, or of a plan')
        self.add_argument(
            '--stiffness', metavar='KP', type=positive, help='k_p in N·m/rad, of a table with a '
            'target instead of effort: effort is k_p (target - position) - k_d velocity')
        self.add_argument(
            '--damping', metavar='KD', help='k_d in N·m·s/rad, as --stiffness',
            type=lambda text: _checked(text, float, lambda gain: check_number(gain, '', least=0.0)))
        return self

    def add_output(self, file: str = '') -> Arguments:
        """Add --output: a folder, or a file that holds what `file` says."""
        self.add_argument('--output', metavar='FILE' if file else 'DIR', type=Path, required=True,
                          help=file or 'folder for the results, created if missing')
        self._check_output = check_file if file else check_folder
        return self


def positive(text: str) -> float:
    """Return a positive finite number from an argument."""
    return _checked(text, float, lambda value: check_number(value, '', above=0.0))


def whole_number(least: int = 1) -> Callable[[str], int]:
    """Return a type for an argument that is an integer of at least `least`."""
    return lambda text: _checked(text, int, lambda value: check_whole_number(
        value, '', least=least))


def _checked(text: str, kind: Callable[[str], T], check: Callable[[object], T]) -> T:
    value: object = text
    with suppress(ValueError):
        value = kind(text)
    try:
        return check(value)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error).strip()) from None


def layout_of(arguments: Namespace) -> Layout:
    """Return the layout of a table according to the arguments that describe it."""
    columns, units = (_pairs(arguments, name, example) for name, example in (
        ('columns', 'time=t,position=q_2'), ('unit', 'time=ms,position=deg')))
    if arguments.damping and not arguments.stiffness:
        raise InputError('--damping goes with --stiffness, the other gain of the controller')
    try:
        return Layout(columns, units, arguments.rate, arguments.stiffness, arguments.damping,
                      arguments.joint or '')
    except InputError as error:
        raise InputError(f'--columns or --unit: {error}') from None


def _pairs(arguments: Namespace, what: str, example: str) -> dict[str, str]:
    """Parse ``a=b,c=d`` into a dictionary; InputError, with an example, if it is invalid."""
    pairs: dict[str, str] = {}
    for part in filter(None, (getattr(arguments, what) or '').split(',')):
        name, sign, value = (piece.strip() for piece in part.partition('='))
        if not (name and sign and (value or what == 'columns')):
            raise InputError(f'--{what}: {part.strip()!r} is not of the form '
                             f'SIGNAL={what.upper().rstrip("S")}, for instance {example}')
        if name in pairs:
            raise InputError(f'--{what}: names {name} twice')
        pairs[name] = value
    return pairs


def write_results(arguments: Namespace, content: dict[str, Any], page: Any,
                  model: FrictionModel | None = None, files: Mapping[str, str] | None = None
                  ) -> None:
    """Write report.json, report.html, model.yaml and texts by file name to --output, or nothing."""
    with output_folder(arguments.output) as folder:
        write_report(folder, content, page, arguments.command)
        if model is not None:
            model.save(folder / 'model.yaml')
        for name, text in (files or {}).items():
            write_atomically(folder / name, text, sync=False)
