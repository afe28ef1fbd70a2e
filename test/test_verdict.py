# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the verdict says of recordings on which a small error hides that something is wrong.

And what refinement must not be misled by: hidden inertia, filtered velocity, one-sided motion, a
person's help, and what hardly varied.
"""

from types import SimpleNamespace

from helpers import swings
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.model.effect import Coverage
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.motor_check import cautions
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import refine
from friction_comp.refinement.judge import findings_on_numbers
from friction_comp.refinement.prepare import coverage_of
from friction_comp.samples import JointStates, Samples
from friction_comp.statistics import rms
from friction_comp.tools.predict import compared

DRIVE = Drive(1.0, 1.0)
NOISE = 0.003


def codes(report):
    return {finding.code for finding in report.findings if finding.grade != 'trust'}


def names(report):
    return [effect.name for effect in report.effects]


def noise(samples, size=0.02):
    return size * np.random.default_rng(0).standard_normal(len(samples))


def plain(samples, **more):
    """Return a motion of which position and velocity were recorded."""
    return samples.with_(acceleration=None, **more)


def refined(motion, current, **more):
    return refine([plain(motion, current=current, **more)], drive=DRIVE)


def unrelated(motion, seed, step=0.5):
    """Return a signal that is no function of the motion, so that no other effect stands for it."""
    knots = np.arange(0.0, motion.time[-1] + 2.0 * step, step)
    return np.interp(motion.time, knots, np.random.default_rng(seed).normal(size=len(knots)))


def stroked(seed, extra=lambda t, q, v, a: 0.0, duration=80.0, reach=1.0, counts=100_000,
            rate=100.0, **signals):
    """Return samples of minimum-jerk strokes with noise, in an encoder's steps."""
    rng, parts, place = np.random.default_rng(seed), [], 0.0
    while sum(map(len, parts)) < duration * rate:
        goal = rng.uniform(-0.8, 0.8)
        length = max(20, int(rate * 1.875 * abs(goal - place) / rng.uniform(0.15, 0.9)))
        s = np.arange(length) / length
        parts.append(place + (goal - place) * (10 * s ** 3 - 15 * s ** 4 + 6 * s ** 5))
        place = goal
    q = reach * np.concatenate(parts)[:int(duration * rate)]
    t, step = np.arange(len(q)) / rate, 2.0 * np.pi / counts
    v = np.gradient(q, t)
    current = 0.12 * np.tanh(v / 0.02) + 0.06 * v + extra(t, q, v, np.gradient(v, t))
    noise = NOISE * np.random.default_rng([seed, 7]).standard_normal(len(t))
    return Samples(time=t, position=np.round(q / step) * step, current=current + noise, **signals)


# What no small error hides.

def behind_the_gear():
    motion = swings(1)
    return plain(motion, current=6.0 * np.sin(motion.position) + 0.3 * motion.acceleration
                 + noise(motion))


def gave_way(size):
    """Torques that bend a gear over 20 steps of an encoder, and the same over as many coarse steps.
    """
    motion = swings(3)
    step = np.ptp(motion.position) / 20.0
    steps = step * np.round(motion.position / step + 0.2 * noise(motion, 1.0))
    current = np.tanh(motion.velocity / 0.02) + motion.velocity + motion.position + noise(motion)
    return plain(motion, position=size * steps, current=current, velocity=None)


def one_way(ways):
    """Return a joint under gravity that goes one way, or to and fro, ever faster."""
    time = np.arange(0.0, 5.0 * ways, 2e-3)
    phase = np.pi * np.minimum((time / time[-1]) ** 1.3, 1.0) * ways
    position = 0.8 * (1.0 - np.cos(phase))
    velocity = np.gradient(position, time)
    current = 0.5 * np.tanh(velocity / 0.02) + 0.2 * velocity + 1.5 * np.sin(position)
    return Samples(time=time, position=position, current=current + noise(time))


