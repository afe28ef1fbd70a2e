# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Each effect obeys its docstring, and properties that all effects share for any numbers."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS
from friction_comp.model.effects.definitions import Signals
from friction_comp.model.effects.history_effects import Backlash, Hysteresis
from friction_comp.model.effects.live_term import LiveTerm, SHARPEST_LIVE
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples

TRANSITION = 0.02
# Values that any constant may have, so that the properties below hold for more than one drive.
RANGES = {
    'velocity': (0.005, 1.0), 'exponent': (0.3, 4.0), 'transition': (1e-4, 0.1),
    'reference': (0.1, 2.0), 'offset': (0.0, 1.0), 'position': (-2.0, 2.0),
    'frequency': (0.5, 500.0), 'growth': (0.0, 2.0), 'speed': (0.1, 2.0), 'width': (0.005, 1.0),
    'directional': (0.0, 1.0), 'reference_temperature': (10.0, 40.0),
    'time_constant': (0.1, 1000.0), 'distance': (1e-4, 1.0), 'gap': (1e-4, 1.0),
    'cosine': (-2.0, 2.0), 'sine': (-2.0, 2.0), 'slope': (-1.0, 1.0), 'fading': (0.0, 1.0),
    # Live there is no acceleration: with it, live and offline are not the same.
    'inertia': (0.0, 0.0), 'with_inertia': (0.0, 1.0),
}
FLAGS = {'offset', 'directional', 'fading', 'with_inertia'}
COLUMNS = {
    'direction_asymmetry': 2, 'gravity': 2, 'cogging': 2, 'friction_ripple': 2, 'temperature': 3,
    'warm_up': 3, 'hysteresis': 2,
}
# Even or odd: the current if the motion is mirrored in time, at the same position.
ODD = {'stribeck', 'viscous_shape', 'friction_ripple', 'load_friction', 'carried_load_friction',
       'inner_load_friction'}
EVEN = {'direction_asymmetry', 'gravity', 'spring', 'cogging', 'load_torque', 'offset_drift'}
HOLDS = {'gravity', 'spring', 'cogging', 'rigid_body', 'other_joints'}
LIVE = [name for name in EFFECTS if name not in (
    'warm_up', 'inertia', 'load_torque', 'offset_drift')]


def constant(name):
    low, high = RANGES[name]
    return st.sampled_from([low, high]) if name in FLAGS else st.floats(low, high)


@st.composite
def parameters_of(draw, name):
    count = COLUMNS.get(name, 1)
    found = {key: draw(constant(key)) for key in EFFECTS[name].constants}
    return {**found, 'coefficients': draw(
        st.lists(st.floats(-2.0, 2.0), min_size=count, max_size=count))}


def defaults(name, /, **changes):
    """Return parameters in the middle of everything, all coefficients 0.1."""
    middle = {'transition': TRANSITION, 'exponent': 2.0, 'offset': 0.0, 'directional': 1.0,
              'growth': 0.0, 'position': 0.3, 'width': 0.1, 'speed': 1.0,
              'reference': 1.0, 'velocity': 0.1, 'frequency': 12.0, 'time_constant': 2.0,
              'distance': 0.05, 'gap': 0.04, 'reference_temperature': 25.0,
              'cosine': 0.5, 'sine': 0.2, 'slope': 0.1, 'inertia': 0.0, 'with_inertia': 0.0,
              'fading': 0.0}
    if name in ('hysteresis', 'viscous_shape'):
        # Squared, the bend is zero at its reference.
        middle['exponent'] = 1.0 if name == 'hysteresis' else 3.0
    found = {key: middle[key] for key in EFFECTS[name].constants}
    return {**found, 'coefficients': [0.1] * COLUMNS.get(name, 1), **changes}


def samples_of(position, velocity, step=0.01, load=1.5, temperature=35.0):
    position, velocity = np.broadcast_arrays(
        np.asarray(position, dtype=float), np.asarray(velocity, dtype=float))
    time = step * np.arange(len(position))
    return Samples(
        time=time, position=position.copy(), velocity=velocity.copy(),
        current=np.zeros_like(time), acceleration=np.gradient(velocity, step),
        load=np.full_like(time, load), temperature=np.full_like(time, temperature),
        rigid_body=np.full_like(time, load), coupling=np.full_like(time, 0.1))


