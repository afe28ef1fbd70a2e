# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the recordings tell of a fit: errors of parts that were not fitted, and what is open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from friction_comp.model.effects import EFFECTS
from friction_comp.model.effects.scene import too_coarse
from friction_comp.refinement.attempt import Found
from friction_comp.refinement.columns import Key, Term
from friction_comp.refinement.final import blocks_of_samples
from friction_comp.refinement.leftover import Dependence, rank_correlation
from friction_comp.refinement.prepare import plain_columns, Rows, sums_of
from friction_comp.refinement.search import Search, Split
from friction_comp.refinement.stability import Stability
from friction_comp.refinement.verdict import AGAIN, Finding, IN_PART, TRUST

# Two explanations that go together this closely are one as far as the recording can tell.
ALIKE = 0.95

_EXPERIMENTS = {
    frozenset(('time', 'temperature')):
        'record the motor once warm from the start, or cool it while it goes on moving',
    frozenset(('acceleration', 'history')):
        'record movements of the same speed with several different accelerations, and reversals',
    frozenset(('position', 'acceleration')):
        'record the same positions at several accelerations, such as two different tempos',
    frozenset(('position', 'velocity')):
        'record the same positions at several speeds and in both directions',
    frozenset(('position', 'time')):
        'record the same positions early and late, several times over',
    frozenset(('velocity', 'time')):
        'record the same speeds early and late, in another order',
    frozenset(('velocity', 'temperature')):
        'record the same speeds cold and warm',
    frozenset(('velocity', 'direction')):
        'record the same speeds in both directions',
}


@dataclass(frozen=True)
class Errors:
    """Errors of one model, A.

    Parameters
    ----------
    fit : float
        RMS in motion, of the model fitted to everything.
    held_out : float
        RMS in motion, of parts that were not fitted.
    largest : float
        Of these, the largest error of a sample.
    r2 : float
        Share of the current's variance that is explained there.
    worst_part : float
        RMS of the part with the largest.
    standstill : float
        RMS at standstill and beside it; NaN without such samples.
    overall : float
        RMS of all samples of parts that were not fitted.
    parts : list of float
        RMS of each part, in motion.
    """

    fit: float
    held_out: float
    largest: float
    r2: float
    worst_part: float
    standstill: float
    overall: float
    parts: list[float]

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of report.json."""
        return {'fit_rmse': self.fit, 'held_out_rmse': self.held_out,
                'held_out_max': self.largest, 'held_out_r2': self.r2,
                'worst_part_rmse': self.worst_part,
                'standstill_rmse': None if math.isnan(self.standstill) else self.standstill,
                'overall_rmse': self.overall, 'part_rmse': self.parts}


def rms(values: np.ndarray) -> float:
    """Return the root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else math.nan


def errors_of(rows: Rows, fit: np.ndarray, held_out: np.ndarray, index: np.ndarray) -> Errors:
    """Return the errors of a model.

    Parameters
    ----------
    rows : Rows
    fit, held_out : ndarray, shape (L,)
        Residuals of samples by the model fitted to everything, and by that not fitted to them.
    index : ndarray of int, shape (L,)
        The samples.
    """
    moving = rows.usable[index]
    current = rows.target[index][moving]
    block = blocks_of_samples(rows)[index][moving]
    own = held_out[moving]
    parts = [rms(own[block == k]) for k in np.unique(block)]
    variance = float(np.var(current))
    return Errors(
        rms(fit[moving]), rms(own), float(np.max(np.abs(own))),
        1.0 - float(np.mean(own ** 2)) / variance if variance > 0.0 else 0.0,
        max(parts), rms(held_out[~moving]), rms(held_out), parts)


def noise_floor(rows: Rows, residual: np.ndarray) -> float:
    """Return the standard deviation in A of what changes from one sample to the next at random.

    Second differences of the residual, shape (N,), remove whatever is smooth over three samples;
    of white noise they have six times its variance. Slow noise is not in this figure, and a signal
    that was filtered has less of it than its sensor.
    """
    whole = rows.usable[2:] & rows.usable[1:-1] & rows.usable[:-2]
    step = np.diff(rows.samples.recording)
    whole &= (step[1:] == 0) & (step[:-1] == 0)
    second = (residual[2:] - 2.0 * residual[1:-1] + residual[:-2])[whole]
    if second.size < 50:
        return rms(residual[rows.usable])
    return 1.4826 * float(np.median(np.abs(second))) / math.sqrt(6.0)


def experiment(first: str, second: str) -> str:
    """Return the recording that would tell two variables apart."""
    known = _EXPERIMENTS.get(frozenset((first, second)))
    return known or (f'record motion in which {first} changes while {second} does not, and the '
                     'other way round')


def ambiguities(found: Found, stability: Stability) -> list[dict[str, Any]]:
    """Return entries of report.json's `ambiguous`."""
    entries: list[dict[str, Any]] = []
    seen = set()

    def add(first: str, second: str, why: str) -> None:
        pair = frozenset((first, second))
        if first != second and pair not in seen:
            seen.add(pair)
            entries.append({'between': [first, second], 'why': why,
                            'experiment': experiment(first, second)})
    terms = found.table.terms
    for key in found.keys[found.given:]:
        for name, share in stability.instead.get(key, ()):
            add(terms[key].kind.variable, EFFECTS[name].variable,
                f'{100 * share:.0f} % of the searches repeated on parts of the recording have '
                f"'{name}' in place of '{key[0]}'")
    samples = found.rows.at_rows
    variables = {terms[key].kind.variable for key in found.keys}
    if samples.temperature is not None and variables & {'time', 'temperature'}:
        alike = rank_correlation(samples.time, samples.temperature)
        if alike > ALIKE:
            add('time', 'temperature', 'temperature and time rose together in the recordings '
                f'(rank correlation {alike:.3f})')
    elif 'time' in variables and samples.temperature is None:
        add('time', 'temperature', 'the drift over time may be the motor warming up, and its '
            'temperature was not recorded')
    alike = rank_correlation(samples.time, np.abs(np.asarray(samples.velocity)))
    if alike > 0.9 and len(np.unique(samples.recording)) == 1:
        add('velocity', 'time', 'speed rose or fell with time all through the recording (rank '
            f'correlation {alike:.2f}): drift over time cannot be told from the dependence on '
            'velocity')
    return entries
