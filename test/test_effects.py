# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The effects: formulas, memory and limits, effects of others, and those of simulated joints."""

import math

from effect_maker import defaults, parameters_of, samples_of
from helpers import swings
from hypothesis import given, strategies as st
import numpy as np
import pytest

from friction_comp.compensation.law import CompensationLaw
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effect import Coverage, Effect, LiveTerm, SearchRange, Signals
from friction_comp.model.effects import Backlash, EFFECTS, Hysteresis, register
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import refine
from friction_comp.samples import Samples
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.undeclared import Undeclared, undeclared_torque
from friction_comp.statistics import rms

# Each effect obeys its docstring, and properties that all effects share for any numbers.

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


# An effect that exists only in this file is found, stored, predicted, fed back and shown.

GAIN, REFERENCE = 0.06, 0.35


class TightEnd(Effect):
    """``A·v·exp(q/q_r)``: viscous friction of a joint that gets tighter along its stroke."""

    name = 'tight_end'
    variable = 'position'
    signs = (1,)
    constants = {'reach': SearchRange(1.6)}

    @staticmethod
    def columns(x, c):
        return (x.velocity * np.exp(x.position / c.reach),)

    @classmethod
    def grid(cls, coverage):
        return [{'reach': share * coverage.span} for share in (0.1, 0.2, 0.4, 0.8)]

    def describe(self):
        return 'The joint gets tighter along its stroke'


@pytest.fixture
def own_effect():
    register(TightEnd)
    yield TightEnd
    del EFFECTS[TightEnd.name]


def recording(seed):
    """A joint whose friction grows as it gets tighter."""
    samples = swings(seed, 60.0, 0.01, (0.11, 0.23, 0.37, 0.71), size=0.045, coulomb=0.1,
                     viscous=0.05, width=0.02, noise=0.002)
    return samples.with_(acceleration=None, current=(
        samples.current + GAIN * samples.velocity * np.exp(samples.position / REFERENCE)))


@pytest.mark.slow
def test_an_effect_that_exists_only_here(own_effect, tmp_path):
    result = refine([recording(1)])
    found = result.report.effects[0]
    assert found.name == 'tight_end'
    assert found.in_words.lower().startswith('the joint gets tighter along its stroke')
    assert found.parameters['reach'] == pytest.approx(REFERENCE, rel=0.1)
    assert found.parameters['coefficients'][0] == pytest.approx(GAIN, rel=0.1)

    result.model.save(tmp_path / 'model.yaml')
    model = FrictionModel.load(tmp_path / 'model.yaml')
    fresh = recording(2)
    moving = np.abs(fresh.velocity) > 0.05
    error = (fresh.current - model.predict(fresh))[moving]
    assert rms(error) < 1.3 * 0.002

    tight, loose = (
        CompensationLaw([model], law='kinetic').update(0.0, [position], [0.5], [0])[0]
        for position in (0.4, -0.4))
    expected = GAIN * 0.5 * (np.exp(0.4 / REFERENCE) - np.exp(-0.4 / REFERENCE))
    assert tight - loose == pytest.approx(expected, rel=0.1)


# Each undeclared effect does to the simulated joint what its file says, and nothing else.

STATE = {'t': 5.0, 'x': 0.4, 'v': -0.5, 'load': -2.0, 'temperature': 30.0, 'rest_time': 0.0,
         'base_level': 1.2}
# Parameters, and what the effect adds in this state to the driving torque and to friction, N·m.
ADDED = {
    'offset': ({'torque': 0.4}, -0.4, 0.0),
    'gravity': ({'amplitude': 0.6, 'phase': 0.5}, -0.6 * math.sin(0.9), 0.0),
    'cogging': ({'amplitude': 0.3, 'frequency': 12.0, 'slope': -0.5},
                -0.3 * 0.75 * math.sin(4.8), 0.0),
    'stribeck': ({'amplitude': 0.5, 'velocity': 0.4}, 0.0, 0.5 * math.exp(-1.25)),
    'viscous_shape': ({'amplitude': 0.5, 'exponent': 0.5}, 0.0, 0.5 * math.sqrt(0.5)),
    'direction': ({'coulomb': 0.2, 'viscous': 0.3}, 0.0, -0.35),
    'friction_ripple': ({'amplitude': 0.3, 'frequency': 12.0, 'phase': 1.0}, 0.0,
                        0.3 * math.sin(5.8)),
    'bump': ({'amplitude': 0.6, 'position': 0.2, 'width': 0.3}, 0.0, 0.6 * math.exp(-2.0 / 9.0)),
    'load': ({'coefficient': 0.3}, 0.0, 0.6),
    'temperature': ({'coefficient': -0.02, 'reference': 20.0}, 0.0, -0.24),
    'warm_up': ({'share': 0.4, 'time_constant': 10.0}, 0.0, 0.48 * math.exp(-0.5))}


