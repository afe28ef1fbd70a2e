# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""From recordings to rows of a fit: motion, blocks of time, lag, limits and load."""

from helpers import sines
import numpy as np
import pytest

from friction_comp import refine
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.differentiation import shifted_in_time
from friction_comp.model.effects import EFFECTS
from friction_comp.refinement.effect_columns import Table, Term
from friction_comp.refinement.prepare import clipped, join, load_coefficient, prepare
from friction_comp.refinement.search import adjust_constants
from friction_comp.samples import Samples

DRIVE = Drive(0.1, 100.0)


def swings(seed, duration=40.0, step=0.01):
    """Return samples of a joint that swings, with a plain drive's current."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, step)
    q, v, a = sines(time, ((0.4, 2.0 * np.pi * frequency, rng.uniform(0.0, 2.0 * np.pi))
                           for frequency in (0.09, 0.23, 0.41)))
    current = 0.5 * np.tanh(v / 0.01) + 0.2 * v + 0.02 * rng.standard_normal(time.size)
    return Samples(time=time, position=q, velocity=v, acceleration=a, current=current)


def test_samples_that_are_no_numbers_are_left_out_and_a_signal_that_is_hardly_there_too():
    samples = swings(1)
    current, temperature, load = samples.current.copy(), np.full(4000, np.nan), np.zeros(4000)
    current[10] = np.nan
    load[20:30] = np.inf
    temperature[::3] = 30.0
    joined = join([samples.with_(current=current, load=load, temperature=temperature)])
    assert len(joined) == 4000 - 11
    assert joined.temperature is None
    assert np.isfinite(joined.load).all()


@pytest.mark.parametrize(('parts', 'words'), [
    ([], 'no samples'), ([swings(1).take(slice(0, 150))], '150 usable samples are too few'),
    ([swings(1).with_(position=np.full(4000, 0.3))], 'never moves')])
def test_too_little_is_refused_in_one_line(parts, words):
    with pytest.raises(InputError, match=words) as caught:
        join(parts)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(('change', 'words'), [
    ({'current': np.clip(50.0 * swings(1).velocity, -1.0, 1.0)}, 'at a limit in nearly all motion'),
    ({'time': np.zeros(4000)}, 'time stamps')])
def test_a_recording_that_shows_no_friction_is_refused(change, words):
    with pytest.raises(InputError, match=words):
        prepare(join([swings(1).with_(**change)]), DRIVE)


def test_a_joint_that_hardly_moves_is_refused():
    still = swings(1)
    step = np.where(still.time > 39.0, 0.1 * np.sin(40.0 * (still.time - 39.0)), 0.0)
    with pytest.raises(InputError, match='hardly moves'):
        prepare(still.with_(position=step, velocity=None, acceleration=None), DRIVE)


def test_a_current_that_is_cut_off_is_seen_and_one_that_is_not_is_left_alone():
    samples = swings(4)
    limit = float(np.quantile(np.abs(samples.current), 0.8))
    cut = clipped(np.clip(samples.current, -limit, limit))
    assert np.array_equal(cut, np.abs(samples.current) >= limit)
    assert not clipped(samples.current).any()
    assert not clipped(np.zeros(100)).any()
    # Nor is one that constant speeds repeat, except for its noise.
    speed = np.convolve(0.6 * np.sign(np.sin(0.25 * np.pi * samples.time)), np.ones(30) / 30.0,
                        mode='same')
    noise = 0.01 * np.random.default_rng(5).standard_normal(4000)
    assert not clipped(0.4 * np.tanh(speed / 0.01) + 0.3 * speed + noise).any()


@pytest.mark.parametrize('rests', [False, True])
def test_a_current_of_two_levels_is_a_command(rests):
    """Coulomb friction 0.4 A, inertia 0.05 A·s²/rad; pushed to and fro by 1 A, or not at all."""
    rng, step = np.random.default_rng(0), 0.002
    levels = np.repeat(np.tile([1.0, -1.0], 40), rng.integers(80, 200, 80))
    if rests:
        levels[rng.integers(0, len(levels) - 60, 4)[:, None] + np.arange(60)] = 0.0
    assert not clipped(levels).any()
    velocity = np.zeros(len(levels))
    for n, pushed in enumerate(levels[:-1]):
        driven = velocity[n] + step / 0.05 * pushed
        velocity[n + 1] = np.sign(driven) * max(abs(driven) - step / 0.05 * 0.4, 0.0)
    found = refine([Samples(time=step * np.arange(len(levels)), current=levels,
                            position=step * np.cumsum(velocity))])
    assert found.report.friction.coulomb == pytest.approx(0.4, rel=0.03)


@pytest.mark.parametrize('held', [(0.9,), (0.5, -0.5, 0.9, -0.9)])
def test_a_step_that_is_held_at_the_largest_current_is_no_limit(held):
    """Ramps and steps of a commanded current; Coulomb friction 0.3 A, viscous 0.1, inertia 0.05."""
    step, rest = 0.002, np.zeros(300)
    ramp = np.interp(np.arange(6000.0), (0.0, 1500.0, 4500.0, 6000.0), (0.0, 0.9, -0.9, 0.0))
    once = [ramp, *(part for level in held for part in (np.full(600, level), rest))]
    current = np.concatenate(once * 3)
    velocity = np.zeros(len(current))
    for n, pushed in enumerate(current[:-1]):
        driven = velocity[n] + step / 0.05 * (pushed - 0.1 * velocity[n])
        velocity[n + 1] = np.sign(driven) * max(abs(driven) - step / 0.05 * 0.3, 0.0)
    report = refine([Samples(time=step * np.arange(len(current)), current=current,
                             position=step * np.cumsum(velocity))]).report
    assert report.samples_clipped == 0
    assert report.friction.coulomb == pytest.approx(0.3, rel=0.02)
    assert report.friction.inertia == pytest.approx(0.05, rel=0.02)


def test_a_load_that_is_the_torque_behind_the_gear_is_not_counted_twice():
    """Its sign is that of the motor's torque on the links: their weight 6, inertia 0.3."""
    samples = swings(7)
    rng = np.random.default_rng(7)
    links = 6.0 * np.sin(samples.position) + 0.3 * samples.acceleration
    noise = 0.02 * rng.standard_normal((2, len(samples)))
    found = refine([samples.with_(current=samples.current + links + noise[0],
                                  load=links + 5.0 * noise[1])], drive=Drive(1.0, 1.0))
    effects = {effect.name: effect.parameters['coefficients'] for effect in found.report.effects}
    assert effects['gravity'] == pytest.approx([0.0, 6.0], abs=0.1)
    assert effects['inertia'] == pytest.approx([0.3], rel=0.1)


