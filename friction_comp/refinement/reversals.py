# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads presliding and breakaway from reversals: friction over the way since each turn.

Refinement fits motion; here, what it leaves out is used. Where a joint turns, friction goes from
its level in one direction to that in the other. By Masing's rule a contact of Maxwell elements
needs twice its presliding distance for this, Dahl's and LuGre's somewhat less, so that half of this
way is no longer than presliding, and a compensation law that reverses over it follows friction.
What has just begun to slide shows breakaway. A late or filtered current makes fast reversals
longer, which is no danger: a law then reverses more slowly than friction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
import math
from typing import NamedTuple

import numpy as np

from friction_comp.model.differentiation import shifted_in_time
from friction_comp.model.effect import RESISTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import Breakaway, Presliding
from friction_comp.refinement import thresholds
from friction_comp.samples import Samples

# Way beyond a turn that is looked at first, rad, and that after it as a multiple of that to the end
# of the change of friction. The level before the turn is that of the farther half.
_FIRST_WAY, _MULTIPLE = 0.03, 4.0
# Share of the change of friction at which presliding ends, that is at 95 % of the level there, and
# of the samples over which its peak is averaged.
_END, _PEAK = 0.975, 1.0 / 8.0
# Shortest time for the change, s: a delay or filter of the current makes faster ones longer; steps
# of position that presliding has to cover; and the longest, rad: usual geared joints have 0.1 to
# 3 mrad, what is longer is a spring or backlash.
_SHORTEST, _COUNTS, _LONGEST = 0.05, 2, 5e-3
# Ways beyond a turn, in presliding distances, over which the gear has just begun to slide.
_SLIDES = (1.8, 3.0)
# Beside the scatter, standard deviations: of a way within a count, counts, and of the method, a
# share of the distance, since contacts with memory and without differ.
_SHARE_OF_COUNT, _METHOD = 0.4, 0.2


class AtRest(NamedTuple):
    """What reversals show of friction at rest; None where they do not, and why."""

    presliding: Presliding | None
    breakaway: Breakaway | None
    why: str


class _Reversal(NamedTuple):
    side: float     # direction after the turn
    end: float      # way to `_END` of the change of friction, rad
    taken: float    # samples from the turn to there
    turn: int       # sample, and that of the following turn
    following: int


def friction_at_rest(raw: Samples, model: FrictionModel, count: float) -> AtRest:
    """Return what reversals show of friction at rest.

    Parameters
    ----------
    raw : Samples
        The recordings, as recorded.
    model : FrictionModel
        Fitted to them.
    count : float
        Smallest step of the recorded position, rad.
    """
    friction = friction_at(raw, model)
    shown = list(_reversals(raw, friction, _FIRST_WAY))
    # On a long way a ripple would count, or what friction changes with speed; on a short one the
    # creeping end of the change is missed.
    if shown:
        window = max(_MULTIPLE * float(np.median([one.end for one in shown])), 20.0 * count)
        shown = list(_reversals(raw, friction, min(_FIRST_WAY, window))) or shown
    # In those that are faster, few samples or a late current would decide.
    fewest = max(thresholds.REVERSAL_SAMPLES, _SHORTEST / raw.sample_time)
    shown = [one for one in shown if one.taken >= fewest]
    if len(shown) < thresholds.REVERSALS:
        return AtRest(None, None, 'there are too few reversals, or they are too fast for the rate')
    ways = np.array([one.end for one in shown])
    distance = 0.5 * float(np.median(ways))
    # What friction does within two counts, an encoder does not show.
    beyond = max(distance, _COUNTS * count)
    breakaway = _breakaway(raw, friction, shown, beyond) if beyond <= _LONGEST else None
    if breakaway is None:
        return AtRest(None, None, 'friction beyond turns is not the same each time')
    if not distance > _COUNTS * count:
        return AtRest(None, breakaway, 'presliding is shorter than '
                      f'{_COUNTS:.0f} steps of the position')
    std = math.hypot(0.5 * _spread(ways), _SHARE_OF_COUNT * count, _METHOD * distance)
    if std > thresholds.REVERSAL_SPREAD * distance:
        return AtRest(None, breakaway, f'reversals differ by {100.0 * std / distance:.0f} %')
    return AtRest(Presliding(distance, std=std), breakaway, '')


