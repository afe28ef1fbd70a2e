# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The gears of bench/third_table.py do what their numbers say, so that they may judge others."""

import numpy as np
import pytest
from third_gear.joints import Gear, log_of, random_joint
from third_gear.plant import KINDS, STATE

pytestmark = pytest.mark.slow


def moving(speed):
    state = np.zeros(1, STATE)
    state['rotor_speed'] = state['link_speed'] = speed
    return state


@pytest.fixture(scope='module', params=range(len(KINDS)), ids=KINDS)
def gear(request):
    return Gear(2 * request.param)


def plain(gear, **changes):
    """The joint without what varies from place to place, or from rest to rest, and with changes."""
    g = gear.joint.copy()
    for name in ('gravity_cos', 'gravity_sin', 'mesh_size', 'slow_size', 'cogging', 'heat_share',
                 'rest_std', 'dwell', 'load_share'):
        g[name] = 0.0
    g['field_size'] = 0.0
    for name, value in changes.items():
        g[name] = value
    return g


def test_a_joint_without_friction_keeps_its_speed(gear):
    log = log_of(plain(gear, presence=0.0), gear.model, 'none', 2000, state=moving(0.3))
    np.testing.assert_allclose(log['link_speed'][-100:], 0.3, rtol=1e-6)


def test_a_coasting_joint_loses_its_energy_to_friction(gear):
    g = plain(gear)
    log = log_of(g, gear.model, 'none', 3000, state=moving(0.5))
    taken = np.sum(log['friction'][:-1] * np.diff(log['rotor']))
    energy = 0.5 * (g['rotor'] + g['link']) * 0.5 ** 2
    # The rest goes into the gear's own damping.
    assert 0.8 * energy < taken < 1.02 * energy
    assert abs(log['link_speed'][-1]) < 1e-3


def test_breakaway_is_static_friction(gear):
    """By slow ramps; and identification's truth is no more than a scatter away from it."""
    static = gear.joint['level'] * max(1.0, gear.joint['static_ratio']) / gear.joint['torque']
    assert gear.model.breakaway.positive_mean == pytest.approx(static, rel=0.06)
    assert -gear.model.breakaway.negative_mean == pytest.approx(static, rel=0.06)


def test_draws_depend_on_the_seed_alone():
    first, again, other = (random_joint(seed, 2)[0].tobytes() for seed in (4, 4, 6))
    assert first == again != other