@pytest.mark.parametrize('name', ADDED)
def test_an_undeclared_effect_adds_what_its_formula_says(name):
    parameters, torque, level = ADDED[name]
    extra = Undeclared.from_effects([{'name': name, 'parameters': parameters}])
    assert undeclared_torque(extra.table, np.zeros(0), **STATE) == pytest.approx((torque, level))


# A drive of 1 N·m/A with friction of 1 N·m + 0.4 N·m·s/rad, without noise.
PLAIN = FrictionModel(Drive(0.01, 100.0, current_limit=5.0), Sigmoid(1.0, -1.0, 300.0, viscous=0.4),
                      simulation={'current_noise': 0.0})


def test_stiction_grows_with_rest_and_is_lost_by_sliding():
    effect = {'name': 'rest', 'parameters': {'share': 0.5, 'time_constant': 1.0, 'distance': 0.1}}

    def breakaway(rest):
        plant = Plant([PLAIN], undeclared=[Undeclared.from_effects([effect])])
        for _ in range(round(rest / 1e-3)):
            plant.step([0.0])
        for k in range(2000):
            if plant.step([0.9 + k * 1e-3]).position[0] > 1e-3:
                return 0.9 + k * 1e-3
        raise AssertionError('never started')

    short, long = breakaway(0.01), breakaway(5.0)
    # A plant starts as a joint that has rested for 1 s; the ramp of 1 A/s then meets the level
    # that grows meanwhile at 1.39 A, and after a long rest at 1.5 A.
    assert short == pytest.approx(1.39, abs=0.06)
    assert long == pytest.approx(1.5, abs=0.06)


def test_friction_behind_a_backlash_is_absent_across_the_gap_after_a_reversal():
    effect = {'name': 'backlash', 'parameters': {'torque': 0.5, 'gap': 0.02, 'stiffness': 100.0}}
    extra = Undeclared.from_effects([effect])
    memory = np.zeros(extra.memory_size)

    def torque(x):
        return -undeclared_torque(extra.table, memory, 0.0, x, 1.0, 0.0, 25.0, 0.0, 1.0)[0]
    # It starts in the middle; 0.5 N·m at 100 N·m/rad are another 5 mrad.
    assert [torque(x) for x in (0.0, 0.009, 0.0125, 0.015, 0.3)] == pytest.approx(
        [0.0, 0.0, 0.25, 0.5, 0.5])
    # Back: released over 5 mrad, nothing over 20, taken up over 5 again.
    assert [torque(x) for x in (0.2975, 0.295, 0.275, 0.2725, 0.27, 0.1)] == pytest.approx(
        [0.25, 0.0, 0.0, -0.25, -0.5, -0.5])


def test_friction_never_turns_into_drive():
    effect = [{'name': 'direction', 'parameters': {'coulomb': -50.0}}]
    plant = Plant([PLAIN], undeclared=[Undeclared.from_effects(effect)])
    for _ in range(300):
        plant.step([0.2])
    moving = plant.state.velocity[0]
    for _ in range(3000):
        plant.step([0.0])
    assert moving > 0.01
    assert abs(plant.state.velocity[0]) < 1e-9


OWN = '{format: friction_comp_undeclared, version: 1, '


@pytest.mark.parametrize(('text', 'reason'), [
    ('', 'not a file of undeclared effects'), ('[', 'not a YAML document'),
    ('format: friction_comp_undeclared\nversion: 2', 'version 2'),
    (OWN + 'effects: 3}', 'not a list'), (OWN + 'effect: []}', 'unknown entries: effect;'),
    (OWN + 'thermal: {time_constant: 0}}', 'time_constant'),
    *((f'{OWN}effects: [{{name: {effect}}}]}}', reason) for effect, reason in (
        ('magic', "'magic'"), ('[magic]', 'magic'), ('offset', 'needs torque'),
        ('offset, parameters: {torque: .nan}', 'torque must be a finite number'),
        ('offset, parameters: {torque: 1, size: 2}', 'unknown entries: size;')))])
def test_a_file_that_cannot_be_used_says_why(tmp_path, text, reason):
    path = tmp_path / 'hidden.yaml'
    path.write_text(text)
    with pytest.raises(InputError) as error:
        Undeclared.from_file(path)
    assert str(error.value).startswith(str(path))
    assert reason in str(error.value)
    assert '\n' not in str(error.value)