def current_of(effect, place, speed, **changes):
    return EFFECTS[effect](defaults(effect, **changes)).current(samples_of(place, speed))


SPEEDS = np.array([-1.0, -0.3, -0.1, 0.1, 0.3, 1.0])


@pytest.mark.parametrize('name', sorted(ODD | EVEN))
def test_friction_reverses_with_the_direction_and_other_torques_do_not(name):
    forward, backward = (current_of(name, np.full(6, 0.4), way * SPEEDS) for way in (1, -1))
    assert np.all(forward != 0)
    assert forward == pytest.approx((-1 if name in ODD else 1) * backward, rel=1e-12)


@pytest.mark.parametrize('name', ['cogging', 'friction_ripple', 'gravity'])
def test_ripple_and_gravity_repeat_with_their_period(name):
    position = np.linspace(-1.0, 1.0, 201)
    period = 2 * math.pi / (12.0 if name != 'gravity' else 1.0)
    here = current_of(name, position, np.full(201, 0.5))
    assert current_of(name, position + period, np.full(201, 0.5)) == pytest.approx(here, abs=1e-12)
    assert current_of(name, position + period / 2, np.full(201, 0.5)) == pytest.approx(
        -here, abs=1e-12)


# Effect, other constants than those of `defaults`, places, velocities, and the current in A.
SHAPES = [
    ('stribeck', {'exponent': 1.0}, 0.0, [0.1] * 2,
     [0.1 * math.tanh(5.0) / math.e] * 2),
    ('stribeck', {'exponent': 1.0}, 0.0, [1e-9, 1.0], [0.0, 0.0]),
    # Of u^0.5, 0.8·u belongs to the linear term.
    ('viscous_shape', {'exponent': 0.5}, 0.0, [0.25, 1.0], [0.1 * (0.5 - 0.2), 0.1 * (1.0 - 0.8)]),
    ('bump', {}, [0.3, 0.4, 0.2, 1.3], 1.0, [0.1, *[0.1 * math.exp(-0.5)] * 2, 0.0]),
    ('bump', {}, [0.3, 1.3], -1.0, [-0.1, 0.0]),
    ('bump', {'directional': 0.0}, [0.3, 1.3], -1.0, [0.1, 0.0]),
    ('spring', {}, [0.3, 1.3], 0.0, [0.0, 0.1]),
    ('inertia', {}, 0.0, 0.02 * np.arange(5), [0.2] * 5),
    ('load_torque', {}, 0.0, [0.0, 1.0], [0.15] * 2),
    ('load_friction', {}, 0.0, [1.0] * 2, [0.1 * 1.5 ** 2] * 2)]


@pytest.mark.parametrize(('effect', 'changes', 'place', 'speed', 'expected'), SHAPES)
def test_the_current_is_what_the_docstring_says(effect, changes, place, speed, expected):
    found = EFFECTS[effect](defaults(effect, **changes)).current(samples_of(place, speed))
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-4 if 0.0 in expected else 1e-12)


@pytest.mark.parametrize('effect', ['cogging', 'friction_ripple'])
def test_ripple_grows_with_a_power_of_the_speed(effect):
    slow, fast = current_of(effect, np.full(2, 0.4), [0.25, 0.5], growth=2.0)
    assert fast / slow == pytest.approx(4.0, rel=1e-9)


@pytest.mark.parametrize('exponent', [0.45, 0.75, 1.4, 2.5])
def test_beyond_the_speeds_seen_friction_bends_no_further(exponent):
    seen, far = np.linspace(0.05, 1.0, 200), np.array([1.25, 4.0])
    friction = 0.3 + 0.1 * seen + 0.05 * seen ** 2

    effect = EFFECTS['viscous_shape'](
        {'exponent': exponent, 'reference': 1.0, 'transition': 1e-3, 'coefficients': [1.0]},
        {'velocity': [-1.25, 1.25]})
    columns = [np.column_stack((np.ones_like(speed), speed, effect.current(Samples(
        time=np.arange(len(speed)), position=np.zeros(len(speed)),
        current=np.zeros(len(speed)), velocity=speed)))) for speed in (seen, far)]
    found = np.linalg.lstsq(columns[0], friction, rcond=None)[0]
    alone, slope, (near, beyond) = np.polyfit(seen, friction, 1)[0], found[1], columns[1] @ found
    assert slope == pytest.approx(alone, rel=0.05)
    assert beyond - near == pytest.approx(alone * 2.75, rel=0.05)