def moving_as_one(known):
    """Return a joint whose sibling moves as it does, with its links known or not."""
    motion = swings(9)
    both = np.column_stack((motion.position, 0.5 * motion.position))
    weight = 2.0 * np.sin(motion.position)
    return plain(motion, current=motion.current + weight, joint='lift', arm=JointStates(
        ('lift', 'bend'), both), rigid_body=weight if known else None)


def test_of_other_joints_a_model_holds_what_it_saw():
    motion, other = swings(9), swings(10)
    samples = plain(motion, current=motion.current + np.sin(motion.position + other.position),
                    joint='lift', arm=JointStates(('lift', 'bend'), np.column_stack((
                        motion.position, other.position))))
    effect, = (one for one in refine([samples], drive=DRIVE).model.effects
               if one.name == 'other_joints')
    assert np.abs(effect.current(motion.with_(coupling=50.0 * other.position))).max() < 1.6


def measured_as(scale):
    """Return a recording whose velocity is the slope of position over a scale."""
    samples = stroked(2, duration=40.0)
    return samples.with_(velocity=np.gradient(samples.position, samples.time) / scale)


def limited():
    samples = swings(11)
    return samples.with_(current=np.clip(samples.current, -0.7, 0.7))


@pytest.mark.parametrize(('samples', 'code', 'verdict'), [
    (behind_the_gear(), 'not_friction', 'record again'),
    (gave_way(1e-4), 'little_motion', 'record again'),
    (gave_way(0.1), 'little_motion', None),
    (one_way(1), 'little_motion', 'record again'),
    (moving_as_one(True), 'other_joints', 'record again'),
    (moving_as_one(False), 'other_joints', 'record again'),
    (plain(swings(8), current=5.0 + unrelated(swings(8), 8)), 'explains_little', 'record again'),
    (measured_as(1.6), 'signals', 'trust in part'),
    (measured_as(0.6), 'signals', 'trust in part'),
    (limited(), 'signals', None)])
def test_what_a_recording_does_not_show_is_said_however_small_the_error(samples, code, verdict):
    result = refine([samples], drive=DRIVE)
    assert code in codes(result.report)
    if verdict:
        assert result.report.verdict == verdict
    else:
        assert result.report.verdict != 'trust'
        assert result.report.verdict != 'record again' or code == 'signals'
    if code == 'not_friction':
        # So does the model, where nobody has the report at hand.
        assert '`record again`: No friction shows' in cautions(result.model)[0]


@pytest.mark.parametrize('samples', [one_way(6), measured_as(1.02)])
def test_what_is_right_is_trusted(samples):
    report = refine([samples], drive=DRIVE).report
    assert not codes(report) & {'little_motion', 'signals'}
    assert report.verdict != 'record again'


@pytest.mark.parametrize('coulomb, ends, error, found', [
    (-0.04, [-0.1, -0.01], np.inf, True), (-0.04, [-0.1, 0.02], np.inf, False),
    (0.0, [-21.0, 43.0], 3.0, True), (0.0, [-0.02, 0.02], 3.0, False),
    (0.1, [0.1, 43.0], 3.0, False)])
def test_a_friction_below_zero_or_of_any_size_is_not_known(coulomb, ends, error, found):
    numbers = SimpleNamespace(coulomb=coulomb, viscous=0.1, inertia=None,
                              intervals={'coulomb': ends})
    assert ('impossible' in {one.code for one in findings_on_numbers(numbers, error)}) == found


def test_one_joint_of_an_arm_without_the_others_is_not_trusted():
    """What its siblings do to it looks like a spring that pushes away from its middle."""
    motion, other = swings(4), swings(5)
    current = (motion.current - 1.4 * motion.position + 0.4 * np.cos(other.position)
               * np.sin(other.position + motion.position))
    report = refined(motion, current).report
    assert report.verdict != 'trust'
    assert codes(report) & {'impossible', 'explains_little', 'unexplained', 'extrapolates'}


