# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Which samples have to be looked at for the rows that a fit is made on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from friction_comp.samples import Samples

# Where more than this share of all samples has to be looked at, all of them are.
_MOST = 0.7


@dataclass(frozen=True)
class View:
    """The samples on which columns are evaluated for the fitted rows.

    Parameters
    ----------
    samples : Samples
    keep : ndarray of int or None
        Which of these are fitted; None for all of them.
    """

    samples: Samples
    keep: np.ndarray | None


def view_of(samples: Samples, index: np.ndarray, reach: int) -> View:
    """Return the samples of some rows, and as many beside each as its current depends on.

    Where these are most of all samples, they are all of them, as the same object.

    Parameters
    ----------
    samples : Samples
    index : ndarray of int
        The rows, in order.
    reach : int
        How many samples away a current looks.
    """
    size, near = len(samples), index
    if reach:
        change = np.zeros(size + 1, dtype=int)
        np.add.at(change, np.maximum(index - reach, 0), 1)
        np.add.at(change, np.minimum(index + reach + 1, size), -1)
        near = np.nonzero(np.cumsum(change[:-1]))[0]
    if len(near) > _MOST * size:
        return View(samples, index)
    return View(samples.take(near), np.searchsorted(near, index) if reach else None)
