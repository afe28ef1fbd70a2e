# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects that a model can have beside the sigmoid: one file each, and one line in the list."""

from friction_comp.model.effects.base import Effect, OnlineTerm, VARIABLES

EFFECTS = {effect.name: effect for effect in ()}

__all__ = ['EFFECTS', 'Effect', 'OnlineTerm', 'VARIABLES']
