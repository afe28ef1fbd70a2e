# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Ripples that belong together: whole multiples of one number a turn, teeth of one gear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np

from friction_comp.model.effects import Effect
from friction_comp.refinement.fit.effect_sum import Fit
from friction_comp.refinement.fit.robust_regression import huber_loss

# Multiples of a base up to this are looked for: teeth, poles, slots and twice as many.
_MOST_MULTIPLE = 12
# Part of the resolution of the recorded range by which a frequency may be off.
_OFF = 0.2
# A base has to be this many times as wide as that, or anything would be a multiple of it.
_WIDE = 8.0
# Loss that exact multiples may cost, as a share.
_COST = 0.01


@dataclass(frozen=True)
class Family:
    """Frequencies that are whole multiples of one base.

    Parameters
    ----------
    base : float
        Periods a turn.
    orders : dict of int to int
        By the number of each member, which multiple it is.
    """

    base: float
    orders: dict[int, int]


def family_of(frequencies: Sequence[float], span: float) -> Family | None:
    """Return the family that holds most of some frequencies, None where no two belong together.

    Parameters
    ----------
    frequencies : sequence of float
        Periods a turn.
    span : float
        Range of position that was recorded, rad.
    """
    off = _OFF * 2.0 * math.pi / max(span, 1e-9)
    best = None
    for value in frequencies:
        for multiple in range(1, _MOST_MULTIPLE + 1):
            base = value / multiple
            if base < _WIDE * off:
                break
            orders = {place: round(other / base) for place, other in enumerate(frequencies)
                      if round(other / base) >= 1
                      and abs(other - round(other / base) * base) < off}
            if len(set(orders.values())) > 1 and (best is None or (
                    len(orders), base) > (len(best.orders), best.base)):
                best = Family(base, orders)
    return best


def with_exact_multiples(fit: Fit) -> Fit:
    """Return a fit whose ripples have whole numbers and exact multiples, where the data allow it.

    A gear has a whole number of teeth. Each ripple is tried with the next whole number a turn,
    and each family with exact multiples of one base; kept is what costs next to no loss.
    """
    places = [place for place, term in enumerate(fit.terms) if term.kind.spectral]
    if not places:
        return fit
    limit = (1.0 + _COST) * _loss(fit, fit.scale)
    scale = fit.scale

    def tried(now: Fit, changes: dict[int, float]) -> Fit | None:
        twin = now.copy()
        for place, frequency in changes.items():
            term = now.terms[place]
            twin.put(place, term.with_constants(**{term.kind.spectral: float(frequency)}))
        twin.solve()
        return twin if _loss(twin, scale) <= limit else None

    def frequency(place: int) -> float:
        return fit.terms[place].constants[fit.terms[place].kind.spectral]
    off = _OFF * 2.0 * math.pi / max(fit.data.scene.span, 1e-9)
    for place in places:
        whole = round(frequency(place))
        if whole >= 1 and abs(whole - frequency(place)) < off:
            fit = tried(fit, {place: whole}) or fit
    family = family_of([frequency(place) for place in places], fit.data.scene.span)
    if family is None:
        return fit
    members = {places[number]: order for number, order in family.orders.items()}
    weights = np.array([order ** 2 for order in members.values()], dtype=float)
    base = float(weights @ [frequency(place) / order for place, order in members.items()]
                 / weights.sum())
    for value in (round(base), base):
        twin = tried(fit, {place: order * value for place, order in members.items()})
        if twin is not None and value > 0:
            return twin
    return fit


def _loss(fit: Fit, scale: float) -> float:
    return float(np.mean(huber_loss(fit.left, scale)))


def exact_families(effects: Sequence[Effect]) -> list[Family]:
    """Return the families among the effects of a model, of exact multiples only."""
    places = [place for place, effect in enumerate(effects) if effect.spectral]
    left, found = list(places), []
    while len(left) > 1:
        values = [effects[place].values[effects[place].spectral] for place in left]
        best: dict[int, int] = {}
        width = 0.0
        for value in values:
            for multiple in range(1, _MOST_MULTIPLE + 1):
                base = value / multiple
                orders = {place: round(other / base) for place, other in zip(left, values)
                          if other > 0 and abs(other / base - round(other / base)) < 1e-6}
                whole = abs(base - round(base)) < 1e-6 or multiple == 1
                if whole and base > 2.0 and (len(orders), base) > (len(best), width):
                    best, width = orders, base
        if len(best) < 2:
            break
        found.append(Family(width, best))
        left = [place for place in left if place not in best]
    return found
