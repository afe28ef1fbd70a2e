# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the verdict says of recordings on which a small error hides that something is wrong."""

import re
from types import SimpleNamespace

from helpers import swings
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS
from friction_comp.model.effects.base import Coverage
from friction_comp.model.motor_check import cautions
from friction_comp.recordings import write_samples
from friction_comp.refinement import judge, refine
from friction_comp.refinement.judge import findings_on_numbers, remaining_dependences
from friction_comp.refinement.prepare import clipped, load_coefficient
from friction_comp.samples import JointStates, Samples
from friction_comp.statistics import rms
from friction_comp.tools import predict

DRIVE = Drive(1.0, 1.0)


def codes(report):
    return {finding.code for finding in report.findings if finding.grade != 'trust'}


def noise(samples, size=0.02):
    return size * np.random.default_rng(0).standard_normal(len(samples))


def refined(motion, current, **more):
    """Refine a motion of which position and velocity were recorded, with another current."""
    return refine([motion.with_(current=current, acceleration=None, **more)], drive=DRIVE)


def unrelated(motion, seed, step=0.5):
    """Return a signal that is no function of the motion, so that no other effect stands for it."""
    knots = np.arange(0.0, motion.time[-1] + 2.0 * step, step)
    return np.interp(motion.time, knots, np.random.default_rng(seed).normal(size=len(knots)))


@pytest.mark.parametrize('sign', ['', 'turned'])
def test_a_torque_behind_the_gear_holds_no_friction_and_says_so(monkeypatch, sign):
    """And nothing of its sign, which only friction tells."""
    monkeypatch.setattr(judge, 'friction_would_push', lambda _: sign)
    motion = swings(1)
    torque = 6.0 * np.sin(motion.position) + 0.3 * motion.acceleration + noise(motion)
    result = refined(motion, torque)
    report = result.report
    assert report.verdict == 'record again'
    assert codes(report) == {'not_friction'}
    # So does the model, where nobody has the report at hand.
    assert '`record again`: No friction shows' in cautions(result.model)[0]


@pytest.mark.parametrize('ends, found', [([-0.1, -0.01], True), ([-0.1, 0.02], False)])
def test_a_friction_below_zero_is_no_friction(ends, found):
    numbers = SimpleNamespace(coulomb=-0.04, viscous=0.06, inertia=None,
                              intervals={'coulomb': ends})
    said = {one.code for one in findings_on_numbers(numbers)}
    assert ('impossible' in said) == found


@pytest.mark.parametrize('ends, error, found', [
    ([-21.0, 43.0], 3.0, True), ([-0.02, 0.02], 3.0, False), ([0.1, 43.0], 3.0, False)])
def test_a_friction_of_any_size_is_not_known_however_well_the_model_predicts(ends, error, found):
    numbers = SimpleNamespace(coulomb=max(ends[0], 0.0), viscous=0.1, inertia=None,
                              intervals={'coulomb': ends})
    said = {one.code: one for one in findings_on_numbers(numbers, error)}
    assert ('impossible' in said) == found


@pytest.mark.parametrize(('size', 'code', 'grade'), [
    (1e-4, 'little_motion', 'record again'), (0.1, 'little_motion', 'trust in part')])
def test_a_joint_that_only_gave_way_has_shown_no_friction(size, code, grade):
    # Torques that bend a gear over 20 steps of an encoder, and the same over as many coarse steps.
    motion = swings(3)
    step = np.ptp(motion.position) / 20.0
    steps = step * np.round(motion.position / step + 0.2 * noise(motion, 1.0))
    current = np.tanh(motion.velocity / 0.02) + motion.velocity + motion.position + noise(motion)
    report = refine([motion.with_(position=size * steps, current=current, velocity=None,
                                  acceleration=None)], drive=DRIVE).report
    assert code in codes(report)
    assert (report.verdict == 'record again') == (grade == 'record again')


def test_a_load_of_the_other_sign_does_not_double_the_weight():
    """The link's torque, as the sensor shows it, is what the motor carries, and no push."""
    motion = swings(2, 60.0)
    link = 3.0 * np.sin(motion.position) + unrelated(motion, 2)
    result = refined(motion, motion.current + link, load=link)
    assert 'wrong_sign' in codes(result.report)
    assert result.report.verdict == 'record again'
    assert result.model.sigmoid.line[1] == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize('share', [0.1, 0.3])
def test_the_load_that_the_motor_carries_is_fitted_however_small_its_coefficient(share):
    """Gears, or a sensor's filter, may leave a fraction of -1/(k_t·n) of it."""
    motion = swings(3)
    load = unrelated(motion, 3, 0.25)
    samples = motion.with_(current=motion.current - share * load, load=load)
    assert load_coefficient(samples, clipped(samples.current), DRIVE) == 0.0
    effect, = (one for one in refined(samples, samples.current).report.effects
               if one.name == 'load_torque')
    assert effect.parameters['coefficients'][0] == pytest.approx(-share, rel=0.1)


