# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs the law on a model before a motor gets its currents, and loads the law's compiled code.

Both take long, and neither may happen for the first time while a motor is driven.
"""

from __future__ import annotations

from dataclasses import replace
import functools
import math
from typing import NamedTuple

import numpy as np

from friction_comp.compensation.law import CompensationLaw
from friction_comp.control.feed_forward import changes, feed_forward, FeedForward
from friction_comp.errors import InputError
from friction_comp.files import package_file
from friction_comp.model.arm import Arm, FREE_FALL, PARAMETERS, Tree
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.motor_check import doubts


class Loaded(NamedTuple):
    """A model that was tried, and what the law feeds forward with it."""

    model: FrictionModel
    feed: FeedForward

    def told(self, before: FeedForward | None = None) -> list[str]:
        """Return what a file says against its model, and what changed since before."""
        changed = [] if before is None else changes(before, self.feed)
        return [*doubts(self.model),
                *(f'feeds forward otherwise than before: {text}' for text in changed)]


def try_model(model: FrictionModel, gravity: str, path: str) -> Loaded:
    """Run a model in a separate law for a movement to and fro; raise InputError if it fails."""
    try:
        law = CompensationLaw([model], gravity=gravity)
        for k in range(300):
            angle = 0.02 * k
            current = law.update(
                1e-3 * k, [math.sin(angle)], [20.0 * math.cos(angle)], [1.0 - k % 3],
                temperature=[25.0])
            if not np.isfinite(current).all():
                raise InputError('its currents are not finite')
        return Loaded(model, feed_forward(model))
    except InputError as error:
        raise InputError(f'{path}: {error}') from None
    except Exception as error:
        raise InputError(f'{path}: the law cannot use it: {error!r}') from None


@functools.cache
def load_compiled_code() -> None:
    """Load all compiled code that a law may need, once; without the cache this takes seconds."""
    # Effects with memory and the arm are what is compiled beside the law itself.
    effects = [effect({**dict.fromkeys(effect.constants, 1.0),
                       'coefficients': [0.0] * len(effect.units)})
               for effect in EFFECTS.values()
               if effect.has_memory and effect.__module__.startswith('friction_comp.')]
    link = Tree(('joint',), ('revolute',), np.array([-1]), np.eye(3)[None], np.zeros((1, 3)),
                np.eye(3)[:1], np.zeros((1, PARAMETERS)), np.array(FREE_FALL))
    model = FrictionModel.load(package_file('config', 'armin_configuration_1.yaml'))
    try_model(replace(model, joint='joint', arm=Arm(link), effects=effects), 'feed_forward', '')