@pytest.mark.parametrize('changes', [{'coulomb': 0.15}, {'inertia': 0.1}, {}])
def test_recordings_that_differ_are_told(changes):
    """Fitted together, they give a mean that neither has."""
    both = {'coulomb': 0.5, 'inertia': 0.05}
    changed = {key: value + changes.get(key, 0.0) for key, value in both.items()}
    report = refine([plain(swings(1, **both)), plain(swings(2, **changed))]).report
    assert ('recordings_differ' in codes(report)) == bool(changes)
    assert not changes or report.verdict == 'trust in part'


# Loads, and who moves the joint.

def test_a_load_of_the_other_sign_does_not_double_the_weight():
    """The link's torque, as the sensor shows it, is what the motor carries, and no push."""
    motion = swings(2, 60.0)
    link = 3.0 * np.sin(motion.position) + unrelated(motion, 2)
    result = refined(motion, motion.current + link, load=link)
    assert 'wrong_sign' in codes(result.report)
    assert result.report.verdict == 'record again'
    assert result.model.sigmoid.line[1] == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize('share', [0.1, 0.3])
@pytest.mark.parametrize('drive', [DRIVE, None])
def test_the_load_that_the_motor_carries_is_fitted_however_small_its_coefficient(share, drive):
    """Gears, or a sensor's filter, may leave a fraction of -1/(k_t·n) of it; or none is known."""
    motion = swings(3)
    load = unrelated(motion, 3, 0.25)
    report = refine([plain(motion, current=motion.current - share * load, load=load)],
                    drive=drive).report
    effect, = (one for one in report.effects if one.name == 'load_torque')
    assert effect.parameters['coefficients'][0] == pytest.approx(-share, rel=0.1)


def test_friction_is_not_read_from_the_help_that_a_person_had():
    """The motor gives 0.75 of friction as commanded, a hand the rest."""
    motion = swings(4)
    given = 0.75 * motion.current
    helped = plain(motion, current=given + noise(motion), command=given,
                   direction=np.sign(motion.velocity))
    # A controller that follows a reference gives the rest itself.
    follower = helped.with_(current=motion.current, command=0.2 * np.roll(given, 60))
    # With direction 0, or none, who commanded is not known, and is said.
    asked = helped.with_(direction=0.0 * given)
    # A motor that accelerates the joint moves it by itself.
    driven = motion.current + 0.3 * motion.acceleration
    for samples, verdict in (
            (helped, 'record again'), (asked, 'trust in part'),
            (asked.with_(direction=None), 'trust in part'),
            (helped.with_(load=0.25 * motion.current), None), (follower, None),
            (follower.with_(direction=0.0 * given), None),
            (asked.with_(current=driven + noise(motion), command=driven), None)):
        report = refine([samples], drive=DRIVE if samples.load is not None else None).report
        assert ('not_friction' in codes(report)) == bool(verdict)
        assert verdict in (None, report.verdict)


def test_effects_are_named_rightly_where_a_person_carries_the_load():
    """Under a law, the measured load belongs to model and start alike, and is nothing found."""
    motion, drive = swings(4), Drive(0.1, 100.0)
    rng = np.random.default_rng(4)
    model = FrictionModel(drive=drive, sigmoid=Sigmoid(0.1, -0.1, 40.0, 0.0, 0.05))
    wanted = model.sigmoid(motion.velocity)
    current = 0.8 * wanted
    load = (wanted + 0.05 * np.cos(motion.position) - current) * drive.torque_per_current
    samples = plain(
        motion, command=current, current=current + 0.001 * rng.normal(size=len(motion)),
        load=load + 0.005 * rng.normal(size=len(motion)),
        direction=np.sign(motion.velocity).astype(int))
    result = refine([samples], model, drive)
    assert 'gravity' in names(result.report)
    assert [effect.name for effect in result.model.effects] == [
        *names(result.report), 'load_torque']


def pendulum(seed, load_friction=0.15):
    """Return a joint that carries a weight, its friction growing with what it carries."""
    motion = swings(seed, 60.0, coulomb=0.4, inertia=0.3)
    weight = 3.0 * np.sin(motion.position)
    return plain(motion, current=motion.current + weight + load_friction * np.abs(
        weight) * np.tanh(motion.velocity / 0.01))


