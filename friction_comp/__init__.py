# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification and compensation of friction in geared robot drives.

A drive's current is a sum of effects, and the same sum predicts, explains and compensates. Four
principles keep the package small:

1. Nothing is inferred that can be declared: what a short table of names and units does not say is
   declared with ``--columns`` and ``--unit``, and the message that asks is the command to copy.
2. A question is asked once: each check of a signal is one function with one limit, in `facts`.
3. The robot never imports the laboratory: what moves a motor imports no search, pages,
   `scipy.stats` or Matplotlib.
4. No rule for one file: a rule stays if figures get worse without it on at least two sets that it
   was not made for.

Public names are imported when they are first used::

    from friction_comp import FrictionModel, read_recording, refine

docs/architecture.md describes the rooms, as the subpackages are called.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from friction_comp.compensation.law import CompensationLaw
    from friction_comp.drive import Drive
    from friction_comp.errors import InputError
    from friction_comp.evaluation.conditions import evaluate
    from friction_comp.identification.goal import IdentificationGoal
    from friction_comp.identification.run import IdentificationRun
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.recordings.reader import read_recording
    from friction_comp.refinement import refine
    from friction_comp.samples import Samples
    from friction_comp.tables.columns import Layout
    from friction_comp.tables.table_recording import read_frame

__version__ = '0.2.0'

__all__ = [
    'CompensationLaw', 'Drive', 'FrictionModel', 'IdentificationGoal', 'IdentificationRun',
    'InputError', 'Layout', 'Samples', 'evaluate', 'read_frame', 'read_recording',
    'refine',
]

_HOMES = {
    'CompensationLaw': 'friction_comp.compensation.law',
    'Drive': 'friction_comp.drive',
    'FrictionModel': 'friction_comp.model.friction_model',
    'IdentificationGoal': 'friction_comp.identification.goal',
    'IdentificationRun': 'friction_comp.identification.run',
    'InputError': 'friction_comp.errors',
    'Layout': 'friction_comp.tables.columns',
    'Samples': 'friction_comp.samples',
    'evaluate': 'friction_comp.evaluation.conditions',
    'read_frame': 'friction_comp.tables.table_recording',
    'read_recording': 'friction_comp.recordings.reader',
    'refine': 'friction_comp.refinement',
}


def __getattr__(name: str) -> object:
    """Import a public name when it is first used (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value
