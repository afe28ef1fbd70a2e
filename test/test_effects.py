# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Each effect obeys its docstring, and properties that all effects share for any numbers."""

import math

from effect_maker import defaults, parameters_of, samples_of
from hypothesis import given, strategies as st
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.model.effects import Coverage, EFFECTS
from friction_comp.model.effects.base import LiveTerm, Signals
from friction_comp.model.effects.kinds import Backlash, Hysteresis
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples

# Even or odd: the current if the motion is mirrored in time, at the same position.
ODD = {'stribeck', 'viscous_shape', 'friction_ripple', 'load_friction', 'carried_load_friction',
       'inner_load_friction'}
EVEN = {'direction_asymmetry', 'gravity', 'spring', 'cogging', 'load_torque', 'offset_drift'}
HOLDS = {'gravity', 'spring', 'cogging', 'rigid_body', 'other_joints'}
LIVE = [name for name in EFFECTS if name not in (
    'warm_up', 'inertia', 'load_torque', 'offset_drift')]
COVERAGE = Coverage(transition=0.02, speed=1.0, slowest=0.01, lowest=-1.0, highest=1.0,
                    duration=100.0, resolution=1e-5)
SIGNALS = {'temperature': 60.0, 'load': -20.0, 'rigid_body': 3.0, 'coupling': 0.2}
MOTION = samples_of(np.sin(0.013 * np.arange(500)), 1.3 * np.cos(0.013 * np.arange(500)))


def current_of(effect, place, speed, **changes):
    return EFFECTS[effect](defaults(effect, **changes)).current(samples_of(place, speed))


@pytest.mark.parametrize('name', sorted(ODD | EVEN))
def test_friction_reverses_with_the_direction_and_other_torques_do_not(name):
    speeds = np.array([-1.0, -0.3, -0.1, 0.1, 0.3, 1.0])
    forward, backward = (current_of(name, np.full(6, 0.4), way * speeds) for way in (1, -1))
    assert np.all(forward != 0)
    assert forward == pytest.approx((-1 if name in ODD else 1) * backward, rel=1e-12)


# Effect, other constants than those of `defaults`, places, velocities, and the current in A.
SHAPES = [
    ('stribeck', {'exponent': 1.0}, 0.0, [0.1] * 2, [0.1 * math.tanh(5.0) / math.e] * 2),
    ('stribeck', {'exponent': 1.0}, 0.0, [1e-9, 1.0], [0.0, 0.0]),
    # Of u^0.5, 0.8·u belongs to the linear term.
    ('viscous_shape', {'exponent': 0.5}, 0.0, [0.25, 1.0], [0.1 * (0.5 - 0.2), 0.1 * (1.0 - 0.8)]),
    ('bump', {}, [0.3, 0.4, 0.2, 1.3], 1.0, [0.1, *[0.1 * math.exp(-0.5)] * 2, 0.0]),
    ('bump', {}, [0.3, 1.3], -1.0, [-0.1, 0.0]),
    ('bump', {'directional': 0.0}, [0.3, 1.3], -1.0, [0.1, 0.0]),
    ('spring', {}, [0.3, 1.3], 0.0, [0.0, 0.1]),
    ('inertia', {}, 0.0, 0.02 * np.arange(5), [0.2] * 5),
    ('load_torque', {}, 0.0, [0.0, 1.0], [0.15] * 2),
    ('load_friction', {}, 0.0, [1.0] * 2, [0.1 * 1.5 ** 2] * 2),
    ('temperature', {'coefficients': [-0.01, -0.002, 0.0]}, 0.0, [1.0] * 2, [-0.12] * 2),
    ('cogging', {'growth': 2.0, 'coefficients': [0.1, 0.0]}, 0.0, [0.25, 0.5],
     [0.00625, 0.025])]


@pytest.mark.parametrize(('effect', 'changes', 'place', 'speed', 'expected'), SHAPES)
def test_the_current_is_what_the_docstring_says(effect, changes, place, speed, expected):
    found = current_of(effect, place, speed, **changes)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-4 if 0.0 in expected else 1e-12)


