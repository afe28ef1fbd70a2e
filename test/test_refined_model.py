# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The written model, its report, and when it is not to be trusted."""



from helpers import swings
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import Breakaway
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import refine
from friction_comp.statistics import rms

RAW = {'method': 'zero-phase Butterworth', 'source': 'velocity', 'bandwidth': None}


def with_ripple(seed, lag=0):
    """Return samples whose current holds cogging and comes some samples late."""
    samples = swings(seed)
    current = samples.current + 0.1 * np.cos(14.0 * samples.position)
    samples = samples.with_(current=np.roll(current, lag), acceleration=None)
    return samples.take(slice(20, -20))


@pytest.mark.parametrize('scale', [0.0, 1.0])
def test_a_weight_that_the_urdf_lacks_stays_beside_friction_by_the_links_load(scale):
    """A name must not change what the model predicts; `scale` is that of the URDF's torque."""
    samples = swings(2)
    links = 0.3 * np.cos(samples.position - 1.2) + 1e-3
    weight = 0.6 * np.cos(samples.position)
    current = samples.current + weight + scale * links + (
        0.15 * np.abs(links) * np.sign(samples.velocity))
    report = refine([samples.with_(current=current, rigid_body=links)]).report
    assert report.after.held_out_rmse < 1.2 * 0.02
    assert 'gravity' in {effect.name for effect in report.effects}


@pytest.mark.parametrize('case', ['plain', 'late', 'given', 'carried'])
def test_the_model_written_is_the_model_judged(case, tmp_path):
    """By the file, on the raw recording: its error is the one that the report gives."""
    samples, model, drive = with_ripple(1), None, None
    if case == 'late':
        samples = with_ripple(1, lag=-6)
    if case == 'given':
        model = FrictionModel(Drive(0.1, 100.0), Sigmoid(0.4, -0.45, 150.0, 0.0, 0.1),
                              effects=[EFFECTS['gravity']({'coefficients': [0.1, 0.0]})])
    if case == 'carried':
        drive = Drive(0.1, 100.0)
        samples = samples.with_(current=0.6 * samples.current,
                                load=0.4 * samples.current * drive.torque_per_current)
    result = refine([samples], model, drive)
    result.model.save(tmp_path / 'model.yaml')
    written = FrictionModel.load(tmp_path / 'model.yaml')
    error = samples.current - written.predict(samples, same_recording=True)
    after = result.report.after
    assert rms(error[result.usable]) == pytest.approx(after.fit_rmse, rel=1e-6)
    assert after.fit_rmse < 0.025
    assert after.fit_rmse == pytest.approx(after.held_out_rmse, rel=0.1)
    assert (written.differentiation.get('lag') is not None) == (case == 'late')


@pytest.mark.parametrize('level, factor', [(0.4, 1.25), (0.49, 1.0)])
def test_breakaway_of_another_day_changes_with_friction(level, factor):
    """Friction is 0.5 A today: what was 0.4 A then has grown by a quarter, at rest too."""
    then = FrictionModel(Drive(0.1, 100.0), Sigmoid(level, -level, 150.0, 0.0, 0.2),
                         breakaway=Breakaway(0.6, -0.56, 0.03, 0.03))
    result = refine([swings(1)], then)
    both = result.model.breakaway
    assert both.positive_mean == pytest.approx(0.6 * factor, rel=0.02)
    assert both.negative_mean == pytest.approx(-0.56 * factor, rel=0.02)
    assert both.positive_std == pytest.approx(0.03 * factor, rel=0.02)
    said = [one.text for one in result.report.findings if 'Breakaway friction' in one.text]
    assert len(said) == (factor != 1.0)
    assert result.report.friction.breakaway['positive']['mean'] == both.positive_mean


def test_the_error_to_expect_elsewhere_is_not_below_that_of_another_recording():
    result = refine([with_ripple(2)])
    after = result.report.after
    for seed in (3, 4):
        other = with_ripple(seed)
        assert rms(other.current - result.model.predict(other)) < 1.3 * after.elsewhere_rmse
    assert after.elsewhere_rmse < 0.04
    assert max(after.part_rmse) == after.worst_part_rmse >= after.held_out_rmse


def test_a_linear_axis_has_no_weight_once_a_turn():
    samples = swings(6)
    samples = samples.with_(current=samples.current + 0.4 * np.sin(samples.position))
    for unit, found in (('N·m', True), ('N', False)):
        report = refine([samples], unit=unit).report
        assert ('gravity' in {effect.name for effect in report.effects}) == found
