# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Physics as a judge of a fit: signs, bounds, size against the signal, and passivity."""

from __future__ import annotations

import math

import numpy as np

from friction_comp.model.effects import CARRIES, RESISTS
from friction_comp.refinement.fit.effect_sum import Fit
from friction_comp.refinement.thresholds import LARGEST, PASSIVE, SPEED_RANGES
from friction_comp.series import quantile_edges


def objection(fit: Fit, place: int) -> str:
    """Return why physics does not allow a term of a fit as it stands; empty where it does.

    Parameters
    ----------
    fit : Fit
    place : int
        Of the term; counted from the end where negative.
    """
    place %= len(fit.terms)
    term, own = fit.terms[place], fit.own_coefficients()[place + 1]
    scene = fit.data.scene
    if not term.kind.plausible(own, term.constants, scene):
        return 'its sign or its constants are none that a drive can have'
    if term.kind.spectral and _again(fit, place):
        return 'the range that was moved does not tell its frequency from that of another'
    if np.size(own) and not np.any(own):
        return 'it could only take part with a sign that no drive has'
    signal = float(np.max(np.abs(fit.target[fit.index])))
    parts = _cancels_with(fit, place)
    # Of a part of a sum the size says nothing.
    sizes = [abs(float(own[number])) for number in term.kind.amplitudes if number < len(own)
             ] if parts == [place] else []
    share = np.zeros(len(fit.index))
    for number in parts:
        share += fit.parts[number + 1] @ fit.own_coefficients()[number + 1]
    if max([*sizes, float(np.max(np.abs(share)))]) > LARGEST * signal:
        return 'it is far larger than the signal, so that another effect has to cancel it'
    if term.kind.role == RESISTS and len(own) and not passive(fit):
        return 'friction would push the joint along at some speed'
    return ''


def _cancels_with(fit: Fit, place: int) -> list[int]:
    """Return the places of the terms, its own among them, of which mechanics sees the sum alone.

    A joint that swings while the one before it does is asked for little, by two accelerations
    that cancel, and so are weights. Where other joints take part, what its links ask of a joint is
    one sum, of which the size of a part says nothing.
    """
    links = [number for number, term in enumerate(fit.terms)
             if term.kind.role == CARRIES and (term.kind.expected or term.kind.weight)]
    beside = any('coupling' in term.kind.needs for term in fit.terms)
    return links if beside and place in links else [place]


def _again(fit: Fit, place: int) -> bool:
    """Tell whether a ripple of the same kind is nearer than the range of position resolves.

    Two such lines are one whose size changes along the way, and nothing to be read as gears.
    """
    term, scene = fit.terms[place], fit.data.scene
    resolved = 2.0 * math.pi / max(scene.span, 1e-9)
    name = term.kind.spectral
    return any(other.kind is term.kind and number != place and
               abs(other.constants[name] - term.constants[name]) < resolved
               for number, other in enumerate(fit.terms))


def bound(fit: Fit, place: int) -> str:
    """Return which constant of a term ended at a bound, as an objection; empty if none."""
    term = fit.terms[place]
    name = term.kind.at_bound(term.constants, fit.data.scene)
    return f'its {name.replace("_", " ")} ended at the bound of what was searched' if name else ''


def passive(fit: Fit) -> bool:
    """Tell whether friction takes energy from the motion at all speeds that were seen.

    Friction is the base's and that of all effects that resist. It is averaged over ranges of
    speed; where there are both directions, half the difference between them counts, so that
    what does not change its sign with the direction drops out. Just after a reversal, presliding
    gives energy back: the average over a range holds that too.
    """
    own = fit.own_coefficients()
    friction = fit.parts[0][:, 1:] @ own[0][1:]
    for term, part, gains in zip(fit.terms, fit.parts[1:], own[1:]):
        if term.kind.role == RESISTS and part.shape[1]:
            friction = friction + part @ gains
    velocity = fit.samples.velocity[fit.index]
    speed = np.abs(velocity)
    edges = quantile_edges(speed, int(SPEED_RANGES))
    cell = np.searchsorted(edges, speed)
    number = len(edges) + 1
    sides = []
    for side in (velocity > 0, velocity <= 0):
        count = np.bincount(cell[side], minlength=number)
        total = np.bincount(cell[side], friction[side], minlength=number)
        sides.append(np.where(count > 0, total / np.maximum(count, 1), np.nan))
    if fit.data.scene.both_directions:
        resisting = 0.5 * (sides[0] - sides[1])
    else:
        resisting = np.where(np.isnan(sides[0]), -sides[1], sides[0])
    resisting = resisting[np.isfinite(resisting)]
    return bool(resisting.size == 0
                or np.min(resisting) >= -PASSIVE * np.max(np.abs(resisting)))


def sound(fits: list[Fit], places: list[int]) -> bool:
    """Tell whether physics allows some terms of the fits of both folds."""
    return not any(objection(fit, place) or bound(fit, place)
                   for fit in fits for place in places)
