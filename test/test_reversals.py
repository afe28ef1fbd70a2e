# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What reversals of a recording show of presliding, and what the law makes of it."""

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

from friction_comp import Drive, FrictionModel, refine, Samples
from friction_comp.compensation.law_parameters import knows_presliding
from friction_comp.model.measured import Presliding
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement.reversals import friction_at_rest

RATE = 500.0
DRIVE = Drive(0.1, 100.0, 4096)
# Levels in A of Maxwell elements, and how far each yields, rad.
LEVELS, YIELDS = np.array([0.3, 0.2, 0.1]), np.array([2e-4, 4e-4, 6e-4])
# Where their first curve reaches 0.975 of 0.6 A, in the second and last elements' part.
LEVEL = 0.6
DISTANCE = 6e-4 * (0.585 - 0.5) / 0.1
SLIDING = Sigmoid(0.6, -0.6, 50.0, viscous=0.2)


def turning(frequencies=(0.1, 0.2, 0.15), amplitude=0.2, offset=0.0):
    """Return samples of sines under friction of Maxwell elements, viscous friction and inertia."""
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
    current = (friction + 0.2 * velocity + 0.05 * np.gradient(velocity, time) + offset
               + np.random.default_rng(3).normal(0.0, 0.01, len(time)))
    return Samples(time=time, position=position, current=current)


def without_inertia(samples):
    """Return samples less the current of `turning`'s inertia."""
    acceleration = np.gradient(np.gradient(samples.position, samples.time), samples.time)
    return samples.with_(current=samples.current - 0.05 * acceleration)


@settings(max_examples=10, deadline=None)
@given(offset=st.floats(-0.2, 0.2), amplitude=st.floats(0.08, 0.4))
def test_half_the_way_of_a_reversal_is_presliding(offset, amplitude):
    samples = without_inertia(turning(offset=offset, amplitude=amplitude))
    known, breakaway, why = friction_at_rest(samples, FrictionModel(DRIVE, SLIDING), 1e-5)
    assert not why
    assert known.distance == pytest.approx(DISTANCE, rel=0.2)
    assert breakaway.positive_mean == pytest.approx(offset + LEVEL, abs=0.03)
    assert breakaway.negative_mean == pytest.approx(offset - LEVEL, abs=0.03)
    # Contacts without memory yield less than half of it: the uncertainty says so.
    assert 0.15 * known.distance < known.std < 0.4 * known.distance


def test_breakaway_that_varies_is_not_known():
    samples = without_inertia(turning())
    weak = 1.0 + 0.5 * np.sin(0.9 * samples.time)
    samples = samples.with_(current=samples.current * weak)
    assert friction_at_rest(samples, FrictionModel(DRIVE, SLIDING), 1e-5)[:2] == (None, None)


def test_breakaway_shows_where_presliding_does_not():
    samples = _coarse(without_inertia(turning()))
    known, breakaway, _ = friction_at_rest(samples, FrictionModel(DRIVE, SLIDING), 1e-3)
    assert known is None
    assert breakaway.positive_mean == pytest.approx(LEVEL, rel=0.05)


def test_a_refined_model_lets_the_law_know_presliding_which_stays_as_an_initial_one_has_it():
    samples = turning((0.2, 0.3, 0.25))
    model = refine([samples], drive=DRIVE).model
    assert model.presliding.distance == pytest.approx(DISTANCE, rel=0.25)
    assert knows_presliding(FrictionModel.from_dict(model.to_dict()))
    known = Presliding(2e-4, std=1e-5)
    model = FrictionModel(DRIVE, SLIDING, presliding=known)
    assert refine([samples], model=model).model.presliding == known


def _few(samples):
    return samples.take(slice(0, int(12.0 * RATE)))


def _coarse(samples):
    return samples.with_(position=1e-3 * np.round(samples.position / 1e-3))


def _late_when_fast(samples):
    late = np.interp(samples.time - 0.1, samples.time, samples.current)
    return samples.with_(current=np.where(samples.time > 0.5 * samples.time[-1], late,
                                          samples.current))


def _sparse(samples):
    return samples.take(slice(None, None, 50))


def _noisy(samples):
    noise = np.random.default_rng(4).normal(0.0, 0.6, len(samples))
    return samples.with_(current=samples.current + noise)


@pytest.mark.parametrize('spoil, words', [
    (_few, 'too few reversals'), (_coarse, 'steps of the position'),
    (_late_when_fast, 'not the same'), (_sparse, 'too few reversals'), (_noisy, 'not the same')])
def test_presliding_that_reversals_do_not_show_is_not_known(spoil, words):
    samples = spoil(without_inertia(turning((0.1, 0.1, 0.4, 0.4))))
    count = 1e-3 if spoil is _coarse else 1e-5
    known, _, why = friction_at_rest(samples, FrictionModel(DRIVE, SLIDING), count)
    assert known is None
    assert words in why


def test_the_report_says_why_presliding_is_not_known():
    result = refine([_coarse(turning((0.2, 0.3, 0.25)))], drive=DRIVE)
    assert result.model.presliding is None
    note, = (one for one in result.report.findings if 'presliding' in one.text)
    assert 'steps of the position' in note.text
    assert result.report.friction.presliding is None
