# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The current that a model's further effects add at one sample.

Friction (`RESISTS`) goes through the law's operator, so what counts is its size in either
direction of sliding. What carries (gravity, cogging) is added outside. Breakaway currents are
measured at one place of the joint; where effects change from place to place, the level moves with
them.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import NamedTuple

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.live_term import LiveTerm
from friction_comp.model.effects.scene import CARRIES, RESISTS
from friction_comp.model.friction_model import FrictionModel

_ARM = {'rigid_body', 'coupling'}
_FULL_TURN = 2.0 * math.pi


class Asked(NamedTuple):
    """The currents that a joint's effects add, A.

    Attributes
    ----------
    forward, backward : float
        Friction's current in the positive and the negative direction of sliding.
    carried : float
        What is asked for whatever the direction.
    shifts : tuple of float
        What to add to the breakaway currents' magnitudes here.
    missing : list of (str, tuple of str)
        Effects left out, with the signals that are unknown; none where the value is not finite.
    """

    forward: float
    backward: float
    carried: float
    shifts: tuple[float, float]
    missing: list[tuple[str, tuple[str, ...]]]


class EffectsHere:
    """The effects of one joint's model, as they are fed back.

    Parameters
    ----------
    model : FrictionModel
    why_left_out : callable
        Returns why an effect is not applied; empty where it is.

    Attributes
    ----------
    terms : list of (Effect, LiveTerm)
        Those that are applied.
    measured_at : tuple of float, or None
        Where the breakaway currents were measured, positive and negative, rad.
    """

    def __init__(self, model: FrictionModel, why_left_out: Callable[[Effect], str]) -> None:
        pairs = [(effect, effect.live()) for effect in model.effects if not why_left_out(effect)]
        self.terms: list[tuple[Effect, LiveTerm]] = [
            (effect, term) for effect, term in pairs if term is not None]
        both = model.breakaway
        self.measured_at: tuple[float, float] | None = None
        if both is not None and both.positive_position is not None and (
                both.negative_position is not None):
            self.measured_at = (both.positive_position, both.negative_position)

    def __len__(self) -> int:
        return len(self.terms)

    def reset(self) -> None:
        """Forget the motion."""
        for _, term in self.terms:
            term.reset()

    def ask(self, time: float, position: float, speed: float,
            signals: dict[str, float | None]) -> Asked:
        """Return the currents of the effects for the continuous law.

        Parameters
        ----------
        time, position, speed : float
            s, rad, rad/s.
        signals : dict
            ``temperature``, ``load``, ``rigid_body`` and ``coupling``, None where not known.
        """
        forward = backward = carried = 0.0
        shifts, missing = [0.0, 0.0], []
        for effect, term in self.terms:
            unknown = tuple(name for name in term.needs if signals[name] is None)
            if unknown:
                missing.append((effect.name, unknown))
                continue
            if effect.role == CARRIES:
                parts = (0.0, 0.0, term.update(time, position, speed, **signals))
            elif effect.turning() is not None:
                continue  # the law has an element for it
            else:
                parts = (*term.both_sides(time, position, speed, **signals), 0.0)
            if not all(map(math.isfinite, parts)):
                missing.append((effect.name, ()))
                continue
            forward, backward = forward + parts[0], backward + parts[1]
            carried += parts[2]
            for side, value in enumerate(self._shift(effect, term, time, position, signals)):
                shifts[side] += value
        return Asked(forward, backward, carried, (shifts[0], shifts[1]), missing)

    def total(self, time: float, position: float, speed: float,
              signals: dict[str, float | None]) -> Asked:
        """Return the effects' sum as `carried`, for the laws that know no operator."""
        total, shifts, missing = 0.0, [0.0, 0.0], []
        for effect, term in self.terms:
            unknown = tuple(name for name in term.needs if signals[name] is None)
            value = math.nan if unknown else term.update(time, position, speed, **signals)
            if not math.isfinite(value):
                missing.append((effect.name, unknown))
                continue
            total += value
            for side, value in enumerate(self._shift(effect, term, time, position, signals)):
                shifts[side] += value
        return Asked(0.0, 0.0, total, (shifts[0], shifts[1]), missing)

    def _shift(self, effect: Effect, term: LiveTerm, time: float, position: float,
               signals: dict[str, float | None]) -> tuple[float, float]:
        """Return how much more the joint bears here than where its breakaway was measured, A."""
        # Neither a term with a memory nor the arm can be asked what it would be elsewhere.
        if self.measured_at is None or term.sees_history or _ARM & set(term.needs):
            return 0.0, 0.0
        shifts = []
        for elsewhere, sign in zip(self.measured_at, (1.0, -1.0)):
            if effect.role == CARRIES:
                # It is applied at rest as it is, so the level that was measured against it is rid
                # of it.
                shifts.append(-sign * term.update(time, elsewhere, 0.0, **signals))
                continue
            here, there = (term.both_sides(time, x, 0.0, **signals) for x in (position, elsewhere))
            # What does not change sign with the direction was borne at the place, too.
            shifts.append(0.5 * (here[0] - here[1] - there[0] + there[1]))
        positive, negative = (value if math.isfinite(value) else 0.0 for value in shifts)
        return positive, negative

    def largest(self, speed: float) -> tuple[float, float]:
        """Return the largest currents of the effects that resist, and of the others, A.

        Within a turn of the joint and up to a speed in rad/s; what depends on signals that come
        only later counts with its coefficients.
        """
        friction = carried = 0.0
        for effect, _ in self.terms:
            # A term of its own, for asking changes what has a memory.
            term = LiveTerm(effect)
            if term.needs:
                most = sum(map(abs, effect.coefficients))
            else:
                most = 0.0
                for k in range(65):
                    position = _FULL_TURN * (k / 32.0 - 1.0)
                    for v in (0.0, 0.1 * speed, speed):
                        for value in term.both_sides(0.0, position, v):
                            if math.isfinite(value):
                                most = max(most, abs(value))
            if effect.role == RESISTS:
                friction += most
            else:
                carried += most
        return friction, carried