def test_temperature_counts_from_its_reference():
    effect = EFFECTS['temperature'](defaults('temperature', coefficients=[-0.01, -0.002, 0.0]))
    for temperature, expected in ((25.0, 0.0), (35.0, -0.12), (15.0, 0.12)):
        current = effect.current(samples_of([0.0, 0.0], [1.0, 1.0], temperature=temperature))
        assert current == pytest.approx([expected] * 2)


@pytest.mark.parametrize('name', ['warm_up', 'offset_drift'])
def test_warm_up_and_drift_fade_with_their_time(name):
    position = np.zeros(1001)
    current = current_of(name, position, np.ones(1001))
    assert current[200] / current[0] == pytest.approx(1 / math.e, rel=1e-9)
    assert abs(current[-1]) < 0.01 * abs(current[0])


def test_friction_grows_with_rest_and_motion_undoes_it():
    def start_after(rest):
        still = round(rest / 0.01)
        position = np.concatenate((np.zeros(still), 0.005 * np.arange(1, 101)))
        velocity = np.concatenate((np.zeros(still), np.full(100, 0.5)))
        return current_of('rest_time', position, velocity, velocity=0.01)[still:]
    short, long = start_after(0.2), start_after(20.0)
    assert 0 < short[0] < 0.2 * long[0]
    assert long[0] == pytest.approx(0.1 * math.exp(-0.1), rel=1e-3)
    assert long[10] / long[0] == pytest.approx(1 / math.e, rel=1e-9)
    assert np.all(np.diff(long) < 0)


def test_hysteresis_depends_on_the_path_and_not_on_time():
    way = np.concatenate((np.linspace(0, 0.2, 41), np.linspace(0.2, 0.15, 41)[1:]))
    speed = np.concatenate((np.full(41, 0.5), np.full(40, -0.125)))
    effect = EFFECTS['hysteresis'](defaults('hysteresis', coefficients=[0.1, 0.0]))
    quick, slow = samples_of(way, speed), samples_of(way, speed, step=0.1)
    assert effect.current(slow) == pytest.approx(effect.current(quick))
    # A gap in the data ends the memory.
    gap = quick.with_(time=quick.time + np.where(np.arange(81) > 60, 5.0, 0.0))
    assert effect.current(gap)[61] == pytest.approx(-0.1 * math.tanh(0.125 / TRANSITION))


@pytest.mark.parametrize(('name', 'key'), [
    (name, key) for name, effect in EFFECTS.items() for key in effect.constants])
def test_a_constant_that_is_not_a_number_is_reported(name, key):
    for value in ('fast', None, True, [1.0], math.nan, math.inf):
        with pytest.raises(InputError, match=key) as caught:
            EFFECTS[name]({**defaults(name), key: value})
        assert '\n' not in str(caught.value)
    left = {k: v for k, v in defaults(name).items() if k != key}
    with pytest.raises(InputError, match=key):
        EFFECTS[name](left)


@pytest.mark.parametrize(('name', 'key'), [
    (name, key) for name, effect in EFFECTS.items() for key in effect.constants
    if key in ('transition', 'velocity', 'reference', 'exponent', 'frequency', 'width', 'distance',
               'time_constant', 'speed')])
@pytest.mark.parametrize('value', [0.0, -0.1])
def test_a_width_or_speed_that_cannot_be_is_named(name, key, value):
    with pytest.raises(InputError, match=f'{key} must be positive'):
        EFFECTS[name]({**defaults(name), key: value})


@pytest.mark.parametrize('name', EFFECTS)
def test_wrong_coefficients_and_unknown_entries_are_reported(name):
    samples = samples_of(np.linspace(0, 1, 20), np.ones(20))
    wrong = [0.1] * (COLUMNS.get(name, 1) + 1)
    with pytest.raises(InputError, match=f"'{name}' takes {len(wrong) - 1} coefficients"):
        EFFECTS[name](defaults(name, coefficients=wrong)).current(samples)
    for value in (0.1, 'abc', {'a': 1}, [math.nan], None):
        with pytest.raises(InputError, match='coefficients'):
            EFFECTS[name](defaults(name, coefficients=value))
    with pytest.raises(InputError, match='unknown'):
        EFFECTS[name](defaults(name, colour=1.0))