@pytest.mark.slow
def test_friction_that_grows_with_the_carried_weight_is_found_without_a_torque_sensor():
    result = refine([pendulum(1)])
    report = result.report
    found = {effect.name: effect for effect in report.effects}
    assert {'gravity', 'inner_load_friction'} <= set(found)
    assert 'bump' not in found
    own = found['inner_load_friction']
    assert own.parameters['coefficients'][0] == pytest.approx(0.15, rel=0.15)
    low, high = own.intervals['coefficients'][0]
    assert low < own.parameters['coefficients'][0] < high
    assert report.unit == 'N·m'
    assert 'N·m' in own.in_words
    assert ' A ' not in own.in_words
    assert report.verdict in ('trust', 'trust in part')
    # On another recording it is the same drive.
    fresh = pendulum(2)
    moving = np.abs(fresh.velocity) > 0.05
    assert np.std((fresh.current - result.model.predict(fresh))[moving]) < 0.03


# What effects are taken for others.

@pytest.mark.slow
def test_inertia_is_found_beside_a_larger_effect_without_a_name():
    def rough(t, q, v, a):
        place = 0.08 * np.sign(np.sin(9.0 * q) + 0.3) * np.where(q > 0.1, 1.0, -0.4)
        return 0.05 * a + place + np.where(t > 61.0, 0.08, 0.0) * np.tanh(v / 0.02)
    report = refine([stroked(3, rough)], drive=DRIVE).report
    inertia = next(e for e in report.effects if e.name == 'inertia')
    assert inertia.parameters['coefficients'][0] == pytest.approx(0.05, rel=0.25)
    assert report.unexplained


@pytest.mark.slow
def test_a_lasting_change_is_not_called_warm_up():
    report = refine([stroked(5, lambda t, q, v, a: (t > 55.0) * 0.4 * (
        0.12 * np.tanh(v / 0.02) + 0.06 * v))], drive=DRIVE).report
    # It may look like one, which is then said to be open.
    assert 'time' in {*(one.variable for one in report.unexplained),
                      *(one for entry in report.ambiguous for one in entry.between)}
    assert report.verdict != 'trust'


def test_the_error_said_is_that_of_a_day_without_the_same_drift():
    samples = stroked(8, lambda t, q, v, a: 0.15 * np.exp(-t / 15.0) * np.tanh(v / 0.02))
    found = refine([samples], drive=DRIVE)
    error = (samples.current - found.model.predict(samples))[found.usable]
    assert 'warm_up' in names(found.report)
    assert found.report.after.elsewhere_motion_rmse >= rms(error) > 3 * NOISE


def test_noise_at_rest_is_no_motion_in_both_directions():
    velocity = np.append(np.full(500, 0.5), 1e-3 * np.random.default_rng(1).normal(size=1500))
    time = 0.01 * np.arange(2000)
    samples = Samples(time=time, position=0.01 * np.cumsum(velocity), current=0.0 * time,
                      velocity=velocity)
    assert not coverage_of(samples, np.ones(2000, bool), 0.0, samples).both_directions


def test_friction_of_the_size_of_acceleration_is_traced_to_it():
    report = refine([stroked(6, lambda t, q, v, a: 0.03 * np.abs(a))], drive=DRIVE).report
    assert report.unexplained[0].variable == 'acceleration'
    assert 'direction_asymmetry' not in names(report)


@pytest.mark.slow
def test_coarse_velocities_are_not_mistaken_for_a_lag():
    assert names(refine([stroked(7, reach=0.4, counts=20_000)], drive=DRIVE).report) == []


@pytest.mark.parametrize('reach, name', [(0.2, 'spring'), (1.5, 'gravity')])
def test_a_weight_over_a_few_degrees_looks_like_a_spring(reach, name):
    t = np.arange(0.0, 40.0, 0.005)
    q = reach * (0.6 * np.sin(1.1 * t) + 0.4 * np.sin(2.9 * t + 0.4))
    v = np.gradient(q, t)
    current = (0.8 * np.tanh(v / 0.02) + 0.3 * v + 0.05 * np.gradient(v, t) + 0.5 * np.cos(q - 0.3)
               + np.random.default_rng(1).normal(0.0, 0.02, len(t)))
    report = refine([Samples(time=t, position=q, velocity=v, current=current)]).report
    assert {'inertia', name} <= set(names(report))
    # What predicts as well is said, and lowers the verdict.
    rivals = [one for effect in report.effects for one in effect.instead]
    assert report.verdict == ('trust in part' if rivals else 'trust')


