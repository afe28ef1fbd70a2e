# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The schema of model files, of one joint or of a whole arm; msg_docs describes the sections.

A file of one joint holds the arguments of `FrictionModel`. That of an arm holds one of these for
each joint, and once what they share, the links.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, MISSING
from pathlib import Path
from typing import Any, TypeVar

from friction_comp.checks import (
    check_document,
    check_interval,
    check_list,
    check_mapping,
    check_number,
    one_of,
)
from friction_comp.drive import Drive
from friction_comp.errors import errors_name, InputError
from friction_comp.files import read_yaml, write_yaml
from friction_comp.model.differentiation import settings_of
from friction_comp.model.effects import Effect, EFFECTS
from friction_comp.model.measured import Breakaway, INTERVALS, Presliding, Recorded, SIGNALS_OF_ROWS
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.results import plain

FORMAT, ARM_FORMAT, VERSION = 'friction_comp_model', 'friction_comp_arm', 1
# Sections of which any says that friction was measured: then Eq. 6 must not be missing.
_MEASURED = {'sigmoid', 'breakaway', 'presliding', 'effects', 'lookup_table', 'recorded', 'arm'}
_OF_BREAKAWAY = ('mean', 'std', 'position')
_SIDES = ('positive', 'negative')

T = TypeVar('T')


def read_model(path: str | Path, joint: str | None = None) -> dict[str, Any]:
    """Return the arguments of the `FrictionModel` in a file; of an arm's file that of one joint.

    Raises InputError, which names the file and the reason, if it cannot be used.
    """
    document = read_yaml(path)
    with errors_name(path):
        try:
            return arguments_of(one_joint_of(document, joint))
        except OverflowError:
            raise InputError('holds a number that is too large') from None


def arguments_of(document: Any) -> dict[str, Any]:
    """Return the arguments of the `FrictionModel` in a document; raises InputError."""
    known = {'format', 'version', 'joint', 'drive', 'sigmoid', 'effects', *_OPTIONAL}
    check_document(document, 'a model file', FORMAT, VERSION, known)
    given = {name: value for name, value in document.items() if value is not None}
    return {
        'drive': _section(Drive, given.get('drive'), 'drive'),
        'sigmoid': (_sigmoid(given.get('sigmoid')) if given.keys() & _MEASURED
                    else Sigmoid(0.0, 0.0, 1.0)),
        'effects': [_effect(entry) for entry in check_list(given.get('effects'), 'effects')],
        'joint': str(given.get('joint', '')),
        **{name: read(given[name]) for name, read in _OPTIONAL.items() if name in given}}


def document_of(model: Any) -> dict[str, Any]:
    """Return a `FrictionModel` as the plain values of its file."""
    document: dict[str, Any] = {
        'format': FORMAT, 'version': VERSION, 'joint': model.joint, 'drive': _entries(model.drive),
        'sigmoid': {'coefficients': model.sigmoid.coefficients(), 'velocity_unit': 'rad/s'}}
    if model.breakaway is not None:
        known = _entries(model.breakaway)
        document['breakaway'] = {side: {
            what: known[f'{side}_{what}'] for what in _OF_BREAKAWAY
            if f'{side}_{what}' in known} for side in _SIDES}
    if model.presliding is not None:
        document['presliding'] = _entries(model.presliding)
    for name in ('position_limits', 'uncertainty'):
        if getattr(model, name) is not None:
            document[name] = getattr(model, name)
    document['effects'] = [effect.to_dict() for effect in model.effects]
    if model.recorded is not None:
        document['recorded'] = _entries(model.recorded)
    for name in ('lookup_table', 'differentiation', 'simulation', 'notes'):
        if getattr(model, name):
            document[name] = getattr(model, name)
    if model.arm is not None:
        document['arm'] = model.arm.to_dict()
    return plain(document)


def write_arm(path: str | Path, models: Mapping[str, Any]) -> None:
    """Write the file of a whole arm, from the `FrictionModel` of each joint.

    Of an arm with links, only friction that turns with two joints is one joint's own.
    """
    documents = {name: document_of(model) for name, model in models.items()}
    document: dict[str, Any] = {'format': ARM_FORMAT, 'version': VERSION, 'joints': documents}
    for model in documents.values():
        links = model.get('arm', {})
        if 'links' in links:
            document['arm'] = {name: value for name, value in links.items() if name != 'friction'}
            model['arm'] = {'friction': links['friction']} if 'friction' in links else 'shared'
    write_yaml(path, document)


def joints_of(document: Any) -> list[str] | None:
    """Return the joints of a whole arm's document; None if it describes one joint."""
    if not isinstance(document, dict) or document.get('format') != ARM_FORMAT:
        return None
    check_document(document, 'a file of a whole arm', ARM_FORMAT, VERSION)
    return [str(name) for name in check_mapping(document.get('joints') or None, 'joints')]


def one_joint_of(document: Any, joint: str | None) -> Any:
    """Return the document of one joint; that of a single joint unchanged.

    Raises InputError if it lacks the joint, or has several and none is given.
    """
    names = joints_of(document)
    if names is None:
        return document
    model = document['joints'][one_of(names, joint)]
    own = model.get('arm') if isinstance(model, dict) else None
    if own == 'shared' or (isinstance(own, dict) and list(own) == ['friction']):
        model = {**model, 'arm': {**(document.get('arm') or {}),
                                  **(own if isinstance(own, dict) else {})}}
    return model


