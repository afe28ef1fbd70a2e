# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An effect that exists only in this file is found, stored, predicted, fed back and shown."""

from helpers import sines
import numpy as np
import pytest

from friction_comp import CompensationLaw, FrictionModel, refine, Samples
from friction_comp.model.effects import Effect, EFFECTS, register, SearchRange
from friction_comp.statistics import rms

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


def recording(seed, duration=60.0, step=0.01):
    """A joint under a sum of sines; what drives it is friction, and what gets tighter."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, step)
    position, velocity, _ = sines(time, (
        (0.3 / (1.0 + 2.0 * frequency), 2.0 * np.pi * frequency, rng.uniform(0.0, 2.0 * np.pi))
        for frequency in (0.11, 0.23, 0.37, 0.71)))
    current = (0.1 * np.tanh(velocity / 0.02) + 0.05 * velocity
               + GAIN * velocity * np.exp(position / REFERENCE))
    return Samples(time=time, position=position, velocity=velocity,
                   current=current + 0.002 * rng.standard_normal(time.size))


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
