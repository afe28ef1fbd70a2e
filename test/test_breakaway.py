# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Breakaway currents from current ramps, and what affects their scatter."""

from numba import njit
import numpy as np
import pytest

from friction_comp.errors import InputError
from friction_comp.identification.kinetic import ramp_current
from friction_comp.note.identify import breakaway_currents

PERIOD = 10.0
COUNT = 1.57e-5  # rad
ramps_of = np.vectorize(ramp_current)


@njit(cache=True)
def _drive(command, levels, kinetic, viscous, acceleration, stiffness, damping, noise):
    """Step a joint that holds elastically up to a known level, then slides: all in A and rad."""
    position = np.empty(command.size)
    current = np.empty(command.size)
    x, v, z, ramp, sliding, steps = 0.0, 0.0, 0.0, -1, False, 10
    h = 1e-3 / steps
    for k in range(command.size):
        position[k], current[k] = x, command[k] + noise[k]
        if command[k] != 0.0 and (k == 0 or command[k - 1] == 0.0):
            ramp += 1
        for _ in range(steps):
            force = stiffness * z + damping * v
            level = levels[max(ramp, 0)]
            if not sliding and abs(force) > level:
                sliding = True
            if sliding:
                limit = kinetic * level + viscous * abs(v)
                force = limit * np.sign(v) if abs(v) > 1e-9 else limit * np.sign(command[k])
            else:
                z += h * v
            before = v
            v += h * acceleration * (command[k] - force)
            if sliding and before * v < 0.0:
                v, sliding = 0.0, False
                z = 0.0
            x += h * v
    return position, current


def known_ramps(slope=0.05, level=0.1, scatter=0.004, cycles=15, kinetic=0.95, viscous=0.05,
                acceleration=119.0, deflection=4e-4, noise=2e-3, count=COUNT, seed=2):
    """Return time, position, current, command of ramps, and their breakaway levels."""
    random = np.random.default_rng(seed)
    levels = level + scatter * random.normal(size=2 * cycles)
    time = np.arange(round(cycles * PERIOD * 1000)) * 1e-3
    command = ramps_of(np.mod(time, PERIOD), slope, PERIOD)
    stiffness = level / deflection
    position, current = _drive(
        command, levels, kinetic, viscous, acceleration, stiffness,
        1.4 * np.sqrt(stiffness / acceleration), noise * random.normal(size=time.size))
    position = np.round(position / count) * count
    return time, position, current, command, levels * np.where(np.arange(2 * cycles) % 2, -1, 1)


NOTE_LIKE = {
    1: {},
    2: {'slope': 0.06, 'level': 0.138, 'scatter': 0.0043, 'kinetic': 1.0, 'viscous': 0.6},
    3: {'slope': 0.12, 'level': 0.336, 'scatter': 0.017, 'acceleration': 27.0,
        'deflection': 4e-3, 'count': 3.6e-6}}


@pytest.mark.slow
@pytest.mark.parametrize('number', NOTE_LIKE)
def test_known_levels_are_measured_ramp_by_ramp(number):
    *ramps, levels = known_ramps(**NOTE_LIKE[number])
    records = breakaway_currents(*ramps, NOTE_LIKE[number].get('count', COUNT))
    assert records.direction.tolist() == [1, -1] * 15
    # Each is read within the rise of its ramp.
    assert np.all(np.mod(records.time, PERIOD / 2.0) < 0.4 * PERIOD)
    error = records.current - levels
    assert abs(np.mean(error * records.direction)) < 0.01 * np.mean(np.abs(levels))
    np.testing.assert_allclose(records.current, levels, rtol=0.03)
    statistics = records.statistics()
    assert statistics.positive_mean == pytest.approx(np.mean(levels[::2]), rel=0.01)
    assert statistics.negative_mean == pytest.approx(np.mean(levels[1::2]), rel=0.01)
    assert statistics.positive_std == pytest.approx(np.std(levels[::2], ddof=1), rel=0.15)


def test_encoder_dither_is_not_taken_for_motion():
    time, position, current, command, levels = known_ramps()
    dither = np.random.default_rng(5).integers(-1, 2, time.size) * COUNT
    records = breakaway_currents(time, position + dither, current, command, COUNT)
    assert len(records) == 30
    assert abs(np.mean((records.current - levels) * records.direction)) < 0.001
    np.testing.assert_allclose(records.current, levels, rtol=0.04)


def test_ramps_cut_at_the_breakaway_are_enough():
    time, position, current, command, levels = known_ramps(cycles=4)
    whole = breakaway_currents(time, position, current, command, COUNT)
    keep = np.ones(time.size, dtype=bool)
    for instant in whole.time:
        keep &= ~((time > instant + 0.3) & (time < np.ceil(instant / 5.0) * 5.0 - 0.7))
    cut = breakaway_currents(time[keep], position[keep], current[keep], command[keep], COUNT)
    np.testing.assert_allclose(cut.current, levels, rtol=0.03)


def test_progressive_creep_before_the_slide():
    # A Dahl-like contact: it yields more as the current approaches the level.
    time = np.arange(0.0, 6.0, 1e-3)
    current = 0.05 * time
    level = 0.1731
    begin = level / 0.05
    slide = np.maximum(time - begin, 0.0)
    ratio = np.minimum(current / level, 0.999)
    position = 4e-4 * -np.log1p(-0.97 * ratio) + 0.5 * 119 * 0.05 / 3 * slide ** 3
    position = np.round(position / COUNT) * COUNT
    noise = np.random.default_rng(1).normal(scale=2e-3, size=time.size)
    records = breakaway_currents(time, position, current + noise, current, COUNT)
    assert records.current == pytest.approx([level], rel=0.02)


def test_ramps_that_stay_below_the_level_have_no_breakaway():
    *ramps, _ = known_ramps(level=0.3, cycles=3)
    records = breakaway_currents(*ramps, COUNT)
    assert len(records) == 0
    with pytest.raises(InputError, match='no breakaway in the positive'):
        records.statistics()


def test_the_position_is_that_of_the_instant():
    time, position, current, command, _ = known_ramps(cycles=2)
    records = breakaway_currents(time, position, current, command, COUNT)
    assert len(records) == 4
    np.testing.assert_allclose(records.position, position[np.searchsorted(time, records.time)])
    assert records.statistics().positive_position == np.mean(records.position[::2])