@pytest.mark.parametrize('step', [0.02, 0.05])
def test_a_current_in_coarse_steps_is_not_cut_off(step):
    velocity = swings(4).velocity
    coarse = np.round((0.5 * np.tanh(velocity / 0.01) + 0.2 * velocity) / step) * step
    assert not clipped(coarse).any()
    limit = 4.0 * step
    assert clipped(np.clip(coarse, -limit, limit)).mean() == pytest.approx(
        np.mean(np.abs(coarse) > limit - 1e-9))


def test_standstill_is_not_fitted():
    samples = swings(2)
    rest = (samples.time > 10.0) & (samples.time < 14.0)
    held = np.where(rest, np.interp(10.0, samples.time, samples.position), samples.position)
    held[samples.time >= 14.0] += held[rest][0] - samples.position[samples.time >= 14.0][0]
    rows, settings = prepare(samples.with_(position=held, velocity=None, acceleration=None), DRIVE)
    inner = (samples.time > 10.3) & (samples.time < 13.7)
    assert not rows.usable[inner].any()
    assert rows.usable[~rest].mean() > 0.8
    assert settings['source'] == 'position'


@pytest.mark.parametrize('lag', [0.021, -0.005, 0.3])
def test_a_shift_in_time_stays_within_stretches(lag):
    rng = np.random.default_rng(11)
    time = np.cumsum(rng.uniform(0.008, 0.012, 800))
    time[200:] += 3.0
    time[500:] -= 8.0
    values = rng.standard_normal((800, 3))
    samples = Samples(time=time, position=values[:, 0], current=values[:, 1])
    expected = np.array(values)
    for part in samples.segments():
        for column in range(3):
            expected[part, column] = np.interp(
                samples.time[part] + lag, samples.time[part], values[part, column])
    assert shifted_in_time(values, samples, lag) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(('carried', 'is_known'), [(0.3, True), (1.0, True), (0.0, False)])
def test_a_load_that_a_person_carries_belongs_to_what_is_measured(carried, is_known):
    """Under a law the current follows the motion; a motor that holds the load shows it itself."""
    samples = swings(5)
    rng = np.random.default_rng(5)
    if is_known:
        load = carried * samples.current * DRIVE.torque_per_current
        current = (1.0 - carried) * samples.current
    else:
        load = np.cumsum(rng.standard_normal(len(samples))) / 20.0
        current = samples.current - load / DRIVE.torque_per_current
    block = np.repeat(np.arange(16), 250)
    gain = load_coefficient(samples.with_(load=load, current=current), block, DRIVE)
    assert gain == (-1.0 / DRIVE.torque_per_current if is_known else 0.0)


def test_the_target_includes_the_torque_of_the_person():
    samples = swings(6)
    friction = samples.current
    given = samples.with_(current=0.6 * friction, load=0.4 * friction * DRIVE.torque_per_current)
    rows, _ = prepare(given, DRIVE)
    assert rows.target == pytest.approx(friction)
    rows, _ = prepare(given, DRIVE, declared=False)
    assert rows.target == pytest.approx(0.6 * friction)


def test_a_constant_at_its_upper_limit_is_adjusted_too():
    motion = swings(6)
    speed = np.abs(motion.velocity)
    current = np.sign(motion.velocity) * (0.5 + 0.3 * np.exp(-speed / 0.4))
    rows, _ = prepare(join([motion.with_(current=current, acceleration=None)]), DRIVE)
    table = Table(rows, 1000.0)
    limit = EFFECTS['stribeck'].limited('velocity', np.inf, {}, rows.coverage)
    term, = table.add([Term(EFFECTS['stribeck'], {
        'velocity': limit, 'exponent': 1.0, 'transition': rows.coverage.transition})])
    found, = adjust_constants(table, [term], 5)
    assert limit > 0.6
    assert found.constants['velocity'] == pytest.approx(0.4, rel=0.2)
