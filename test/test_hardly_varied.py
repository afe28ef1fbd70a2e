# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What hardly varied in a recording is said, and a model is not used beyond it without a word."""

from helpers import sines
import numpy as np
import pytest

from friction_comp.model.measured import Recorded, signals_read
from friction_comp.refinement import refine
from friction_comp.samples import JointStates, Samples
from friction_comp.statistics import rms
from friction_comp.tools.predict import compared

SLOW, FAST = ((0.9, 0.6, 0.3), (0.3, 1.5, 1.0)), ((0.12, 6.0, 0.3), (0.03, 15.0, 1.0))


def recording(seed, load=None, carried=0.0, waves=SLOW):
    """Give a joint with friction, a part of which grows with the load, as its sensor tells it."""
    time = np.arange(0.0, 40.0, 0.005)
    q, v, a = sines(time, waves)
    noise = np.random.default_rng(seed).standard_normal((3, len(time)))
    torque = 0.5 * np.tanh(v / 0.01) + 0.2 * v + 0.03 * a + 0.02 * noise[1]
    samples = Samples(time=time, position=q + 2e-5 * noise[0], current=torque)
    if load is None:
        return samples
    weight = load[0] + load[1] * np.sin(0.3 * time + seed)
    return samples.with_(current=torque - weight + carried * abs(weight) * np.tanh(v / 0.01),
                         load=weight + 0.01 * noise[2])


def notes_on(model, samples):
    """Return the error in motion over the expected one, and the notes of `predict`."""
    errors, notes = compared(model, samples, model.measured(samples), model.predict(samples))
    return float(errors[0].split()[0]) / model.recorded.error, ' '.join(notes)


@pytest.mark.parametrize('load', [(2.0, 0.0), (2.0, 0.05)])
def test_a_model_of_one_load_is_said_to_hold_for_this_load(load):
    found = refine([recording(2, load)])
    assert found.report.verdict == 'trust in part'
    one, = (one for one in found.report.findings if 'hardly varied' in one.text)
    assert '1.9' in one.text
    # What mechanics says of another load is taken from that in the offset: it was 100 times off.
    ratio, notes = notes_on(found.model, recording(3, (0.3, 0.3)))
    assert ratio < 1.5
    assert 'beyond the load' in notes
    # What was fitted is measured alike.
    again = recording(2, load)
    assert rms(found.model.measured(again) - found.model.predict(again)) < 0.04
    # Friction by load is part of Coulomb friction, and said to be unknown.
    found = refine([recording(4, load, 0.1)])
    assert any('hardly varied' in one.text for one in found.report.findings)
    ratio, notes = notes_on(found.model, recording(5, (0.3, 0.3), 0.1))
    assert ratio > 3.0
    assert 'beyond the load' in notes
    assert 'that refine expected' in notes


@pytest.mark.parametrize('load', [(0.0, 1.0), (1.0, 1.0), (0.003, 0.0)])
def test_loads_that_vary_or_are_none_are_not_said(load):
    found = refine([recording(6, load)])
    assert not any('hardly varied' in one.text for one in found.report.findings)
    ratio, notes = notes_on(found.model, recording(7, load))
    assert ratio < 1.2
    assert not notes


def test_accelerations_beyond_the_recorded_are_said():
    model = refine([recording(8)]).model
    assert notes_on(model, recording(9))[1] == ''
    assert 'beyond the acceleration' in notes_on(model, recording(9, waves=FAST))[1]


def test_a_temperature_and_other_joints_count_even_if_nothing_depends_on_them():
    samples = recording(1)
    ones = np.ones(len(samples))
    samples = samples.with_(
        velocity=samples.position, temperature=30.0 * ones, joint='a', arm=JointStates(
            ('a', 'b'), np.column_stack((samples.position, 0.5 * ones))))
    known = Recorded().with_ranges(samples, [])
    assert set(signals_read(samples, [])) == {'speed', 'temperature', 'position of b'}
    assert not known.beyond(samples.with_(temperature=31.5 * ones), [])
    note, = known.beyond(samples.with_(temperature=40.0 * ones), [])
    assert 'the temperature' in note
    moved = JointStates(('a', 'b'), samples.arm.position + [0.0, 0.3])
    note, = known.beyond(samples.with_(arm=moved), [])
    assert 'the position of b' in note


def test_weight_and_inertia_are_said_to_be_those_of_a_posture():
    def in_posture(angle, seed):
        one = recording(seed)
        return one.with_(joint='a', arm=JointStates(
            ('a', 'b'), np.column_stack((one.position, np.full(len(one), angle)))))
    found = refine([in_posture(0.5, 1)])
    said, = (one for one in found.report.findings if one.code == 'other_joints')
    assert '(b) rested' in said.text
    assert found.report.verdict == 'trust'
    assert 'position of b' not in notes_on(found.model, in_posture(0.5, 2))[1]
    assert 'position of b' in notes_on(found.model, in_posture(1.5, 2))[1]
    assert 'other_joints' not in {one.code for one in refine([recording(1)]).report.findings}


def test_the_error_to_expect_of_averages_is_compared_with_that_of_averages():
    found = refine([recording(1).averaged(10)])
    model, samples = found.model, recording(2)
    assert model.recorded.sample_time == pytest.approx(0.05)
    # Most of what a sample scatters is noise that averages do not have.
    assert rms(model.measured(samples) - model.predict(samples)) > 2.0 * model.recorded.error
    assert 'that refine expected' not in notes_on(model, samples)[1]