def test_one_joint_of_an_arm_without_the_others_is_not_trusted():
    """What its siblings do to it looks like a spring that pushes away from its middle."""
    motion, other = swings(4), swings(5)
    current = (motion.current - 1.4 * motion.position + 0.4 * np.cos(other.position)
               * np.sin(other.position + motion.position))
    report = refined(motion, current).report
    assert report.verdict != 'trust'
    assert codes(report) & {'impossible', 'explains_little', 'unexplained', 'extrapolates'}


@pytest.mark.parametrize('size', [0.0, 0.006, 0.012])
def test_an_error_that_changes_as_slowly_as_the_recording_is_long_is_said(size):
    """Its cause cannot be tested, since all that varies as slowly explains it; it is no noise."""
    motion = swings(14, 60.0)
    slow = np.sin(2.0 * np.pi * motion.time / 30.0)
    found = remaining_dependences(motion, size * slow + noise(motion, 0.003), 0.001)
    # Twelve means of five seconds keep 0.91 of a wave of 30 seconds.
    power = 0.5 * size ** 2
    assert sum(one.strength for one in found if one.variable == 'time') == pytest.approx(
        0.91 * power / (power + 0.003 ** 2), abs=0.04)


def test_a_model_that_is_no_better_than_a_constant_is_worthless():
    motion = swings(8)
    report = refined(motion, 5.0 + unrelated(motion, 8)).report
    assert report.after.held_out_rmse < 0.4 * report.signal_rms
    assert 'explains_little' in codes(report)
    assert report.verdict == 'record again'


def test_joints_that_move_as_one_are_said_also_where_the_links_are_known():
    motion = swings(9)
    both = np.column_stack((motion.position, 0.5 * motion.position))
    weight = 2.0 * np.sin(motion.position)
    report = refined(motion, motion.current + weight, rigid_body=weight,
                     arm=JointStates(('lift', 'bend'), both), joint='lift').report
    assert 'other_joints' in codes(report)
    assert report.verdict == 'record again'


def staircase(seed, count):
    """Return a joint at twelve constant speeds, up and down, and sums of sines of the same joint.

    Coulomb friction is 0.57, viscous 0.52, inertia 0.12. The velocity is noisy, or in whole counts.
    """
    rng = np.random.default_rng(seed)
    speeds = np.linspace(0.1, 1.2, 12)
    steps = np.repeat(np.concatenate((speeds, speeds[::-1])) * np.tile((1.0, -1.0), 12), 300)
    velocity = np.convolve(steps, np.full(5, 0.2), 'same')
    time = np.arange(len(velocity)) * 0.005
    sines = 0.6 * np.cos(0.9 * time) + 0.4 * np.cos(2.3 * time) + 0.2 * np.cos(5.1 * time)

    def samples(v):
        current = 0.57 * np.tanh(v / 0.02) + 0.52 * v + 0.12 * np.gradient(v, time)
        measured = count * np.round(v / count) if count else v + 0.01 * rng.normal(size=len(v))
        return Samples(time=time, position=np.cumsum(v) * 0.005, velocity=measured,
                       current=current + 0.03 * rng.normal(size=len(v)))
    return samples(velocity), samples(sines)


@pytest.mark.parametrize('count', [0.0, 0.024])
def test_the_error_elsewhere_of_a_staircase_is_that_of_another_motion(count):
    fitted, other = staircase(1, count)
    result = refine([fitted], drive=DRIVE)
    moving = np.abs(other.velocity) > 0.05
    true = rms((other.current - result.model.predict(other))[moving])
    # The starts of a staircase are faster than anything else.
    assert result.report.after.elsewhere_motion_rmse > 0.67 * true
    assert result.report.friction.coulomb == pytest.approx(0.57, abs=0.01)


def test_a_shaft_that_turns_many_times_has_only_effects_that_repeat_every_turn():
    often = Coverage(0.1, 5.0, 0.05, 0.0, 400.0, 60.0)
    for name in ('spring', 'bump'):
        assert not EFFECTS[name].can_show(often)
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 60.0, 0.01)
    speed = 6.0 + 3.0 * np.sin(0.7 * time)
    position = np.cumsum(speed) * 0.01
    current = (0.5 + 0.02 * speed + 0.1 * np.cos(3.0 * position)
               + 0.05 * np.interp(time, np.arange(0.0, 61.0), rng.normal(size=61))
               + 0.02 * rng.normal(size=len(time)))
    report = refine([Samples(time=time, position=position, current=current)], drive=DRIVE).report
    waves = [one.parameters['frequency'] for one in report.effects if 'frequency' in one.parameters]
    assert waves
    assert np.abs(np.array(waves) - np.round(waves)) == pytest.approx(0.0, abs=0.02)
    assert min(waves) > 0.9


@pytest.mark.parametrize('value', [0.0, 1e-308, -1e-311])
def test_an_uninitialised_effort_is_zero(value):
    samples = swings(11)
    with pytest.raises(InputError, match='^the current is zero throughout.*the motor has to'):
        refine([samples.with_(current=np.full(len(samples), value), acceleration=None)])


