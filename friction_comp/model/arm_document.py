# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The model file of a whole arm: one model per joint, and what they share once."""

from __future__ import annotations

from typing import Any

from friction_comp.checks import check_document, check_mapping
from friction_comp.errors import InputError

FORMAT = 'friction_comp_arm'
VERSION = 1


def arm_document(models: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return the document of a whole arm, from each joint's own document.

    What all joints say alike of their arm stands in it once.
    """
    shared = [model['arm'] for model in models.values() if 'links' in model.get('arm', {})]
    document: dict[str, Any] = {'format': FORMAT, 'version': VERSION, 'joints': {}}
    for name, model in models.items():
        if shared and model.get('arm') == shared[0]:
            model = {**model, 'arm': 'shared'}
        document['joints'][name] = model
    if shared:
        document['arm'] = shared[0]
    return document


def joints_of(document: Any) -> list[str] | None:
    """Return the joints of a whole arm's document; None where it is that of one joint."""
    if not isinstance(document, dict) or document.get('format') != FORMAT:
        return None
    check_document(document, 'a file of a whole arm', FORMAT, VERSION)
    return [str(name) for name in check_mapping(document.get('joints') or None, 'joints')]


def one_joint_of(document: Any, joint: str | None) -> Any:
    """Return one joint's own document; that of a single joint is returned as it is.

    Raises InputError if the joint is not in it, or none was named where there are several.
    """
    names = joints_of(document)
    if names is None:
        return document
    listed = ', '.join(map(repr, names))
    if not joint and len(names) > 1:
        raise InputError(f'holds several joints, name one (--joint): {listed}')
    joint = joint or names[0]
    if joint not in names:
        raise InputError(f'holds no joint {joint!r}, but {listed}')
    model = document['joints'][joint]
    if isinstance(model, dict) and model.get('arm') == 'shared':
        model = {**model, 'arm': document.get('arm')}
    return model