@pytest.mark.parametrize('name', ['warm_up', 'offset_drift'])
def test_warm_up_and_drift_fade_with_their_time_and_are_not_of_another_day(name):
    current = current_of(name, np.zeros(1001), np.ones(1001))
    assert current[200] / current[0] == pytest.approx(1 / math.e, rel=1e-9)
    assert abs(current[-1]) < 0.01 * abs(current[0])
    model = FrictionModel(Drive(1.0, 1.0), Sigmoid(0.1, -0.1, 100.0), effects=[
        EFFECTS[name](defaults(name))])
    same, other = model.predict(MOTION, same_recording=True), model.predict(MOTION)
    assert np.max(np.abs(same)) > 0.19
    assert np.max(np.abs(other)) == pytest.approx(0.1, rel=0.05)


def test_hysteresis_depends_on_the_path_and_not_on_time():
    way = np.concatenate((np.linspace(0, 0.2, 41), np.linspace(0.2, 0.15, 41)[1:]))
    speed = np.concatenate((np.full(41, 0.5), np.full(40, -0.125)))
    effect = EFFECTS['hysteresis'](defaults('hysteresis', coefficients=[0.1, 0.0]))
    quick, slow = samples_of(way, speed), samples_of(way, speed, step=0.1)
    assert effect.current(slow) == pytest.approx(effect.current(quick))
    # A gap in the data ends the memory.
    gap = quick.with_(time=quick.time + np.where(np.arange(81) > 60, 5.0, 0.0))
    assert effect.current(gap)[61] == pytest.approx(-0.1 * math.tanh(0.125 / 0.02))


@pytest.mark.parametrize(('exponent', 'left'), [
    (0.5, (math.sqrt(2) - 0.5) ** 2), (1.0, 2 / math.e), (2.0, 1 / 1.5)])
def test_hysteresis_reverses_as_its_exponent_says(exponent, left):
    # The solution of du/dx = -u^p for u = 1 - z, which is 2 at the reversal, at x = 1.
    c = Hysteresis.Constants(0.05, exponent, 0.02)

    def turned(state, step):
        return Hysteresis.step(state, 0.0, step, 0.0, c)
    assert 1.0 - turned(-1.0, 0.05) == pytest.approx(left)
    assert turned(turned(-1.0, 0.02), 0.03) == pytest.approx(turned(-1.0, 0.05))
    assert turned(0.3, 0.0) == 0.3
    assert turned(0.3, -1e3) == pytest.approx(-1.0, abs=1e-3)


def test_behind_a_backlash_friction_returns_after_the_gap_however_finely_it_is_sampled():
    c = Backlash.Constants(0.02, 0.005, 0.02)

    def after(way, steps):
        state = Backlash.start(-1.0, c)
        for _ in range(steps):
            state = Backlash.step(state, 0.0, way / steps, 0.0, c)
        return Backlash.columns(Signals(memory=state), c)[0]
    for steps in (1, 7):
        assert [after(way, steps) for way in (0.0, 2.5e-3, 5e-3, 0.025, 0.0275, 0.03, 0.5)] == (
            pytest.approx([-1.0, -0.5, 0.0, 0.0, 0.5, 1.0, 1.0]))


@pytest.mark.parametrize('name', ['hysteresis', 'backlash', 'rest_time'])
def test_long_recordings_have_the_same_states_as_short_ones(name):
    """Those are compiled; a recording of two halves is the same as each."""
    time = 0.01 * np.arange(3000)
    half = samples_of(0.4 * np.sin(time), 0.4 * np.cos(time) * (np.sin(0.3 * time) > 0.0))
    both = Samples.concatenate([half, half])
    effect = EFFECTS[name](defaults(name))
    assert effect.current(both) == pytest.approx(np.tile(effect.current(half), 2), abs=1e-12)