def test_predict_reads_what_refine_reads(tmp_path):
    """Of an arm, other joints may brake a joint's motor: that is no reversed sign."""
    motion = swings(12)
    current = -0.5 * np.tanh(motion.velocity / 0.01) + noise(motion)
    write_samples(tmp_path / 'arm', [motion.with_(joint='lift', current=current, acceleration=None),
                                     swings(13).with_(joint='bend', acceleration=None)])
    model = refined(motion, motion.current).model
    model.save(tmp_path / 'model.yaml')
    assert predict.main([
        str(tmp_path / 'arm'), '--joint', 'lift', '--model', str(tmp_path / 'model.yaml'),
        '--output', str(tmp_path / 'p.csv')]) == 0


def one_way(ways):
    """Return a joint under gravity that goes one way, or to and fro, ever faster."""
    time = np.arange(0.0, 5.0 * ways, 2e-3)
    phase = np.pi * np.minimum((time / time[-1]) ** 1.3, 1.0) * ways
    position = 0.8 * (1.0 - np.cos(phase))
    velocity = np.gradient(position, time)
    current = 0.5 * np.tanh(velocity / 0.02) + 0.2 * velocity + 1.5 * np.sin(position)
    samples = Samples(time=time, position=position, current=current)
    return samples.with_(current=current + noise(samples))


@pytest.mark.parametrize('ways, grade', [(1, {'little_motion'}), (6, set())])
def test_a_recording_of_one_way_says_nothing_of_others_however_well_it_is_predicted(ways, grade):
    report = refine([one_way(ways)], drive=DRIVE).report
    assert codes(report) & {'little_motion'} == grade
    assert (report.verdict == 'record again') == bool(grade)


def test_friction_is_not_read_from_the_help_that_a_person_had():
    """The motor gives 0.75 of friction as commanded, a hand the rest."""
    motion = swings(4)
    given = 0.75 * motion.current
    helped = motion.with_(current=given + noise(motion), command=given, acceleration=None,
                          direction=np.sign(motion.velocity))
    report = refine([helped]).report
    assert report.verdict == 'record again'
    assert 'not_friction' in codes(report)
    measured = helped.with_(load=0.25 * motion.current)
    assert 'not_friction' not in codes(refine([measured], drive=Drive(1.0, 1.0)).report)
    # A controller that follows a reference gives the rest itself.
    follower = helped.with_(current=motion.current, command=0.2 * np.roll(given, 60))
    assert 'not_friction' not in codes(refine([follower]).report)
    # With direction 0, or none, who commanded is not known, and is said.
    asked = helped.with_(direction=0.0 * given)
    for unknown in (asked, asked.with_(direction=None)):
        report = refine([unknown]).report
        assert 'not_friction' in codes(report)
        assert report.verdict == 'trust in part'
    # A motor that accelerates the joint moves it by itself.
    driven = motion.current + 0.3 * motion.acceleration
    driver = asked.with_(current=driven + noise(motion), command=driven)
    for other in (follower.with_(direction=0.0 * given), driver):
        assert 'not_friction' not in codes(refine([other]).report)


def of_two_days(**changes):
    """Return the report of two recordings of which the second has other columns."""
    first, second = swings(1), swings(2)
    v = second.velocity
    more = (changes.get('coulomb', 0.0) * np.tanh(v / 0.01)
            + changes.get('inertia', 0.0) * second.acceleration)
    days = [part.with_(acceleration=None) for part in (
        first.with_(current=first.current + 0.05 * first.acceleration),
        second.with_(current=second.current + 0.05 * second.acceleration + more))]
    return refine(days).report


@pytest.mark.parametrize('changes, words', [
    ({'coulomb': 0.15}, 'Coulomb friction, with 0.5 to 0.65'),
    ({'inertia': 0.1}, 'inertia, with 0.05 to 0.15')])
def test_recordings_that_differ_are_told_and_by_what(changes, words):
    """Fitted together, they give a mean that neither has."""
    report = of_two_days(**changes)
    assert report.verdict == 'trust in part'
    text, = (one.text for one in report.findings if one.code == 'recordings_differ')
    name, least, most = re.search(r'differs most is (.*), (\S+) to (\S+) in fits', text).groups()
    expected = re.fullmatch(r'(.*), with (\S+) to (\S+)', words).groups()
    assert name == expected[0]
    assert [float(least), float(most)] == pytest.approx(
        [float(expected[1]), float(expected[2])], rel=0.05)


def test_recordings_that_agree_are_not_told_apart():
    report = of_two_days()
    assert 'recordings_differ' not in codes(report)


def test_a_current_that_is_zero_but_for_single_values_is_no_limit():
    motion = swings(2)
    current = np.zeros(len(motion))
    current[::300] = -7.0
    with pytest.raises(InputError, match='the current is zero in nearly all motion'):
        refine([motion.with_(current=current)])