@pytest.mark.slow
def test_a_bump_that_a_fold_crosses_one_way_only_is_still_found():
    def bump(t, q, v, a):
        return 0.05 * np.exp(-((q - 0.74) / 0.05) ** 2) * np.tanh(v / 0.02)
    result = refine([stroked(8, bump, 100.0)], drive=DRIVE)
    assert names(result.report)[0] == 'bump'
    other = stroked(9, bump)
    moving = np.abs(np.gradient(other.position, other.time)) > 0.02
    assert rms((result.model.predict(other) - other.current)[moving]) < 1.3 * NOISE


def test_a_shaft_that_turns_many_times_has_only_effects_that_repeat_every_turn():
    often = Coverage(0.1, 5.0, 0.05, 0.0, 400.0, 60.0)
    assert not any(EFFECTS[name].can_show(often) for name in ('spring', 'bump'))
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


def test_temperature_is_preferred_to_time_if_both_explain_equally():
    base = swings(6, 150.0, 0.02)
    drift = np.exp(-base.time / 60.0)
    current = base.current + 0.25 * drift * np.tanh(base.velocity / 0.01)
    report = refine([plain(base, current=current + noise(base, 0.01), temperature=np.round(
        43.0 - 18.0 * drift, 1))]).report
    assert [e.variable for e in report.effects if e.variable != 'acceleration'] == [
        'temperature']
    assert {'time', 'temperature'} in [set(entry.between) for entry in report.ambiguous]
    assert all(entry.experiment for entry in report.ambiguous)


@pytest.mark.slow
@pytest.mark.parametrize('swept', [True, False])
def test_drift_in_a_sweep_of_frequency_may_be_a_dependence_on_it(swept):
    t = np.arange(0.0, 80.0, 0.01)
    q = 0.4 * (np.sin(2.0 * np.pi * (0.1 + 0.005 * t) * t) if swept else
               np.sin(2.0 * np.pi * 0.31 * t) + 0.5 * np.sin(2.0 * np.pi * 0.87 * t))
    v = np.gradient(q, t)
    current = ((0.12 * np.tanh(v / 0.02) + 0.06 * v) * (1.0 + 0.6 * np.exp(-t / 20.0))
               + 0.01 * np.gradient(v, t) + noise(t, NOISE))
    report = refine([Samples(time=t, position=q, current=current)], drive=DRIVE).report
    assert 'time' in [effect.variable for effect in report.effects]
    said = [question for question in report.ambiguous if 'rose or fell with time' in question.why]
    assert bool(said) == swept


# What hardly varied, beyond which a model is not used without a word.

def recording(seed, load=None, carried=0.0):
    """Give a joint with friction, a part of which grows with the load, as its sensor tells it."""
    samples = swings(seed, 40.0, 0.005, (0.095, 0.24), 0.086, inertia=0.03)
    rng = np.random.default_rng([seed, 1])
    position = samples.position + 2e-5 * rng.standard_normal(len(samples))
    current, side = samples.current, np.tanh(samples.velocity / 0.01)
    if load is not None:
        load = load[0] + load[1] * np.sin(0.3 * samples.time + seed)
        current = current - load + carried * abs(load) * side
        load = load + 0.01 * rng.standard_normal(len(samples))
    return plain(samples, position=position, velocity=None, current=current, load=load)


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


def in_posture(angle, seed):
    one = recording(seed)
    return one.with_(joint='a', arm=JointStates(
        ('a', 'b'), np.column_stack((one.position, np.full(len(one), angle)))))


def test_weight_and_inertia_are_said_to_be_those_of_a_posture():
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
