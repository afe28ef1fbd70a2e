# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The drives of bench/world/maxwell_chain.py obey what they say of themselves."""

import numpy as np
import pytest

from world import maxwell_chain as world


def plain(kind):
    gear = world.draw_gears(kind, 2, 0)
    gear['scatter'] = gear['current_noise'] = 0.0
    return gear


@pytest.mark.parametrize('kind', world.KINDS)
def test_a_chain_holds_up_to_its_breakaway_current_and_no_further(kind):
    gears = plain(kind)
    for side, column in ((1.0, 0), (-1.0, 1)):
        level = world.breakaway_currents(gears, 0, 2)[:, column]
        # What creeps fast enough slides on where friction falls with speed, as on configuration 1.
        least = np.minimum(0.98, gears['coulomb'] / gears['static'] - 0.005)
        for share, holds in ((least, True), (1.03, False)):
            plant = world.Plant(gears, None, 0)
            while plant.time < 2.5:
                plant.advance(side * share * level * min(1.0, plant.time / 1.5))
            speed = np.abs(plant.states['motor_velocity'])
            assert (speed < 1e-5).all() if holds else (speed > 1e-4).all()
            if holds:
                way = side * plant.states['motor']
                assert (way < gears['presliding']).all()
                assert (way > 0.2 * gears['presliding']).all()


def test_friction_rises_or_falls_from_standstill_as_in_the_note():
    for kind, rises in zip(world.KINDS, (False, True, True)):
        slow, fast = (float(np.mean([world.steady_friction(gear, np.array(v))
                                     for gear in plain(kind)])) for v in (1e-9, 0.02))
        assert (fast > 1.05 * slow) == rises
