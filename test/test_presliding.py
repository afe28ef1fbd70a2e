# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What reversals of a recording show of presliding; of ramps see `test_bench_worlds.py`."""

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

from friction_comp import Drive, FrictionModel, refine, Samples
from friction_comp.compensation.law_parameters import knows_presliding
from friction_comp.model.model_file import Presliding
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement.reversals import friction_at_rest

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
