# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The file of a whole arm: the model of each joint, and once what they share."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from friction_comp.checks import check_document, check_mapping, one_of
from friction_comp.files import write_yaml

FORMAT, VERSION = 'friction_comp_arm', 1


def write_arm(path: str | Path, models: Mapping[str, Any]) -> None:
    """Write the file of a whole arm, from the `FrictionModel` of each joint.

    The links of the arm, which are the same in all of them, are written once. Of an arm with links,
    only friction that turns with two joints is one joint's own.
    """
    documents = {name: model.to_dict() for name, model in models.items()}
    shared = [model['arm'] for model in documents.values() if 'links' in model.get('arm', {})]
    document: dict[str, Any] = {'format': FORMAT, 'version': VERSION, 'joints': {}}
    for name, model in documents.items():
        if shared and 'links' in model.get('arm', {}):
            own = {key: model['arm'][key] for key in ('friction',) if key in model['arm']}
            model = {**model, 'arm': own or 'shared'}
        document['joints'][name] = model
    if shared:
        document['arm'] = {name: value for name, value in shared[0].items() if name != 'friction'}
    write_yaml(path, document)


def joints_of(document: Any) -> list[str] | None:
    """Return the joints of a whole arm's document; None if it describes one joint."""
    if not isinstance(document, dict) or document.get('format') != FORMAT:
        return None
    check_document(document, 'a file of a whole arm', FORMAT, VERSION)
    return [str(name) for name in check_mapping(document.get('joints') or None, 'joints')]


def one_joint_of(document: Any, joint: str | None) -> Any:
    """Return the document of one joint; that of a single joint unchanged.

    Raises InputError if it lacks the joint, or has several and none is given.
    """
    names = joints_of(document)
    if names is None:
        return document
    joint = one_of(names, joint)
    model = document['joints'][joint]
    own = model.get('arm') if isinstance(model, dict) else None
    if own == 'shared' or (isinstance(own, dict) and list(own) == ['friction']):
        model = {**model, 'arm': {**(document.get('arm') or {}),
                                  **(own if isinstance(own, dict) else {})}}
    return model
