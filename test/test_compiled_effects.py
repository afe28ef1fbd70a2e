# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects in compiled code are the effects of the compensator."""

import numpy as np
import pytest
from test_effects import LEFT_OUT, PARAMETERS

from friction_comp.model.compiled import compiled_current, memory_size
from friction_comp.model.effects import EFFECTS


def test_compiled_sum_is_the_sum_of_the_live_terms():
    """All effects at once, over a motion with rests, reversals and a clock that stands still."""
    # A single joint has no others.
    effects = [EFFECTS[name](PARAMETERS[name]) for name, kind in EFFECTS.items()
               if not {'rigid_body', 'coupling'} & set(kind.needs)]
    terms = [effect.live() for effect in effects if effect.name not in LEFT_OUT]
    function, memory = compiled_current(effects), np.zeros(memory_size(effects))
    rng = np.random.default_rng(1)
    time = position = 0.0
    largest = 0.0
    for k in range(400):
        velocity = float(rng.choice([0.0, 0.004, -0.3, 0.7]))
        time += float(rng.choice([0.0, 0.001, 0.2]))
        position += 0.01 * velocity
        signals = 25.0 + 0.1 * k, float(rng.normal())
        expected = sum(term.update(time, position, velocity, *signals) for term in terms)
        assert function(time, position, velocity, *signals, memory) == pytest.approx(
            expected, rel=1e-9, abs=1e-12)
        largest = max(largest, abs(expected))
    assert largest > 0.3
