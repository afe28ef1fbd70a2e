# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is told of a recorded drive, and what follows from it: the drive, its limit and its unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TYPE_CHECKING

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.tables import units
from friction_comp.tables.columns import Layout

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.samples import RecordingInfo, Samples


@dataclass(frozen=True)
class Given:
    """What is told of the recordings of a joint; all of it is optional."""

    joint: str | None = None
    model: Path | None = None  # to start from
    torque_constant: float | None = None
    gear_ratio: float | None = None
    figures: str | None = None  # unit of the figures in the report
    layout: Layout = field(default_factory=Layout)  # of a table
    of_table: dict[str, Any] = field(default_factory=dict)  # its arguments, for the model file


def drive_of(given: Given, model: FrictionModel | None) -> Drive:
    """Return the model's drive, in which given constants replace its own, or a drive of these.

    Without a model and constants, the effort of the recordings is taken as current.
    """
    constants: dict[str, Any] = {name: value for name, value in (
        ('torque_constant', given.torque_constant), ('gear_ratio', given.gear_ratio))
        if value is not None}
    if model is not None:
        return replace(model.drive, **constants)
    if len(constants) == 1:
        raise InputError('--torque-constant and --gear-ratio belong together: give 1 for the one '
                         'that effort already contains')
    return Drive(**{'torque_constant': 1.0, 'gear_ratio': 1.0, **constants})


def with_current_limit(given: Given, drive: Drive, recorded: list[Samples]
                       ) -> tuple[Drive, dict[str, str]]:
    """Return the drive with its current limit, and a note on the origin of the limit.

    It is that of the model given, else the largest current that lasted, which the drive has
    withstood.
    """
    largest = max(map(_largest_lasting_current, recorded), default=0.0)
    if given.model or not largest > 0.0:
        return drive, {}
    return (replace(drive, current_limit=float(f'{largest:.4g}')),
            {'current_limit': 'the largest current that lasted in the recordings'})


def _largest_lasting_current(samples: Samples) -> float:
    """Return the largest magnitude of running medians, A; 0 where no current is finite."""
    import numpy as np

    size = np.abs(samples.current[np.isfinite(samples.current)])
    # Over 0.05 s, which removes single wrong samples.
    half = max(round(0.025 / max(samples.sample_time, 1e-6)), 1)
    if len(size) <= 2 * half:
        return float(np.median(size)) if size.size else 0.0
    windows = np.lib.stride_tricks.sliding_window_view(size, 2 * half + 1)[::max(half // 2, 1)]
    return float(np.median(windows, axis=1).max())


def unit_of(given: Given, model: FrictionModel | None, infos: Sequence[RecordingInfo] = ()) -> str:
    """Return the unit of the fitted signal: A if the drive is known, else that of the effort.

    The user's comes first, then the drive's, the recordings', and that in the name of the column.
    """
    if model is not None and not (given.figures or given.torque_constant or given.gear_ratio):
        return str(model.notes.get('unit', 'A'))
    recorded = next((info.effort_unit for info in infos if info.effort_unit), '')
    if recorded and not given.figures:
        return recorded
    return figures_unit(given, any(info.effort_is_current for info in infos),
                        any(info.linear for info in infos))


def figures_unit(given: Given, in_ampere: bool, linear: bool) -> str:
    """Return the unit without a model; `linear` is whether positions are lengths."""
    if given.figures:
        return str(given.figures)
    if given.torque_constant is not None or given.gear_ratio is not None or in_ampere:
        return 'A'
    text = given.layout.units.get('effort', 'N' if linear else 'N·m')
    unit = units.unit_of('effort', text)
    # A unit that is no torque, such as 0.1 %, is kept as it is.
    return text if unit is None else {'torque': 'N·m', 'force': 'N', 'current': 'A'}[unit.dimension]
