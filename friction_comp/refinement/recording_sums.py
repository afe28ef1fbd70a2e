# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The sums of a recording that suffice to fit Eq. 6 and given effects to any set of recordings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.effect_columns import Table, Term
from friction_comp.refinement.prepare import join, prepare
from friction_comp.samples import Samples


def sums_of_recordings(recorded: Sequence[Samples], terms: Sequence[Term],
                       transition: tuple[float, float], drive: Drive | None = None,
                       settings: dict[str, Any] | None = None) -> BlockSums:
    """Return the sums of recordings over blocks of time.

    Parameters
    ----------
    recorded : sequence of Samples
        Recordings of one joint.
    terms : sequence of Term
        The effects.
    transition : tuple of float
        Steepness, s/rad, and shift, rad/s, of Eq. 6.
    drive : Drive, optional
        If its torque constant and gear ratio are known.
    settings : dict, optional
        Those of the differentiation; chosen when omitted.

    Returns
    -------
    BlockSums
        With the columns of Eq. 6, as in `effect_columns.eq6_columns`, then those of the terms in
        their order. Their size does not depend on the length of the recordings.

    Raises
    ------
    InputError
        If the recordings cannot be used, or lack a signal that an effect needs.
    """
    raw = join(recorded)
    rows, _ = prepare(raw, drive or Drive(1.0, 1.0), settings, drive is not None)
    for term in terms:
        for signal in term.kind.needs:
            if getattr(rows.samples, signal) is None:
                raise InputError(f"effect '{term.kind.name}' needs {signal}, which is not recorded")
    table = Table(rows, *transition)
    if len(table.add(list(terms))) < len(terms):
        raise InputError('an effect is not finite in the recordings')
    columns = table.indices(terms)
    inner = np.append(columns, table.sums.gram.shape[1] - 1)
    gram = np.zeros((rows.blocks, len(inner), len(inner)))
    np.add.at(gram, table.block, table.sums.gram[:, inner[:, None], inner])
    count = np.bincount(table.block, table.sums.rows, rows.blocks).astype(int)
    return BlockSums(gram, count, table.sums.signs[columns])
