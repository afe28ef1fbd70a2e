# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What holds joints at rest by their models: weight, springs, and the pull of an arm's links.

Whoever moves a joint by its current adds this to the current of every joint: what is measured is
then friction, and a joint that is not moved stays where it is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.effects.base import CARRIES, Effect, LiveTerm
from friction_comp.model.friction_model import FrictionModel

GRAVITY = ('feed_forward', 'left_to_robot')
"""Who carries the limb's weight: the node's currents, or the robot's own controller."""


class Carried:
    """The currents that carry joints at rest, by their models.

    Parameters
    ----------
    joints : sequence of str
        Their names.
    models : sequence of FrictionModel
        One per joint.
    weight : bool
        Whether the limb's weight is carried, too; otherwise the robot's controller does.

    Attributes
    ----------
    effects : list of list of Effect
        Of each joint, those that carry it.
    """

    def __init__(self, joints: Sequence[str], models: Sequence[FrictionModel],
                 weight: bool = True) -> None:
        self._joints = list(joints)
        self._arms = [model.arm for model in models]
        self.effects: list[list[Effect]] = [[
            effect for effect in model.effects
            if effect.role == CARRIES and set(effect.needs) <= {'rigid_body', 'coupling'}
            and not effect.not_fed_back and (weight or not effect.weight)] for model in models]
        self._terms = [[LiveTerm(effect) for effect in own] for own in self.effects]

    def at(self, position: np.ndarray) -> np.ndarray:
        """Return the currents in A, (J,), at the joints' positions in rad, (J,).

        Raises InputError if a joint's depends on a position that is not known.
        """
        known = dict(zip(self._joints, position.tolist()))
        currents = np.zeros(len(self._joints))
        for j, (joint, arm, terms) in enumerate(zip(self._joints, self._arms, self._terms)):
            # Friction between joints has the signal of couplings, and is none at rest.
            signals = {'rigid_body': 0.0, 'coupling': 0.0}
            if arm is not None and any(term.needs for term in terms):
                places = np.array([known.get(name, np.nan) for name in arm.joints])
                signals[arm.signal] = arm.at_rest(places, joint)
            currents[j] = sum(term.update(0.0, float(position[j]), 0.0, **signals)
                              for term in terms)
            if not np.isfinite(currents[j]):
                raise InputError(
                    f'what carries {joint} depends on the position of a joint that is not known')
        return currents