@pytest.mark.parametrize('name', EFFECTS)
@given(data=st.data())
def test_any_motion_gives_a_finite_current_linear_in_the_coefficients(name, data):
    parameters = data.draw(parameters_of(name))
    factor = data.draw(st.floats(-3.0, 3.0))
    seed = data.draw(st.integers(0, 1000))
    rng = np.random.default_rng(seed)
    samples = samples_of(
        rng.uniform(-100, 100, 60), rng.choice([0.0, 1e-300, 1e-6, 0.1, 1.0, 50.0], 60)
        * rng.choice([-1, 1], 60), load=float(rng.uniform(-50, 50)),
        temperature=float(rng.uniform(-40, 150)))
    first = EFFECTS[name](parameters)
    other = [float(value) for value in rng.uniform(-1, 1, len(parameters['coefficients']))]
    mixed = [factor * a + b for a, b in zip(parameters['coefficients'], other)]
    second = EFFECTS[name]({**parameters, 'coefficients': other})
    third = EFFECTS[name]({**parameters, 'coefficients': mixed})
    current = first.current(samples)
    assert current.shape == (60,)
    assert np.isfinite(current).all()
    size = 1.0 + np.abs(current).max() + np.abs(second.current(samples)).max()
    assert third.current(samples) == pytest.approx(
        factor * current + second.current(samples), abs=1e-9 * size)


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
        value = term.update(time, float(rng.uniform(-50, 50)),
                            float(rng.choice([0.0, 1e-300, -0.001, 0.5, -30.0])), 60.0, -20.0, 3.0,
                            0.2)
        assert math.isfinite(value)
    place = float(rng.uniform(-2, 2))
    term.update(time, place, 0.0, 60.0, -20.0, 3.0, 0.2)
    here = term.update(time + 0.001, place, 0.0, 60.0, -20.0, 3.0, 0.2)
    if name in HOLDS or (name == 'bump' and not parameters['directional']):
        assert here == term.update(time + 0.002, place, -0.0, 60.0, -20.0, 3.0, 0.2)
    else:
        assert here == 0.0


@pytest.mark.parametrize('name', LIVE)
def test_live_and_offline_are_the_same_in_motion_on_the_same_samples(name):
    """Equal to rounding where both know the whole past, else once the start is forgotten."""
    time = np.arange(0.0, 8.0, 0.005)
    position = 0.8 * np.sin(1.1 * time)
    samples = samples_of(position, np.gradient(position, time), step=0.005)
    # A transition above the sharpest that is fed back, so that both have the same one.
    effect = EFFECTS[name](defaults(name))
    term = LiveTerm(effect)
    live = np.array([term.update(*sample) for sample in zip(
        samples.time, samples.position, samples.velocity, samples.temperature, samples.load,
        samples.rigid_body, samples.coupling)])
    offline = effect.current(samples)
    fast = np.abs(samples.velocity) > 0.1
    if name in ('hysteresis', 'backlash'):
        fast &= samples.time > 1.0
    tolerance = {'hysteresis': 1e-4 * np.abs(offline).max(), 'backlash': 1e-8}.get(name, 1e-12)
    assert np.abs(offline[fast]).max() > 1e-3
    assert live[fast] == pytest.approx(offline[fast], abs=tolerance)
    # A reset clears the history of the motion.
    term.reset()
    again = [term.update(*sample) for sample in zip(
        samples.time[:100] + 8.0, samples.position, samples.velocity, samples.temperature,
        samples.load, samples.rigid_body, samples.coupling)]
    assert again == pytest.approx(live[:100], rel=1e-9, abs=1e-12)


@pytest.fixture(scope='module')
def motion():
    time = np.arange(0.0, 20.0, 0.01)
    position = 0.8 * np.sin(0.7 * time) + 0.1 * np.sin(3.1 * time)
    velocity = np.gradient(position, time)
    return Samples(
        time=time, position=position, velocity=velocity, current=np.zeros_like(time),
        acceleration=np.gradient(velocity, time), load=2.0 * np.sin(1.3 * time),
        temperature=25.0 + 0.5 * time, rigid_body=3.0 * np.cos(position),
        coupling=0.4 * np.sin(position))


