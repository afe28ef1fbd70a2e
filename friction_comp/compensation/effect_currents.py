# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Computes the currents of a model's effects at one sample.

Friction effects (`RESISTS`) go through the law's operator, which needs their current in each
direction of sliding. The other effects (gravity, cogging) are added outside the operator. Breakaway
currents are measured at one position of the joint; effects that depend on position shift them.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import NamedTuple

from friction_comp.model.effects.base import CARRIES, Effect, LiveTerm
from friction_comp.model.friction_model import FrictionModel

_ARM_SIGNALS = {'rigid_body', 'coupling'}


class Currents(NamedTuple):
    """The currents of a joint's effects, A."""

    # Friction's in the positive and the negative direction of sliding.
    forward: float
    backward: float
    # What does not depend on the direction.
    carried: float
    # Corrections of the magnitudes of the breakaway currents at this position.
    shifts: tuple[float, float]
    # Effects left out, with the missing signals; no signals if the value is not finite.
    missing: list[tuple[str, tuple[str, ...]]]


class EffectCurrents:
    """The effects of one joint's model that are applied: `terms`, effects with their live term.

    `why_left_out` returns why an effect is not applied; empty where it is.
    """

    def __init__(self, model: FrictionModel, why_left_out: Callable[[Effect], str]) -> None:
        self.terms = [
            (effect, LiveTerm(effect)) for effect in model.effects if not why_left_out(effect)]
        both = model.breakaway
        # Where the positive and negative breakaway currents were measured, rad.
        self._places: tuple[float, ...] = ()
        if both is not None and both.positive_position is not None and (
                both.negative_position is not None):
            self._places = both.positive_position, both.negative_position
        self.carrying = [effect.name for effect, _ in self.terms if effect.role == CARRIES]

    def reset(self) -> None:
        """Forget the motion."""
        for _, term in self.terms:
            term.reset()

    def at(self, time: float, position: float, speed: float, signals: dict[str, float | None],
           by_direction: bool = True) -> Currents:
        """Return the currents of the effects.

        `signals` are ``temperature``, ``load``, ``rigid_body`` and ``coupling``, None if unknown.
        `by_direction`: friction is given for both directions of sliding, as the continuous law
        needs it; otherwise for that of the speed, in `carried`.
        """
        forward = backward = carried = 0.0
        shifts, missing = [0.0, 0.0], []
        for effect, term in self.terms:
            unknown = tuple(name for name in term.needs if signals[name] is None)
            parts = (math.nan, math.nan, math.nan)
            if not unknown and by_direction and effect.role != CARRIES:
                parts = *term.both_sides(time, position, speed, **signals), 0.0
            elif not unknown:
                parts = 0.0, 0.0, term.update(time, position, speed, **signals)
            if not all(map(math.isfinite, parts)):
                missing.append((effect.name, unknown))
                continue
            forward, backward = forward + parts[0], backward + parts[1]
            carried += parts[2]
            # Terms with memory, and torques of the whole arm, cannot be evaluated elsewhere.
            if not (term.has_memory or _ARM_SIGNALS & set(term.needs)):
                for side, place in enumerate(self._places):
                    shifts[side] += self._shift(effect, term, time, position, place, side, signals)
        return Currents(forward, backward, carried, (shifts[0], shifts[1]), missing)

    @staticmethod
    def _shift(effect: Effect, term: LiveTerm, time: float, position: float, place: float,
               side: int, signals: dict[str, float | None]) -> float:
        """Return by how much more current breaks the joint free here than where it was measured.

        In A, of the positive (0) or negative direction, by magnitude.
        """
        if effect.role == CARRIES:
            # It is applied at rest anyway, so it is removed from the level measured with it.
            value = (2.0 * side - 1.0) * term.update(time, place, 0.0, **signals)
        else:
            # Half of the difference of the sides resists; their mean acted there as well.
            here, there = (0.5 * (forward - backward) for forward, backward in (
                term.both_sides(time, x, 0.0, **signals) for x in (position, place)))
            value = here - there
        return value if math.isfinite(value) else 0.0
