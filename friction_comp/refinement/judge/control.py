# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction or the controller: what decided on the current that was recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.optimize import nnls

from friction_comp.refinement.thresholds import (
    CONTROL_DELAY,
    CONTROL_LAW,
    CONTROL_WINDOW,
    FEW_LEVELS,
    OPEN_LOOP,
)
from friction_comp.samples import Samples


@dataclass(frozen=True)
class Control:
    """What decided on the current.

    Parameters
    ----------
    law : str
        A sentence where the current is a controller's answer to the speed, so that what goes with
        it is no property of the drive; empty else.
    sequence : str
        A sentence where the current did not depend on the joint's state; empty else.
    answer : str
        A sentence where the current answers the speed, and the drive's mechanics ask for the same
        current: nothing is wrong with it then; empty else.
    """

    law: str = ''
    sequence: str = ''
    answer: str = ''


def short_term(values: np.ndarray, samples: Samples) -> np.ndarray:
    """Return what of a signal is faster than `CONTROL_WINDOW`, shape (N,)."""
    width = max(3, round(CONTROL_WINDOW / max(samples.sample_time, 1e-9)))
    result = np.zeros(len(values))
    for part in samples.segments():
        result[part] = values[part] - uniform_filter1d(
            np.asarray(values[part], dtype=float), width, mode='nearest')
    return result


def speed_law(samples: Samples, rows: np.ndarray) -> tuple[float, float, int]:
    """Return how closely current follows speed the way a speed controller has it.

    Where they go together best at the largest delay or beyond, it is the motion that the current
    makes, as with inertia, and no answer to it.

    Parameters
    ----------
    samples : Samples
        With velocity.
    rows : ndarray of bool, shape (N,)
        The samples that count.

    Returns
    -------
    share : float
        Share of the short-term variance of current that velocity explains; 0 where current rises
        with it.
    slope : float
        A per rad/s.
    delay : int
        Samples by which the current is late.
    """
    error = -samples.velocity
    if samples.reference_velocity is not None and np.ptp(samples.reference_velocity) > 0:
        error = samples.reference_velocity - samples.velocity
    fast, current = short_term(error, samples), short_term(samples.current, samples)
    best = (0.0, 0.0, 0)
    for delay in range(int(CONTROL_DELAY) + 1):
        x, y = fast[:len(fast) - delay], current[delay:]
        keep = rows[delay:] & rows[:len(rows) - delay]
        x, y = x[keep], y[keep]
        power = float(x @ x) * float(y @ y)
        product = float(x @ y)
        if power > 0 and product > 0 and product ** 2 / power > best[0]:
            best = (product ** 2 / power, -product / float(x @ x), delay)
    return best if best[2] < CONTROL_DELAY else (0.0, 0.0, 0)


def mechanics_share(samples: Samples, rows: np.ndarray) -> float:
    """Return the share of the current's quick changes that friction, inertia and load explain.

    Friction and inertia take part with the signs that they have in a drive: a controller's answer
    to the speed is friction that pushes, and not explained by them.

    Parameters
    ----------
    samples : Samples
        With velocity and acceleration.
    rows : ndarray of bool, shape (N,)
        The samples that count.
    """
    velocity = np.asarray(samples.velocity)
    turning = 0.05 * float(np.percentile(np.abs(velocity[rows]), 95)) + 1e-300
    resists = [np.tanh(velocity / turning), velocity, samples.acceleration]
    carried = [values for values in (samples.load, samples.rigid_body, samples.coupling)
               if values is not None]
    columns = [short_term(values, samples)[rows] for values in (*resists, *carried)]
    columns += [-values for values in columns[len(resists):]]
    current = short_term(samples.current, samples)[rows]
    power = float(current @ current)
    left = nnls(np.column_stack(columns), current)[1] ** 2
    return 1.0 - left / power if power > 0.0 else 0.0


def control_of(samples: Samples, smooth: Samples, rows: np.ndarray, unit: str = 'A') -> Control:
    """Return what decided on the current of a recording.

    Whoever makes the current, the joint moves by its mechanics: where these explain the current's
    quick changes, they can be found in them, whatever law a controller follows. A controller is in
    the way where its law explains them and mechanics do not: then what it answers is noise, or a
    motion that nobody recorded.

    Parameters
    ----------
    samples, smooth : Samples
        With velocity as a controller saw it, and as refinement derives it, with acceleration.
    rows : ndarray of bool, shape (N,)
        Samples in motion.
    unit : str
        Of the current.
    """
    share, slope, delay = speed_law(samples, rows)
    law = sequence = answer = ''
    if share > CONTROL_LAW:
        late = f', {1e3 * delay * samples.sample_time:.2g} ms late' if delay else ''
        law = (f'The current is the answer of a speed controller: it falls by {-slope:.3g} {unit} '
               f'for every rad/s that the joint is too fast{late}, which explains '
               f'{100 * share:.0f} % of its changes. ')
        mechanics = mechanics_share(smooth, rows)
        if mechanics > CONTROL_LAW:
            answer = law + (f'Friction, inertia and load explain {100 * mechanics:.0f} % of them, '
                            'so that the drive can be told from it all the same.')
            law = ''
        else:
            law += ('What goes with speed, position and time in it is the controller, and neither '
                    'friction, ripple, lag nor inertia of the drive can be told from it.')
    asked = samples.current if samples.command is None else samples.command
    moves = (np.abs(np.diff(samples.velocity)) > 0) & rows[1:]
    if len(np.unique(asked[rows])) <= FEW_LEVELS and moves.any() and (
            np.mean(np.diff(asked)[moves] == 0) > OPEN_LOOP):
        sequence = ('The current is a fixed sequence that does not answer to the motion (open '
                    'loop): what the joint does between two levels is seen, friction at a chosen '
                    'speed is not.')
    return Control(law, sequence, answer)
