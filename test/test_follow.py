# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A follower under an MIT-mode controller: the law, and the example's parameters."""

from pathlib import Path

import pytest
import yaml

from friction_comp.compensation.law import CompensationLaw, LAWS
from simulated_recordings.small_model import LEVEL, small_model


def test_friction_of_the_desired_motion_is_fed_forward_however_the_joint_moves():
    law = CompensationLaw([small_model()], 'desired')

    def after(count, speed, direction):
        for _ in range(count):
            after.time, after.place = after.time + 1e-3, after.place + 1e-3 * speed
            current = law.update(after.time, [after.place], None, [direction])[0]
        return current
    after.time = after.place = 0.0
    assert after(200, 0.0, 0) == 0.0
    # Within 20 ms, also where the joint stays, comes back, or was never announced to stop.
    for direction in (1, -1):
        assert after(20, 0.0, direction) == pytest.approx(0.9 * direction * LEVEL, rel=0.03)
        for speed in (0.2, -0.2):
            assert after(500, speed, direction) == pytest.approx(0.9 * direction * LEVEL, rel=0.03)
    assert after(20, -0.2, 0) == 0.0
    assert after(500, 2.7, 1) == 0.0
    assert after(500, 0.1, 1) == pytest.approx(0.9 * LEVEL, rel=0.03)


def test_the_example_of_a_follower_sets_parameters_that_the_nodes_have():
    root = Path(__file__).parents[1]
    known, example = (yaml.safe_load((root / path).read_text(encoding='utf-8')) for path in (
        'config/parameters.yaml', 'examples/mit_mode/arm_like.yaml'))
    for node, content in example.items():
        names = set(content['ros__parameters']) - {'joints', 'model_files'}
        assert names <= set(known[node]['ros__parameters']), node
    law = example['/**/compensator']['ros__parameters']['law']
    # The law of followers, and the source of its direction.
    assert LAWS[law] == LAWS['desired']
    assert example['/**/direction']['ros__parameters']['source'] == 'reference'