def _spread(values: np.ndarray) -> float:
    """Return the standard deviation from the interquartile range, of which few values are off."""
    return float(np.subtract(*np.quantile(values, (0.75, 0.25)))) / 1.35


def _breakaway(raw: Samples, friction: np.ndarray, shown: Sequence[_Reversal],
               distance: float) -> Breakaway | None:
    """Return the friction of a gear that has just begun to slide; None if it varies too much."""
    levels: dict[float, list[float]] = {1.0: [], -1.0: []}
    for one in shown:
        part = slice(one.turn, one.following)
        way = np.maximum.accumulate(one.side * (raw.position[part] - raw.position[one.turn]))
        slides = slice(*np.searchsorted(way, np.multiply(_SLIDES, distance)))
        if slides.stop > slides.start:
            levels[one.side].append(float(np.median(friction[part][slides])))
    numbers: dict[str, float] = {}
    for name, side in (('positive', 1.0), ('negative', -1.0)):
        found = np.array(levels[side])
        mean, std = (side * float(np.median(side * found)), _spread(found)) if len(
            found) >= thresholds.REVERSALS / 2 else (0.0, 0.0)
        if not 0.0 <= std < thresholds.BREAKAWAY_SPREAD * side * mean:
            return None
        numbers |= {f'{name}_mean': mean, f'{name}_std': std}
    return Breakaway(**numbers)


def friction_at(raw: Samples, model: FrictionModel) -> np.ndarray:
    """Return the current of friction without its viscous part at each sample, A, shape (N,).

    It is what is left of the measured current beside inertia, weight and what else does not resist
    motion, at the time at which it acted.
    """
    sigmoid = replace(model.sigmoid, upper=0.0, lower=0.0)
    others = replace(model, sigmoid=sigmoid, effects=[
        effect for effect in model.effects if effect.role != RESISTS])
    friction = model.measured(raw) - others.predict(raw, same_recording=True)
    return shifted_in_time(friction, raw, -(model.settings.get('lag') or 0.0))


def _reversals(raw: Samples, friction: np.ndarray, window: float) -> Iterator[_Reversal]:
    """Yield the reversals between ways of at least `window`, rad."""
    for part in raw.segments():
        position, current = np.asarray(raw.position[part]), friction[part]
        turns = _turns(position, window)
        for (last, _), (turn, side), (following, _) in zip(turns, turns[1:], turns[2:]):
            back = side * (position[last:turn] - position[turn])
            level = side * current[last:turn][(back > 0.5 * window) & (back < window)]
            way = np.maximum.accumulate(side * (position[turn:following] - position[turn]))
            stop = int(np.searchsorted(way, window))
            change = side * current[turn:turn + stop]
            if len(level) < 3 or stop < thresholds.REVERSAL_SAMPLES:
                continue
            mean = np.full(max(3, round(_PEAK * stop)), 1.0)
            smooth = np.convolve(np.pad(change, len(mean) // 2, mode='edge'), mean / len(mean),
                                 mode='valid')[:len(change)]
            peak = int(np.argmax(smooth))
            height = float(smooth[peak] - np.median(level))
            if height <= 0.0:
                continue
            # From the peak on, friction may fall with speed.
            share = (change[:peak + 1] - np.median(level)) / height
            # Where an isotonic regression reaches the level: the values before it sum up to the
            # least beside the level (Barlow et al. 1972).
            end = int(np.argmin(np.concatenate(([0.0], np.cumsum(share - _END)))))
            if end <= peak:
                yield _Reversal(side, float(way[end]), float(end), part.start + turn,
                                part.start + following)


def _turns(position: np.ndarray, least: float) -> list[tuple[int, float]]:
    """Return the sample of each turn after and before ways of at least `least`, and where to.

    `scipy.signal.find_peaks` finds the same, but its import takes as long as a whole refinement.
    """
    turns: list[tuple[int, float]] = []
    places, side = position.tolist(), 0.0
    highest = lowest = 0
    for k, place in enumerate(places):
        highest = k if place > places[highest] else highest
        lowest = k if place < places[lowest] else lowest
        if side >= 0.0 and place < places[highest] - least:
            turns.append((highest, -1.0))
            side, lowest = -1.0, k
        elif side <= 0.0 and place > places[lowest] + least:
            turns.append((lowest, 1.0))
            side, highest = 1.0, k
    return turns
