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
    """The currents of a joint's effects, A.

    Attributes
    ----------
    forward, backward : float
        Friction's current in the positive and the negative direction of sliding.
    carried : float
        Current that does not depend on the direction.
    shifts : tuple of float
        Corrections of the magnitudes of the breakaway currents at this position.
    missing : list of (str, tuple of str)
        Effects left out, with the missing signals; no signals if the value is not finite.
    """

    forward: float
    backward: float
    carried: float
    shifts: tuple[float, float]
    missing: list[tuple[str, tuple[str, ...]]]


class EffectCurrents:
    """The effects of one joint's model that are applied.

    Parameters
    ----------
    model : FrictionModel
    why_left_out : callable
        Returns why an effect is not applied; empty where it is.

    Attributes
    ----------
    terms : list of (Effect, LiveTerm)
        Those that are applied.
    breakaway_positions : tuple of float, or None
        Positions at which the positive and negative breakaway currents were measured, rad.
    """

    def __init__(self, model: FrictionModel, why_left_out: Callable[[Effect], str]) -> None:
        self.terms = [
            (effect, LiveTerm(effect)) for effect in model.effects if not why_left_out(effect)]
        both = model.breakaway
        self.breakaway_positions: tuple[float, float] | None = None
        if both is not None and both.positive_position is not None and (
                both.negative_position is not None):
            self.breakaway_positions = (both.positive_position, both.negative_position)

    @property
    def carrying(self) -> list[str]:
        """Names of the effects that carry."""
        return [effect.name for effect, _ in self.terms if effect.role == CARRIES]

    def reset(self) -> None:
        """Forget the motion."""
        for _, term in self.terms:
            term.reset()

    def at(self, time: float, position: float, speed: float, signals: dict[str, float | None],
           by_direction: bool = True) -> Currents:
        """Return the currents of the effects.

        Parameters
        ----------
        time, position, speed : float
            s, rad, rad/s.
        signals : dict
            ``temperature``, ``load``, ``rigid_body`` and ``coupling``, None if unknown.
        by_direction : bool
            Whether friction is given for both directions of sliding, as the continuous law needs
            it; otherwise for that of the speed, in `carried`.
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
            for side, value in enumerate(self._shift(effect, term, time, position, signals)):
                shifts[side] += value
        return Currents(forward, backward, carried, (shifts[0], shifts[1]), missing)

    def _shift(self, effect: Effect, term: LiveTerm, time: float, position: float,
               signals: dict[str, float | None]) -> tuple[float, float]:
        """Return by how much more current breaks the joint free here than where that was measured.

        In A, in positive direction, and in negative direction by magnitude.
        """
        # Terms with memory, and torques of the whole arm, cannot be evaluated at another position.
        if self.breakaway_positions is None or term.has_memory or _ARM_SIGNALS & set(term.needs):
            return 0.0, 0.0
        shifts = []
        for elsewhere, sign in zip(self.breakaway_positions, (1.0, -1.0)):
            if effect.role == CARRIES:
                # It is applied at rest anyway, so it is removed from the level measured with it.
                shifts.append(-sign * term.update(time, elsewhere, 0.0, **signals))
                continue
            # Half of the difference of the sides resists; their mean acted there as well.
            here, there = (0.5 * (forward - backward) for forward, backward in (
                term.both_sides(time, x, 0.0, **signals) for x in (position, elsewhere)))
            shifts.append(here - there)
        positive, negative = (value if math.isfinite(value) else 0.0 for value in shifts)
        return positive, negative
