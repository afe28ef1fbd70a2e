# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction, offset, inertia and presliding are those of the drive, as their intervals.

Presliding from reversals of a recording; from ramps see `test_bench_worlds.py`.
"""

from dataclasses import replace
import re

from effect_maker import defaults
from helpers import sines
from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

from friction_comp.compensation.law_parameters import knows_presliding
from friction_comp.drive import Drive
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.friction_numbers import friction_of, line_of
from friction_comp.model.model_file import Breakaway, Presliding, Recorded
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import refine
from friction_comp.refinement.reversals import friction_at_rest
from friction_comp.reports.refinement_page import friction_rows
from friction_comp.samples import Samples
from friction_comp.tools.export import simulator_joint

TRUTH = {'coulomb': 0.5, 'viscous': 0.15, 'offset': 0.04, 'inertia': 0.023}
PLAIN = FrictionModel(Drive(1.0, 1.0), Sigmoid(0.54, -0.46, 40.0, viscous=0.15))


def recording(seed=1, extra=lambda v, q: 0.0, step=0.005, seconds=40.0):
    """Give a joint with sudden friction that follows a sum of sines."""
    time = np.arange(0.0, seconds, step)
    q, v, a = sines(time, ((0.9, 2 * np.pi * 0.31, 0.0), (0.5, 2 * np.pi * 0.83, 0.0)))
    torque = (TRUTH['offset'] + TRUTH['coulomb'] * np.sign(v) + TRUTH['viscous'] * v
              + TRUTH['inertia'] * a + extra(v, q))
    noise = np.random.default_rng(seed).standard_normal((2, len(time)))
    return Samples(time=time, position=q + 2e-5 * noise[0], current=torque + 0.02 * noise[1])


@pytest.fixture(scope='module')
def refined():
    return refine([recording()])


def test_the_numbers_are_those_of_the_drive_and_their_intervals_hold_them(refined):
    friction = refined.report.friction
    for name, value in TRUTH.items():
        low, high = friction.intervals[name]
        assert low <= value <= high, name
        assert high - low < 0.06
        assert getattr(friction, name) == pytest.approx(value, rel=0.03, abs=0.01)
    assert friction.torque_per_current == 1.0
    assert friction.breakaway is None
    assert friction.coulomb_with_load is None
    # A torque from another unit stands beside it, but a force in N is none.
    for unit, stands in (('A', True), ('N·m', False), ('N', False)):
        assert any('N·m' in row.remark for row in friction_rows(
            replace(friction, unit=unit))) == stands
    # Without an effect and without a model given, there are intervals as well.
    assert refined.model.recorded.speeds[-1] == pytest.approx(4.0, rel=0.1)


# Not those of `effect_maker`, of which many are equal.
OWN = {
    'viscous_shape': {'exponent': 0.5, 'reference': 2.0}, 'direction_asymmetry': {'offset': 0.0},
    'cogging': {'growth': 1.0, 'speed': 1.5}, 'friction_ripple': {'frequency': 24.3},
    'bump': {'position': -0.2, 'exponent': 3.0}, 'load_friction': {'exponent': 1.2},
    'inner_load_friction': {'inertia': 0.02, 'with_inertia': 1.0, 'exponent': 1.0, 'fading': 1.0},
    'hysteresis': {'distance': 0.02}, 'backlash': {'gap': 0.01, 'distance': 0.02},
    'warm_up': {'time_constant': 10.0}, 'offset_drift': {'time_constant': 10.0},
    'rest_time': {'velocity': 0.2}}


def every_effect():
    """Return each effect with different coefficients; some hold in one recording alone."""
    found, rng = [], np.random.default_rng(1)
    for name, kind in EFFECTS.items():
        values = defaults(name, **OWN.get(name, {}))
        if 'transition' in values:
            values['transition'] = 0.05
        size = len(values.pop('coefficients'))
        found.append(kind({**values, 'coefficients': rng.uniform(0.05, 0.5, size).tolist()}))
    return found


def evaluated(formula, samples, model):
    """Evaluate a printed formula at the rows of samples, shape (N,)."""
    text = formula.partition(' = ')[2].partition('   [')[0]
    states = {name: next(one for one in model.effects if one.name == name)
              for name in ('hysteresis', 'backlash', 'rest_time')}
    velocity = samples.velocity
    sign = np.tanh(velocity / 0.05)
    memory = {name: kind.memory(samples, sign, kind.Constants(**kind.values))
              for name, kind in states.items()}
    rate = velocity * np.maximum(1.0 - memory['hysteresis'] * np.sign(velocity), 0.0) / 0.02
    gap = np.abs(memory['backlash']) - 0.005
    names = {'dv_dt': samples.acceleration, 'dz_dt': rate, 'z': memory['hysteresis'],
             'b': np.sign(memory['backlash']) * np.maximum(gap, 0.0) / 0.02,
             'r': memory['rest_time'], 'v': velocity, 'q': samples.position, 'T':
             samples.temperature, 'tau_b': samples.load, 'tau_links': samples.rigid_body,
             'i_other_joints': samples.coupling}
    for written, read in (('dv/dt', 'dv_dt'), ('dz/dt', 'dz_dt'), ('·', '*'), ('^', '**'),
                          ('τ', 'tau')):
        text = text.replace(written, read)
    text = re.sub(r'\|([^|]*)\|', r'abs(\1)', text)
    return eval(text, {'tanh': np.tanh, 'exp': np.exp, 'cos': np.cos, 'sin': np.sin}, names)


def motion_with_all_signals():
    time = np.arange(0.0, 20.0, 0.01)
    q, v, a = sines(time, ((0.9, 2 * np.pi * 0.31, 0.0), (0.5, 2 * np.pi * 0.83, 0.0)))
    return Samples(time=time, position=q, velocity=v, acceleration=a, current=0.0 * time,
                   load=3.0 * np.sin(0.7 * time), temperature=25.0 + time, coupling=np.cos(time),
                   rigid_body=2.0 * np.cos(q))


def test_the_printed_formula_at_the_recorded_rows_is_predict(monkeypatch):
    """For every effect; what the formula leaves out is named with its size."""
    samples, whole = motion_with_all_signals(), replace(
        PLAIN, sigmoid=replace(PLAIN.sigmoid, shift=0.01), effects=every_effect())
    monkeypatch.setattr(FrictionModel, 'differentiated', lambda self, recorded: recorded)
    names = [effect.name for effect in whole.effects]
    for kept in ([], *([name] for name in names), names):
        model = replace(whole, effects=[one for one in whole.effects if one.name in kept])
        model = replace(model, recorded=Recorded().with_ranges(samples, model.effects))
        numbers, predicted = friction_of(model), model.predict(samples)
        found = evaluated(numbers.formula, samples, whole)
        assert np.abs(found - predicted).max() < 1e-3 * np.abs(predicted).max(), kept
        left_out = model.predict(samples, same_recording=True) - predicted
        sizes = [one.size for one in numbers.left_out]
        assert bool(sizes) == bool(np.any(left_out))
        if len(sizes) == 1:
            assert sizes[0] == pytest.approx(np.sqrt(np.mean(left_out ** 2)), rel=0.1)


def test_friction_by_load_stands_once_and_beside_coulomb_friction():
    """A joint within 1 rad of the horizontal that carries 40 N·m, with friction by that load."""
    weight = EFFECTS['gravity']({'coefficients': [40.0, 0.0]})
    by_load = EFFECTS['inner_load_friction']({
        **dict.fromkeys(('sine', 'slope', 'offset', 'inertia', 'with_inertia', 'fading'), 0.0),
        'cosine': 40.0, 'exponent': 1.0, 'velocity': 1.0, 'transition': 0.01,
        'coefficients': [0.12]})
    time = np.arange(0.0, 40.0, 0.01)
    q, v, a = sines(time, ((0.8, 1.3, 0.0), (0.2, 4.1, 0.0)))
    samples = Samples(time=time, position=q, velocity=v, acceleration=a, current=0.0 * time)
    effects = [weight, by_load]
    model = replace(PLAIN, sigmoid=Sigmoid(1.2, -1.2, 200.0, viscous=0.9), effects=effects,
                    recorded=Recorded().with_ranges(samples, effects))
    numbers, joint = friction_of(model), simulator_joint(model, 'mujoco')
    truth = 1.2 + 0.12 * 40.0 * np.mean(np.cos(q))
    assert numbers.coulomb == joint.coulomb == pytest.approx(1.2)
    assert numbers.coulomb_with_load == pytest.approx(truth, rel=0.02)
    assert numbers.formula.count('0.12·') == 1
    assert 'without load' in friction_rows(numbers)[0].remark
    assert any('inner load friction' in line for line in joint.left_out)
    assert any(f'{numbers.coulomb_with_load:.4g} N·m' in line for line in joint.left_out)
    # What a file of an earlier version does not hold, is not said.
    assert {one.name: one.size for one in friction_of(replace(model, recorded=None, effects=[
        EFFECTS['load_friction']({'exponent': 1.0, 'transition': 0.01, 'coefficients': [0.1]})
    ])).beside} == {'load_friction': None}


def test_breakaway_that_holds_a_weight_is_no_friction():
    held = replace(PLAIN, breakaway=Breakaway(4.69, -1.19, 0.1, 0.1))
    numbers = friction_of(held)
    row = friction_rows(numbers)[3]
    assert row.name == 'breakaway'
    assert row.value == '2.94 N·m'
    assert numbers.breakaway['friction'] + numbers.breakaway['held'] == pytest.approx(4.69)
    assert simulator_joint(held, 'isaac').static == pytest.approx(2.94)


def test_friction_that_the_sigmoid_lacks_is_part_of_coulomb_friction():
    """A refined model may leave Coulomb friction of the sigmoid near zero to a hysteresis."""
    hysteresis = EFFECTS['hysteresis']({
        'distance': 1e-3, 'exponent': 1.0, 'transition': 0.03, 'coefficients': [0.5, 0.0]})
    moved = replace(PLAIN, sigmoid=replace(PLAIN.sigmoid, upper=0.04, lower=0.04),
                    effects=[hysteresis])
    assert line_of(moved) == pytest.approx(line_of(PLAIN), rel=1e-6)
    stribeck = EFFECTS['stribeck']({
        'velocity': 0.1, 'exponent': 2.0, 'transition': 0.03, 'coefficients': [0.3]})
    assert line_of(replace(PLAIN, effects=[stribeck])) == line_of(PLAIN)
    asymmetry = EFFECTS['direction_asymmetry']({
        'offset': 0.0, 'transition': 0.03, 'coefficients': [0.1, 0.0]})
    assert line_of(replace(PLAIN, effects=[asymmetry]))['offset'] == pytest.approx(0.14)


# What reversals of a recording show of presliding.

RATE = 500.0
# Levels in A of Maxwell elements, and how far each yields, rad.
LEVELS, YIELDS = np.array([0.3, 0.2, 0.1]), np.array([2e-4, 4e-4, 6e-4])
# Where their first curve reaches 0.975 of 0.6 A, in the second and last elements' part.
LEVEL = 0.6
DISTANCE = 6e-4 * (0.585 - 0.5) / 0.1
MODEL = FrictionModel(Drive(0.1, 100.0, 4096), Sigmoid(0.6, -0.6, 50.0, viscous=0.2))


def turning(frequencies=(0.1, 0.2, 0.15), amplitude=0.2, offset=0.0, inertia=0.0):
    """Return samples of sines under friction of Maxwell elements and viscous friction."""
    position = np.concatenate([
        amplitude * np.cos(2.0 * np.pi * frequency * np.arange(0.0, 3.0 / frequency, 1.0 / RATE))
        for frequency in frequencies])
    time = np.arange(len(position)) / RATE
    velocity, friction = np.gradient(position, time), np.zeros_like(time)
    for level, most in zip(LEVELS.tolist(), YIELDS.tolist()):
        stretched = -most
        for k, step in enumerate(np.diff(position, prepend=position[0]).tolist()):
            stretched = min(max(stretched + step, -most), most)
            friction[k] += level * stretched / most
    current = (friction + 0.2 * velocity + inertia * np.gradient(velocity, time) + offset
               + np.random.default_rng(3).normal(0.0, 0.01, len(time)))
    return Samples(time=time, position=position, current=current)


@settings(max_examples=10, deadline=None)
@given(offset=st.floats(-0.2, 0.2), amplitude=st.floats(0.08, 0.4))
def test_half_the_way_of_a_reversal_is_presliding(offset, amplitude):
    known, breakaway, why = friction_at_rest(
        turning(offset=offset, amplitude=amplitude), MODEL, 1e-5)
    assert not why
    assert known.distance == pytest.approx(DISTANCE, rel=0.2)
    assert breakaway.positive_mean == pytest.approx(offset + LEVEL, abs=0.03)
    assert breakaway.negative_mean == pytest.approx(offset - LEVEL, abs=0.03)
    # Contacts without memory yield less than half of it: the uncertainty says so.
    assert 0.15 * known.distance < known.std < 0.4 * known.distance


def coarse(samples):
    return samples.with_(position=1e-3 * np.round(samples.position / 1e-3))


def late_when_fast(samples):
    late = np.interp(samples.time - 0.1, samples.time, samples.current)
    return samples.with_(current=np.where(samples.time > 0.5 * samples.time[-1], late,
                                          samples.current))


def weak_at_times(samples):
    return samples.with_(current=samples.current * (1.0 + 0.5 * np.sin(0.9 * samples.time)))


def noisy(samples):
    noise = np.random.default_rng(4).normal(0.0, 0.6, len(samples))
    return samples.with_(current=samples.current + noise)


@pytest.mark.parametrize('spoil, words', [
    (lambda samples: samples.take(slice(0, int(12.0 * RATE))), 'too few reversals'),
    (coarse, 'steps of the position'), (late_when_fast, 'not the same'),
    (lambda samples: samples.take(slice(None, None, 50)), 'too few reversals'),
    (noisy, 'not the same'), (weak_at_times, '')])
def test_presliding_that_reversals_do_not_show_is_not_known(spoil, words):
    known, breakaway, why = friction_at_rest(
        spoil(turning((0.1, 0.1, 0.4, 0.4))), MODEL, 1e-3 if spoil is coarse else 1e-5)
    assert known is None
    assert words in why
    # Breakaway shows where presliding does not, unless it varies.
    if spoil is coarse:
        assert breakaway.positive_mean == pytest.approx(LEVEL, rel=0.05)
    if spoil is weak_at_times:
        assert breakaway is None


def test_a_refined_model_lets_the_law_know_presliding_which_stays_as_an_initial_one_has_it():
    samples = turning((0.2, 0.3, 0.25), inertia=0.05)
    model = refine([samples], drive=MODEL.drive).model
    assert model.presliding.distance == pytest.approx(DISTANCE, rel=0.25)
    assert knows_presliding(FrictionModel.from_dict(model.to_dict()))
    known = Presliding(2e-4, std=1e-5)
    model = FrictionModel(MODEL.drive, MODEL.sigmoid, presliding=known)
    assert refine([samples], model=model).model.presliding == known
    # Where it is not known, the report says why.
    result = refine([coarse(samples)], drive=MODEL.drive)
    assert result.model.presliding is result.report.friction.presliding is None
    note, = (one for one in result.report.findings if 'presliding' in one.text)
    assert 'steps of the position' in note.text
