# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The schema of model files, of one joint or of a whole arm; msg_docs describes the sections.

A file of one joint holds the arguments of `FrictionModel`. That of an arm holds one of these for
each joint, and once what they share, the links.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from friction_comp.checks import (
    check_document,
    check_interval,
    check_mapping,
    listed,
    mapping,
    number,
    one_of,
    Reader,
    section,
)
from friction_comp.drive import Drive
from friction_comp.errors import errors_name, InputError
from friction_comp.files import read_yaml, write_yaml
from friction_comp.model.differentiation import settings_of
from friction_comp.model.effects import Effect, EFFECTS
from friction_comp.model.measured import Breakaway, Presliding, Recorded
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.results import plain

FORMAT, ARM_FORMAT, VERSION = 'friction_comp_model', 'friction_comp_arm', 1
# Sections of which any says that friction was measured: then Eq. 6 must not be missing.
_MEASURED = {'sigmoid', 'breakaway', 'presliding', 'effects', 'lookup_table', 'recorded', 'arm'}
_OF_BREAKAWAY = ('mean', 'std', 'position')
_SIDES = ('positive', 'negative')


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
    check_document(document, 'a model file', FORMAT, VERSION, {'format', 'version', *_SECTIONS})
    given = {name: value for name, value in document.items() if value is not None}
    needed = {'drive', *(['sigmoid'] if given.keys() & _MEASURED else [])}
    return {'sigmoid': Sigmoid(0.0, 0.0, 1.0), **{
        name: read(given.get(name), name) for name, read in _SECTIONS.items()
        if name in given or name in needed}}


def document_of(model: Any) -> dict[str, Any]:
    """Return a `FrictionModel` as the plain values of its file."""
    document: dict[str, Any] = {'format': FORMAT, 'version': VERSION, 'joint': model.joint}
    for name in _SECTIONS:
        value = getattr(model, name)
        if name in ('drive', 'presliding', 'recorded') and value is not None:
            value = _entries(value)
        elif name == 'sigmoid':
            value = {'coefficients': value.coefficients(), 'velocity_unit': 'rad/s'}
        elif name == 'breakaway' and value is not None:
            known = _entries(value)
            value = {side: {what: known[f'{side}_{what}'] for what in _OF_BREAKAWAY
                            if f'{side}_{what}' in known} for side in _SIDES}
        elif name == 'arm' and value is not None:
            value = value.to_dict()
        elif name == 'effects':
            value = [effect.to_dict() for effect in value]
        if value is not None and (value != {} or name == 'effects'):
            document[name] = value
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


def _sigmoid(value: Any, name: str) -> Sigmoid:
    check_mapping(value, name, ('coefficients', 'velocity_unit'))
    return Sigmoid.from_coefficients(value.get('coefficients'), value.get('velocity_unit', 'rad/s'))


def _breakaway(value: Any, name: str) -> Breakaway:
    check_mapping(value, name, _SIDES)
    return section(Breakaway)({
        f'{side}_{what}': one for side in _SIDES for what, one in check_mapping(
            value.get(side), f'{name}.{side}', _OF_BREAKAWAY).items()}, name)


def _position_limits(value: Any, name: str) -> tuple[float, float]:
    low, high = check_interval(value, name)
    if low == high:
        raise InputError(f'{name} must be two different positions, not {value!r}')
    return low, high


def _lookup_table(value: Any, name: str) -> dict[str, Any]:
    table = mapping(dict.fromkeys(('speeds', 'currents', 'standard_deviations'),
                                  listed(number())))(value, name)
    if len(table.get('speeds') or ()) != len(table.get('currents') or ()):
        raise InputError(f'{name}: speeds and currents must have the same length')
    return table


def _arm(value: Any, name: str) -> Any:
    # Few files have one.
    from friction_comp.model.arm import Arm

    return Arm.from_dict(check_mapping(value, name))


def _effect(entry: Any, _: str) -> Effect:
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


_SECTIONS: dict[str, Reader] = {
    'joint': lambda value, _: str(value), 'drive': section(Drive), 'sigmoid': _sigmoid,
    'breakaway': _breakaway, 'presliding': section(Presliding),
    'position_limits': _position_limits, 'uncertainty': number(least=0.0),
    'effects': lambda value, name: list(listed(_effect)(value, name)),
    'recorded': section(Recorded), 'lookup_table': _lookup_table, 'differentiation': settings_of,
    'simulation': check_mapping, 'notes': check_mapping, 'arm': _arm}
"""The sections of a model file, by the fields of `FrictionModel`, and how each is read."""