@pytest.mark.parametrize('name', EFFECTS)
@given(data=st.data())
def test_any_motion_gives_a_finite_current_linear_in_the_coefficients(name, data):
    parameters, factor = data.draw(parameters_of(name)), data.draw(st.floats(-3.0, 3.0))
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    samples = samples_of(
        rng.uniform(-100, 100, 60), rng.choice([0.0, 1e-300, 1e-6, 0.1, 1.0, 50.0], 60)
        * rng.choice([-1, 1], 60), load=float(rng.uniform(-50, 50)),
        temperature=float(rng.uniform(-40, 150)))
    other = rng.uniform(-1, 1, len(parameters['coefficients']))
    mixed = factor * np.array(parameters['coefficients']) + other
    current, second, third = (
        EFFECTS[name]({**parameters, 'coefficients': list(map(float, values))}).current(samples)
        for values in (parameters['coefficients'], other, mixed))
    assert current.shape == (60,)
    assert np.isfinite(current).all()
    size = 1.0 + np.abs(current).max() + np.abs(second).max()
    assert third == pytest.approx(factor * current + second, abs=1e-9 * size)


@pytest.mark.parametrize('name', LIVE)
@given(data=st.data())
def test_live_no_friction_at_standstill_and_nothing_infinite_anywhere(name, data):
    parameters = data.draw(parameters_of(name))
    term = LiveTerm(EFFECTS[name](parameters))
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    time = 0.0
    for _ in range(40):
        # Clocks that stand still or run back, and jumps of the position, happen with real drivers.
        time += float(rng.choice([0.001, 0.0, -0.5, 10.0]))
        speed = float(rng.choice([0.0, 1e-300, -0.001, 0.5, -30.0]))
        assert math.isfinite(term.update(time, float(rng.uniform(-50, 50)), speed, **SIGNALS))
    place = float(rng.uniform(-2, 2))
    _, here, again = (term.update(time + step, place, rest, **SIGNALS)
                      for step, rest in ((0.0, 0.0), (0.001, 0.0), (0.002, -0.0)))
    if name in HOLDS or (name == 'bump' and not parameters['directional']):
        assert here == again
    else:
        assert here == 0.0


@pytest.mark.parametrize('name', LIVE)
def test_live_and_offline_are_the_same_in_motion_on_the_same_samples(name):
    """Equal to rounding where both know the whole past, else once the start is forgotten."""
    time = np.arange(0.0, 8.0, 0.005)
    position = 0.8 * np.sin(1.1 * time)
    samples = samples_of(position, np.gradient(position, time), step=0.005)
    effect = EFFECTS[name](defaults(name))
    term, offline = LiveTerm(effect), effect.current(samples)
    signals = {name: getattr(samples, name)[0] for name in SIGNALS}
    motion = list(zip(samples.time, samples.position, samples.velocity))
    live = np.array([term.update(*sample, **signals) for sample in motion])
    known = np.abs(samples.velocity) > 0.1
    if name in ('hysteresis', 'backlash'):
        known &= samples.time > 1.0
    tolerance = {'hysteresis': 1e-4 * np.abs(offline).max(), 'backlash': 1e-8}.get(name, 1e-12)
    assert np.abs(offline[known]).max() > 1e-3
    assert live[known] == pytest.approx(offline[known], abs=tolerance)
    # A reset clears the history of the motion.
    term.reset()
    again = [term.update(time + 8.0, *sample, **signals) for time, *sample in motion[:100]]
    assert again == pytest.approx(live[:100], rel=1e-9, abs=1e-12)


def test_beyond_its_fitted_range_an_effect_keeps_its_value_at_the_edge():
    spring = EFFECTS['spring']({'position': 0.0, 'coefficients': [2.0]}, {'position': [-0.5, 0.8]})
    position, expected = [-2.0, -0.5, 0.3, 0.8, 5.0], [-1.0, -1.0, 0.6, 1.6, 1.6]
    assert spring.current(samples_of(position, 0.0)) == pytest.approx(expected)
    live = LiveTerm(spring)
    assert [live.update(0.0, q, 0.0) for q in position] == pytest.approx(expected)
    warm = LiveTerm(EFFECTS['temperature'](defaults('temperature'), {'temperature': [25.0, 40.0]}))
    assert warm.update(0.0, 0.0, 1.0, temperature=90.0) == warm.update(
        0.0, 0.0, 1.0, temperature=40.0)
    assert np.isnan(warm.update(0.0, 0.0, 1.0, temperature=np.nan))