def _entries(section: Any) -> dict[str, Any]:
    return {name: value for name, value in vars(section).items()
            if value is not None and value != {}}


def _section(kind: type[T], section: Any, name: str) -> T:
    known = fields(kind)  # type: ignore[arg-type]
    check_mapping(section, name, [entry.name for entry in known])
    for entry in known:
        if entry.default is MISSING and entry.name not in section:
            raise InputError(f'{name}.{entry.name} is missing')
    return kind(**section)


def _sigmoid(section: Any) -> Sigmoid:
    check_mapping(section, 'sigmoid', ('coefficients', 'velocity_unit'))
    if not isinstance(section.get('coefficients'), list):
        raise InputError('sigmoid.coefficients is missing or not a list')
    return Sigmoid.from_coefficients(section['coefficients'], section.get('velocity_unit', 'rad/s'))


def _breakaway(section: Any) -> Breakaway:
    check_mapping(section, 'breakaway', _SIDES)
    sides = {side: check_mapping(section.get(side), f'breakaway.{side}', _OF_BREAKAWAY)
             for side in _SIDES}
    return Breakaway(**{
        f'{side}_{what}': check_number(entry.get(what), f'breakaway.{side}.{what}')
        for side, entry in sides.items() for what in _OF_BREAKAWAY
        if what == 'mean' or entry.get(what) is not None})


def _position_limits(section: Any) -> tuple[float, float]:
    low, high = check_interval(section, 'position_limits')
    if low == high:
        raise InputError(f'position_limits must be two different positions, not {section!r}')
    return low, high


def _numbers(values: Any, name: str, above: float = -float('inf')) -> tuple[float, ...]:
    return tuple(check_number(value, name, above=above) for value in check_list(values, name))


def _lookup_table(section: Any) -> dict[str, list[float]]:
    check_mapping(section, 'lookup_table', ('speeds', 'currents', 'standard_deviations'))
    table = {name: list(_numbers(values, f'lookup_table.{name}'))
             for name, values in section.items()}
    if len(table.get('speeds', ())) != len(table.get('currents', ())):
        raise InputError('lookup_table: speeds and currents must have the same length')
    return table


def _recorded(section: Any) -> Recorded:
    check_mapping(section, 'recorded', [entry.name for entry in fields(Recorded)])

    def ends(name: str, known: tuple[str, ...] | None = None) -> dict[str, tuple[float, float]]:
        part = check_mapping(section.get(name) or {}, f'recorded.{name}', known)
        return {str(key): check_interval(value, f'recorded.{name}.{key}')
                for key, value in part.items()}

    def number(name: str, default: float | None = None, least: float = 0.0) -> Any:
        value = section.get(name, default)
        return None if value is None else check_number(value, f'recorded.{name}', least=least)
    rows = {name: _numbers(values, f'recorded.rows.{name}') for name, values in check_mapping(
        section.get('rows') or {}, 'recorded.rows', SIGNALS_OF_ROWS).items()}
    if rows and (not {'position', 'velocity'} <= rows.keys() or not rows['position']
                 or len(set(map(len, rows.values()))) > 1):
        raise InputError('recorded.rows must have position and velocity, and all as many values')
    return Recorded(
        _numbers(section.get('speeds'), 'recorded.speeds', above=0.0), ends('intervals', INTERVALS),
        ends('ranges'), number('error'), number('load', 0.0, -float('inf')), number('sample_time'),
        rows)


def _arm(section: Any) -> Any:
    # Few files have one.
    from friction_comp.model.arm import Arm

    return Arm.from_dict(check_mapping(section, 'arm'))


def _effect(entry: Any) -> Effect:
    if not isinstance(entry, dict) or 'name' not in entry:
        raise InputError(f'an effect needs a name: {entry!r}')
    name = f"effect '{entry['name']}'"
    kind = EFFECTS.get(str(entry['name']))
    if kind is None:
        raise InputError(f"unknown {name}; known: {', '.join(EFFECTS)}")
    check_mapping(entry, name, ('name', 'variable', 'parameters', 'valid_range'))
    parameters = check_mapping(entry.get('parameters') or {}, f'parameters of {name}')
    try:
        return kind(parameters, entry.get('valid_range'))
    except (InputError, OverflowError) as error:
        raise InputError(f'{name}: {error}') from None


_OPTIONAL: dict[str, Callable[[Any], Any]] = {
    'breakaway': _breakaway,
    'presliding': lambda section: _section(Presliding, section, 'presliding'),
    'position_limits': _position_limits,
    'uncertainty': lambda value: check_number(value, 'uncertainty', least=0.0),
    'lookup_table': _lookup_table,
    'recorded': _recorded,
    'differentiation': lambda section: settings_of(section, 'differentiation'),
    'arm': _arm,
    'simulation': lambda section: check_mapping(section, 'simulation'),
    'notes': lambda section: check_mapping(section, 'notes')}
"""Sections that a model file may have, and how each is read."""