@pytest.mark.parametrize('name', EFFECTS)
def test_an_effect_describes_itself_and_says_why_it_is_not_fed_back(name):
    effect = EFFECTS[name](defaults(name))
    assert len(effect.describe()) > 10
    assert effect.formula()
    assert bool(effect.not_fed_back) == (name not in LIVE)


def test_live_signs_are_never_sharper_than_stated():
    sharp = {**defaults('stribeck'), 'transition': 1e-5}
    term = LiveTerm(EFFECTS['stribeck'](sharp))
    assert term.update(0.0, 0.0, 0.1 * SHARPEST_LIVE) < 0.2 * sharp['coefficients'][0]


def test_lag_moves_the_whole_prediction_in_time(motion):
    sigmoid = Sigmoid(upper=0.2, lower=-0.2, steepness=50.0, viscous=0.1)
    effects = [EFFECTS['gravity']({'coefficients': [0.3, 0.1]})]
    settings = {'source': 'velocity', 'bandwidth': None}
    late, plain = (
        FrictionModel(Drive(0.1, 100.0), sigmoid, effects=effects,
                      differentiation={**settings, **lag}).predict(motion)
        for lag in ({'lag': 0.02}, {}))
    np.testing.assert_allclose(late[:-2], plain[2:], atol=1e-9)


@pytest.mark.parametrize(('exponent', 'left'), [
    (0.5, (math.sqrt(2) - 0.5) ** 2), (1.0, 2 / math.e), (2.0, 1 / 1.5)])
def test_hysteresis_reverses_as_its_exponent_says(exponent, left):
    # The solution of du/dx = -u^p for u = 1 - z, which is 2 at the reversal, at x = 1.
    c = Hysteresis.Constants(0.05, exponent, 0.02)

    def turned(state, step):
        return Hysteresis.step(state, 0.0, step, 0.0, c)
    assert 1.0 - turned(-1.0, 0.05) == pytest.approx(left)
    halves = turned(turned(-1.0, 0.02), 0.03)
    assert halves == pytest.approx(turned(-1.0, 0.05))
    assert turned(0.3, 0.0) == 0.3
    assert turned(0.3, -1e3) == pytest.approx(-1.0, abs=1e-3)


def test_behind_a_backlash_friction_returns_after_the_gap_however_finely_it_is_sampled():
    c = Backlash.Constants(0.02, 0.005, 0.02)

    def friction(state):
        return Backlash.columns(Signals(memory=state), c)[0]

    def after(way, steps):
        state = Backlash.start(-1.0, c)
        for _ in range(steps):
            state = Backlash.step(state, 0.0, way / steps, 0.0, c)
        return friction(state)
    for steps in (1, 7):
        assert [after(way, steps) for way in (0.0, 2.5e-3, 5e-3, 0.025, 0.0275, 0.03, 0.5)] == (
            pytest.approx([-1.0, -0.5, 0.0, 0.0, 0.5, 1.0, 1.0]))


def test_damping_of_the_bristles_is_the_change_of_their_state():
    time = np.arange(0.0, 4.0, 0.001)
    position = 0.5 * np.sin(2.0 * time)
    samples = Samples(time=time, position=position, velocity=np.cos(2.0 * time),
                      current=np.zeros_like(time))
    kind, still = EFFECTS['hysteresis'], {'distance': 0.1, 'exponent': 1.3, 'transition': 1e-4}
    state = kind({**still, 'coefficients': [1.0, 0.0]}).current(samples)
    change = kind({**still, 'coefficients': [0.0, 1.0]}).current(samples)
    inner = np.abs(samples.velocity) > 0.05
    assert change[inner] == pytest.approx(np.gradient(state, time)[inner], abs=0.05)


def test_effects_without_their_signal_say_so(motion):
    bare = motion.with_(temperature=None, load=None)
    with pytest.raises(InputError, match='temperature'):
        EFFECTS['temperature'](defaults('temperature')).current(bare)
    with pytest.raises(InputError, match='load'):
        EFFECTS['load_torque'](defaults('load_torque')).current(bare)
