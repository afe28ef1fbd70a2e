# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a joint at rest bears here, from what it bore where its breakaway was measured.

Breakaway currents are measured at one place of the joint. Part of them may belong to effects that
change from place to place: the ripple of a worn gear, an arm that is not balanced. Once a model
holds such effects, the breakaway level can be moved to where the joint now rests.
"""

from __future__ import annotations

import math

# Fast enough for friction effects to have their full sign, slow enough for nothing else to count,
# rad/s.
_SLIDING = 0.05


def places_of(model, terms):
    """Return the places in rad (positive, negative) to move the level from, or None.

    Parameters
    ----------
    model : FrictionModel
    terms : list of (Effect, LiveTerm)
        Its effects as they are applied.
    """
    both = model.breakaway
    if both is None or both.positive_position is None or both.negative_position is None:
        return None
    if not any(not term.sees_history for _, term in terms):
        return None
    return both.positive_position, both.negative_position


def level_shifts(terms, places, time, position, signals):
    """Return what to add to the breakaway currents' magnitudes here, in A.

    Parameters
    ----------
    terms : list of (Effect, LiveTerm)
    places : tuple of float
        Where the positive and the negative breakaway current were measured, rad.
    time, position : float
        s, rad.
    signals : dict
        Temperature and load, None where not known.

    Returns
    -------
    tuple of float
        For the positive and the negative direction.
    """
    shifts = [0.0, 0.0]
    for _, term in terms:
        # A term with a memory cannot be asked what it would be elsewhere.
        if term.sees_history or any(signals[name] is None for name in term.needs):
            continue
        here, _ = _parts(term, time, position, signals)
        for side, sign in ((0, 1.0), (1, -1.0)):
            there, push = _parts(term, time, places[side], signals)
            # What pushes whatever the direction is applied at rest as it is, so the level that was
            # measured against it is rid of it.
            value = here - there - sign * push
            if math.isfinite(value):
                shifts[side] += value
    return shifts[0], shifts[1]


def sliding_friction(terms, time, position, signals):
    """Return what the effects add to the current of a joint that begins to slide here, in A.

    Parameters
    ----------
    terms, time, position, signals
        As for `level_shifts`.

    Returns
    -------
    tuple of float
        Magnitudes in the positive and the negative direction, beyond what is applied at rest.
    """
    more = [0.0, 0.0]
    for _, term in terms:
        # Asking a term with a memory of the motion would spoil it.
        if term.sees_history or any(signals[name] is None for name in term.needs):
            continue
        still = term.update(time, position, 0.0, **signals)
        for side, sign in ((0, 1.0), (1, -1.0)):
            value = sign * (term.update(time, position, sign * _SLIDING, **signals) - still)
            if math.isfinite(value):
                more[side] += value
    return more[0], more[1]


def _parts(term, time, position, signals):
    """Return a term's friction and its current at rest, at one place, in A."""
    forward, backward, still = (
        term.update(time, position, speed, **signals) for speed in (_SLIDING, -_SLIDING, 0.0))
    return 0.5 * (forward - backward), still
